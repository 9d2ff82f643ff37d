"""Force and tangents of random elements, a good part of them inverted."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrot import refine_rotation
from jaxrot.scenes import elasticity
from jaxrot.scenes.corotational import build
from jaxrot.scenes.tetrahedra import box

BLOCK = box((3, 3, 3), (1.0, 1.0, 1.0))


@functools.cache
def random_elements():
    """A few hundred deformation gradients, a third of them inverted, and all that is computed at them."""
    _, parameters = build(*BLOCK, young=1.0, poisson=0.3, dtype="float64")
    elements = parameters.elements
    rng = np.random.default_rng(0)
    gradients = jnp.asarray(rng.normal(size=(len(BLOCK.tetrahedra), 3, 3)))
    directions = jnp.broadcast_to(jnp.eye(9).reshape(9, 1, 3, 3), (9, *gradients.shape))

    def rotations_of(gradients):
        return refine_rotation(gradients, jnp.eye(3), step="newton", iterations=16)

    def computed(gradients):
        def energy(gradients):
            return elasticity.energy(gradients, rotations_of(gradients), elements)

        rotations = rotations_of(gradients)
        stress = elasticity.stress(gradients, rotations, elements)
        exact = jax.vmap(elasticity.exact_tangent(gradients, rotations, elements))(directions)
        projected = jax.vmap(elasticity.projected_tangent(gradients, rotations, elements))(directions)
        held = jax.vmap(elasticity.held_tangent(rotations, elements))(directions)
        return stress, jax.grad(energy)(gradients), exact, projected, held

    stress, of_energy, *tangents = jax.jit(computed)(gradients)
    dense = [np.asarray(tangent).reshape(9, -1, 9).swapaxes(0, 1) for tangent in tangents]
    return np.asarray(stress), np.asarray(of_energy) / np.asarray(elements.volumes)[:, None, None], *dense


@pytest.mark.exhaustive
def test_the_force_with_rotations_held_is_the_derivative_of_the_energy():
    stress, of_energy, *_ = random_elements()
    np.testing.assert_allclose(stress, of_energy, atol=1e-9 * np.abs(stress).max())


@pytest.mark.exhaustive
def test_the_projected_tangent_is_the_exact_one_without_its_negative_eigenvalues():
    _, _, exact, projected, held = random_elements()
    np.testing.assert_allclose(exact, exact.swapaxes(1, 2), atol=1e-8 * np.abs(exact).max())
    values, vectors = np.linalg.eigh(0.5 * (exact + exact.swapaxes(1, 2)))
    clipped = (vectors * np.maximum(values, 0)[:, None]) @ vectors.swapaxes(1, 2)
    assert (values < -0.1).any()
    np.testing.assert_allclose(projected, clipped, atol=1e-8 * values.max())
    assert np.linalg.eigvalsh(held).min() > -1e-12

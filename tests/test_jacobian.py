"""The 9×9 matrices, against automatic differentiation and against singular vectors."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certificate import analytic_jacobian, assert_within, family_batch, resolved
from differences import POINTS, assert_is_derivative, at_points

from jaxrot import arap_hessian, nearest_rotation, rotation_jacobian, signed_singular_values, twist_modes

RANDOM = np.random.default_rng(0)


def energy(matrix):
    return jnp.sum((matrix - nearest_rotation(matrix)) ** 2)


HESSIAN = jax.jit(jax.hessian(energy))


def test_the_jacobian_is_right_to_rounding_on_every_family(dtype):
    batch = family_batch(dtype)
    eps = np.finfo(dtype).eps
    got = np.asarray(jax.jit(rotation_jacobian)(batch.matrices))
    assert np.isfinite(got).all()
    np.testing.assert_array_equal(got, got.swapaxes(1, 2))
    where = resolved(batch, 1 / (128 * eps))
    exact = analytic_jacobian(batch.matrices[where])
    size = np.sqrt((exact**2).sum((1, 2)))
    holds = (size < np.finfo(dtype).max / 4) & (size > np.finfo(dtype).tiny / eps)
    error = np.sqrt(((got[where] - exact) ** 2).sum((1, 2)))[holds] / size[holds]
    bound = 32 * eps * np.maximum(batch.condition[where], 1)[holds]
    assert_within(error, bound, batch.families[where][holds], "closed form")


def test_the_damped_jacobian_is_that_of_the_damped_rule():
    matrix = POINTS["inverted"]
    damped = functools.partial(nearest_rotation, damping=0.3)
    np.testing.assert_allclose(
        rotation_jacobian(matrix, damping=0.3), jax.jacfwd(damped)(matrix).reshape(9, 9), atol=1e-14
    )
    assert np.abs(rotation_jacobian(matrix, damping=0.3) - rotation_jacobian(matrix)).max() > 0.1


def test_the_twist_modes_are_the_eigenvectors_of_the_jacobian():
    matrices = np.concatenate([RANDOM.standard_normal((50, 3, 3)), np.stack(list(POINTS.values()))])
    eigenvalues, modes = (np.asarray(x) for x in twist_modes(matrices))
    vectors = modes.reshape(-1, 3, 9)
    np.testing.assert_allclose(
        vectors @ vectors.swapaxes(1, 2), np.broadcast_to(np.eye(3), (len(matrices), 3, 3)), atol=1e-14
    )
    s = np.asarray(signed_singular_values(matrices))
    np.testing.assert_allclose(1 / eigenvalues, (s.sum(-1, keepdims=True) - s) / 2, atol=1e-14)
    assert (np.diff(eigenvalues) <= 1e-14).all()
    jacobian = np.asarray(rotation_jacobian(matrices))
    rebuilt = np.einsum("nki,nk,nkj->nij", vectors, eigenvalues, vectors)
    size = eigenvalues[:, :1, None]
    np.testing.assert_allclose(rebuilt / size, jacobian / size, atol=1e-13)


@at_points
@pytest.mark.exhaustive
def test_the_hessian_is_that_of_automatic_differentiation_and_its_projection(matrix):
    plain = np.asarray(arap_hessian(matrix, psd=False))
    np.testing.assert_allclose(plain, np.asarray(HESSIAN(matrix)).reshape(9, 9), atol=1e-13)
    values, vectors = np.linalg.eigh(plain)
    projected = vectors @ np.diag(np.maximum(values, 0)) @ vectors.T
    got = np.asarray(arap_hessian(matrix))
    np.testing.assert_allclose(got, projected, atol=1e-13)
    np.testing.assert_array_equal(got, got.T)


@pytest.mark.parametrize("matrix", [2 * np.eye(3), np.eye(3) + POINTS["generic"], 0.8 * POINTS["equal"]])
@pytest.mark.exhaustive
def test_the_derivative_of_the_hessian_is_right_at_equal_singular_values_too(matrix):
    """Nothing is projected, nothing with singular values that differ, two of three sums are above 2."""
    assert_is_derivative(jax.jit(jax.jacfwd(arap_hessian)), jax.jit(arap_hessian), matrix)


def test_what_is_compressed_has_no_curvature_along_its_twists():
    values = np.linalg.eigvalsh(jax.jit(arap_hessian)(np.diag([0.9, 0.6, -0.3])))
    np.testing.assert_allclose(values, [0, 0, 0, 2, 2, 2, 2, 2, 2], atol=1e-14)


@pytest.mark.exhaustive
def test_the_projected_hessian_is_semidefinite_on_every_family(dtype):
    batch = family_batch(dtype)
    hessian = np.asarray(jax.jit(arap_hessian)(batch.matrices)).astype(np.float64)
    values = np.linalg.eigvalsh(hessian)
    # Of matrices of norm 2, and in float64 the eigenvalues themselves are rounded.
    rounding = 32 * np.finfo(dtype).eps
    assert_within(-values[:, 0], rounding, batch.families, "negative eigenvalue")
    assert_within(values[:, -1] - 2, rounding, batch.families, "largest eigenvalue")
    # Where nothing is compressed nothing is projected; where all is, three eigenvalues are 0.
    sums = batch.singular_values[:, 1] + batch.singular_values[:, 2]
    plain = np.asarray(jax.jit(functools.partial(arap_hessian, psd=False))(batch.matrices))
    stretched = (sums > 2.001) & (batch.condition < 1e3)
    np.testing.assert_allclose(hessian[stretched], plain[stretched], atol=512 * np.finfo(dtype).eps)
    compressed = batch.singular_values[:, 0] < 0.99
    np.testing.assert_allclose(values[compressed, :3], 0, atol=16 * np.finfo(dtype).eps)


def test_a_step_with_the_projected_hessian_goes_down_from_every_start():
    """Newton's direction against the gradient; along the twists that are projected to 0 there is none."""
    matrices = RANDOM.standard_normal((200, 3, 3)) * 0.6
    gradient = np.asarray(2 * (matrices - np.asarray(nearest_rotation(matrices)))).reshape(-1, 9)
    hessian = np.asarray(arap_hessian(matrices))
    direction = -np.einsum("nij,nj->ni", np.linalg.pinv(hessian, rcond=1e-10, hermitian=True), gradient)
    assert (np.einsum("ni,ni->n", direction, gradient) < 0).all()

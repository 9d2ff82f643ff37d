"""`derivative="unrolled"`: the derivative of the iterations that are run."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certificate import family_batch
from differences import POINTS, difference_jacobian, turned
from marks import mostly_exhaustive

from jaxrot import STEPS, nearest_rotation, refine_quaternion_wxyz, refine_rotation
from jaxrot._algebra import mat3, quaternion

RANDOM = np.random.default_rng(0)


def by_differences(function, matrix, start, h=1e-6):
    """How the result changes with the entries of the matrix, and with turns of the start about its axes."""
    by_start = [
        (np.asarray(function(matrix, start @ turned(axis, h))) - np.asarray(function(matrix, start @ turned(axis, -h))))
        / (2 * h)
        for axis in np.eye(3)
    ]
    return difference_jacobian(lambda a: function(a, start), matrix, h), np.stack(by_start, -1)


CASES = [("torque", False), *((step, step == "torque") for step in STEPS)]


@pytest.mark.parametrize(("step", "escape"), mostly_exhaustive(CASES, ("torque", False)))
def test_the_unrolled_derivative_is_that_of_the_iterations_that_were_run(step, escape):
    """Stopped early, after two iterations; with `escape` from a half turn off, where that does something."""
    matrix = POINTS["generic"]
    start = np.asarray(nearest_rotation(matrix)) @ turned([1, 2, 3], np.pi - 1e-2 if escape else 0.5)
    function = functools.partial(refine_rotation, step=step, iterations=2, escape=escape, derivative="unrolled")
    reverse = [np.asarray(x) for x in jax.jit(jax.jacrev(function, argnums=(0, 1)))(matrix, start)]
    by_matrix, by_start = by_differences(jax.jit(function), matrix, start)
    size = max(1, np.abs(by_matrix).max(), np.abs(by_start).max())
    np.testing.assert_allclose(reverse[0], by_matrix, atol=1e-7 * size)
    turns = start @ np.stack([np.cross(axis, np.eye(3)).T for axis in np.eye(3)])
    np.testing.assert_allclose(np.einsum("ijkl,nkl->ijn", reverse[1], turns), by_start, atol=1e-7 * size)


@pytest.mark.exhaustive
def test_the_unrolled_derivative_is_the_same_forward_and_reverse():
    matrices, starts, tangent = (RANDOM.standard_normal((7, 3, 3)) for _ in range(3))
    function = functools.partial(refine_rotation, derivative="unrolled")

    @jax.jit
    def both(matrices, starts):
        rotation, forward = jax.jvp(function, (matrices, starts), (tangent, tangent))
        cotangent = jnp.cos(rotation)
        _, pullback = jax.vjp(function, matrices, starts)
        return jnp.sum(cotangent * forward), sum(jnp.sum(tangent * x) for x in pullback(cotangent))

    np.testing.assert_allclose(*both(matrices, np.asarray(nearest_rotation(starts))), rtol=1e-12)


@pytest.mark.exhaustive
def test_both_derivatives_agree_at_convergence_and_not_before():
    matrix = POINTS["generic"]
    start = np.asarray(nearest_rotation(matrix)) @ turned([1, 2, 3], 0.5)

    def jacobian(iterations, derivative):
        function = functools.partial(refine_rotation, iterations=iterations, derivative=derivative)
        return [np.asarray(x) for x in jax.jit(jax.jacrev(function, argnums=(0, 1)))(matrix, start)]

    unrolled, implicit = jacobian(80, "unrolled"), jacobian(80, "implicit")
    np.testing.assert_allclose(unrolled[0], implicit[0], atol=1e-12)
    np.testing.assert_allclose(unrolled[1], np.zeros((3, 3, 3, 3)), atol=1e-12)
    early, implicit = jacobian(1, "unrolled"), jacobian(1, "implicit")
    assert np.abs(early[0] - implicit[0]).max() > 1e-3
    assert np.abs(early[1]).max() > 1e-3


@pytest.mark.exhaustive
@pytest.mark.parametrize("step", STEPS)
def test_the_unrolled_derivative_is_finite_on_every_family(step):
    batch = family_batch("float32")
    # At 1e-38 the derivative itself overflows; that of `torque` does so where tr(QᵀA) is exactly 0, as from Q = 1.
    where = batch.families != "scale_tiny"
    matrices = batch.matrices[where]
    third = batch.nearest[where] if step == "torque" else np.broadcast_to(np.eye(3), matrices.shape)
    starts = np.stack([batch.nearest[where], nearest_rotation(RANDOM.standard_normal(matrices.shape)), third])
    function = functools.partial(refine_rotation, step=step, derivative="unrolled")

    @jax.jit
    def pulled_back(matrices, starts):
        rotation, pullback = jax.vjp(function, matrices, starts)
        return pullback(jnp.ones_like(rotation))

    spread = np.broadcast_to(matrices, starts.shape)
    for gradient in pulled_back(spread, starts.astype(np.float32)):
        finite = np.isfinite(np.asarray(gradient)).all(axis=(0, 2, 3))
        assert finite.all(), sorted(set(batch.families[where][~finite]))


def test_the_unrolled_quaternion_has_the_derivative_of_the_rotation():
    matrix, start = np.diag([1.0, 0.9, 0.8]) + 0.1 * RANDOM.standard_normal((3, 3)), np.array([0.9, 0.1, -0.3, 0.2])

    def rotation(q):
        return mat3.stack(quaternion.to_rotation(quaternion.components(q)))

    def through_quaternion(a, q):
        return rotation(refine_quaternion_wxyz(a, q, derivative="unrolled"))

    def through_rotation(a, q):
        return refine_rotation(a, rotation(q), derivative="unrolled")

    expected = jax.jit(jax.jacfwd(through_rotation, argnums=(0, 1)))(matrix, start)
    found = jax.jit(jax.jacfwd(through_quaternion, argnums=(0, 1)))(matrix, start)
    for got, wanted in zip(found, expected, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-13)

"""`refine_rotation(..., escape=True)` leaves every equilibrium that is not nearest, and nothing else."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import turned

from jaxrot import refine_quaternion_wxyz, refine_rotation
from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.scaling import scaled
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES, half_turn_starts
from jaxrot.steps.escape import leave_equilibrium

escaped = jax.jit(functools.partial(refine_rotation, iterations=0, escape=True))
ORDINARY = ["gaussian", "rotation", "identity", "equal_large", "equal_small", "log_uniform", "rank_two", "needle"]
EXTREME = ["near_tie", "ill_conditioned", "minus_rotation_1e-1", "small_integers", "scale_small", "scale_large"]


@pytest.mark.exhaustive
def test_every_half_turn_start_and_its_neighbours_are_left_for_the_nearest_rotation(dtype):
    samples = [FAMILIES[name].sample(24, dtype=np.dtype(dtype), seed=3).matrices for name in ORDINARY + EXTREME]
    matrices = np.concatenate(samples)
    eps = np.finfo(dtype).eps
    solved = reference.solve(matrices)
    starts = half_turn_starts(np.asarray(solved.rotation).astype(dtype), np.asarray(solved.right))
    # Beyond, the equilibrium is as good as the optimum to 8 eps of s1, and the start may be kept.
    unique = reference.condition(matrices, reference=solved) < 1 / (32 * eps)

    def distance(rotation):
        return np.linalg.norm(np.asarray(rotation - np.asarray(solved.rotation), float), axis=(-2, -1))

    stays = distance(np.asarray(refine_rotation(matrices, starts, step="torque", iterations=5)))
    assert (stays[:3] > 1).mean() > 0.9
    reached = np.asarray(escaped(matrices, starts))
    assert distance(reached)[:, unique].max() < 0.3
    everywhere = np.broadcast_to(matrices, starts.shape).reshape(-1, 3, 3)
    assert reference.lost_trace(reached.reshape(-1, 3, 3)[::4], everywhere[::4]).max() < 16 * eps


def test_the_equilibrium_of_equation_8_and_a_triple_eigenvalue_are_left_in_both_forms():
    swap = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    np.testing.assert_allclose(refine_rotation(np.eye(3), swap, step="torque", iterations=50), swap, atol=1e-15)
    np.testing.assert_allclose(refine_rotation(np.eye(3), swap, iterations=0, escape=True), np.eye(3), atol=1e-15)
    # A = −1 at Q = 1: every axis is the weakest, each half turn is nearest.
    reached = np.asarray(refine_rotation(-np.eye(3), np.eye(3), iterations=0, escape=True))
    assert reference.lost_trace(reached, -np.eye(3)) < 1e-15
    reached = refine_quaternion_wxyz(np.eye(3), np.array([0.0, 1.0, 0.0, 0.0]), iterations=0, escape=True)
    np.testing.assert_allclose(np.abs(reached), [1, 0, 0, 0], atol=1e-15)
    with pytest.raises(TypeError, match="escape must be a static Python bool"):
        refine_rotation(np.eye(3), np.eye(3), escape=1)  # pyright: ignore[reportArgumentType]


def test_a_start_that_is_nearest_is_kept_bit_for_bit():
    names = ["zero", "rank_one", "single_entry", "gaussian", "log_uniform", "minus_rotation", "exact_tie"]
    matrices = np.concatenate([FAMILIES[name].sample(50, dtype=np.float64).matrices for name in names])
    solved = reference.solve(matrices)
    start = np.asarray(solved.rotation, float)
    # Turned by what A leaves undetermined: about the first axis where the rank is at most 1.
    cross = np.cross(np.eye(3), np.asarray(solved.right, float)[:, None, :, 0]).transpose(0, 2, 1)
    turn = np.eye(3) + np.sin(1.0) * cross + (1 - np.cos(1.0)) * cross @ cross
    free = np.abs(np.asarray(solved.singular_values[:, 1])) < 1e-12
    assert 100 <= free.sum() < len(free)
    start = jnp.asarray(np.where(free[:, None, None], start @ turn, start))
    q = quaternion.from_rotation(mat3.components(start))
    a = scaled(mat3.components(jnp.asarray(matrices)))
    np.testing.assert_array_equal(quaternion.stack(jax.jit(leave_equilibrium)(a, q)), quaternion.stack(q))


def test_near_the_nearest_rotation_nothing_is_turned_even_where_an_eigenvalue_is_negative():
    """Without the comparison with the torque the start would go to the saddle half a turn about the first axis."""
    matrix = np.diag([1.0, 0.1, -0.0999])
    start = turned([0, 1, 0], 0.1)
    b = start.T @ matrix
    assert np.linalg.eigvalsh(np.trace(b) * np.eye(3) - (b + b.T) / 2).min() < -1e-4
    np.testing.assert_allclose(escaped(matrix, start), start, atol=1e-15)

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import difference_jacobian, stretched, turned

from jaxrot import STEPS, nearest_rotation, refine_quaternion_wxyz, refine_rotation

RANDOM = np.random.default_rng(0)


def rotations(count):
    return np.asarray(nearest_rotation(RANDOM.standard_normal((count, 3, 3))))


@pytest.mark.parametrize("step", STEPS)
def test_a_step_converges_to_the_nearest_rotation(step, dtype):
    matrices = stretched([[1, 0.9, 0.8], [1, 0.6, 0.3], [1, 0.7, -0.4], [1, 0.5, 0]], 4, dtype)
    nearest = np.asarray(nearest_rotation(matrices))
    refined = refine_rotation(matrices, (nearest @ turned([1, 2, 3], 0.5)).astype(dtype), step=step, iterations=150)
    assert refined.dtype == dtype
    np.testing.assert_allclose(refined, nearest, atol=64 * np.finfo(dtype).eps)


@pytest.mark.parametrize(
    ("singular_values", "rate"),
    [((1, 1, 1), 1 / 3), ((1, 0.5, 0.25), 0.571), ((1, 0.1, 0.01), 0.901), ((1, 0.5, -0.45), 0.952)],
)
def test_the_torque_step_is_linear_at_the_predicted_rate(singular_values, rate):
    """Müller et al. 2016 do not state it: max|sᵢ| / |Σsᵢ|."""
    matrix = np.diag(singular_values)
    rotation = turned([1, 2, 3], 1e-3)
    errors = []
    for _ in range(12):
        rotation = refine_rotation(matrix, rotation, step="torque", iterations=1)
        errors.append(np.linalg.norm(rotation - np.eye(3)))
    assert errors[-1] / errors[-2] == pytest.approx(rate, rel=0.02)


@pytest.mark.parametrize(
    ("dtype", "scales"), [("float32", (1e-30, 1e-25, 1e20, 1e38)), ("float64", (1e-300, 1e-160, 1e160, 1e300))]
)
def test_a_start_may_have_any_length(dtype, scales):
    matrices, quaternions = RANDOM.standard_normal((5, 3, 3)).astype(dtype), RANDOM.standard_normal((5, 4))
    quaternions = np.concatenate([quaternions[:4], [[0, 1, 0, 0]]]).astype(dtype)
    start = np.asarray(refine_quaternion_wxyz(matrices, quaternions, iterations=0))
    expected = np.asarray(refine_quaternion_wxyz(matrices, quaternions))
    eps = np.finfo(dtype).eps
    for scale in scales:
        for sign in (1, -1):
            scaled = quaternions * np.asarray(sign * scale, dtype)
            kept = refine_quaternion_wxyz(matrices, scaled, iterations=0)
            np.testing.assert_allclose(kept, sign * start, atol=4 * eps)
            np.testing.assert_allclose(refine_quaternion_wxyz(matrices, scaled), sign * expected, atol=1e3 * eps)
    turns = rotations(5).astype(dtype)
    rotation = np.asarray(refine_rotation(matrices, turns))
    for scale in scales:
        scaled = turns * np.asarray(scale, dtype)
        np.testing.assert_allclose(refine_rotation(matrices, scaled, iterations=0), turns, atol=16 * eps)
        np.testing.assert_allclose(refine_rotation(matrices, scaled), rotation, atol=1e3 * eps)


def test_a_start_without_direction_is_the_identity_and_batches_broadcast():
    np.testing.assert_array_equal(refine_rotation(np.eye(3), np.zeros((3, 3)), iterations=0), np.eye(3))
    np.testing.assert_array_equal(refine_quaternion_wxyz(np.eye(3), np.zeros(4), iterations=0), [1, 0, 0, 0])
    matrices, start = RANDOM.standard_normal((5, 3, 3)), rotations(2)
    refined = refine_rotation(matrices[:, None], start, iterations=2)
    assert refined.shape == (5, 2, 3, 3)
    np.testing.assert_allclose(refined[3, 1], refine_rotation(matrices[3], start[1], iterations=2), atol=1e-15)


@pytest.mark.parametrize("singular_values", [(1, 0.05, 0.02), (1, 0.005, 0.002)])
def test_the_default_follows_a_thin_rod_that_turns(singular_values):
    """5° a frame. Three torque steps lag 6° behind the first one, and lose the second."""
    lag = {}
    for options in ({}, {"step": "torque", "iterations": 3}):
        rotation, angles = np.eye(3), []
        for frame in range(60):
            turn = turned([1, 2, 3], np.radians(5 * frame))
            rotation = np.asarray(refine_rotation(turn @ np.diag(singular_values), rotation, **options))
            angles.append(np.degrees(np.linalg.norm(rotation - turn) / np.sqrt(2)))
        lag[options.get("step", "default")] = np.mean(angles[20:])
    assert lag["default"] < 0.01
    assert lag["torque"] > 5


def test_more_iterations_are_the_same_as_repeated_calls_and_none_return_the_start():
    matrices, start = RANDOM.standard_normal((5, 3, 3)), rotations(5)
    repeated = start
    for _ in range(3):
        repeated = refine_rotation(matrices, repeated, iterations=1)
    np.testing.assert_allclose(refine_rotation(matrices, start, iterations=3), repeated, atol=1e-14)
    np.testing.assert_allclose(refine_rotation(matrices, start, iterations=0), start, atol=2e-15)


@pytest.mark.parametrize("step", STEPS)
def test_the_matrix_of_zeros_keeps_the_start(step):
    start = rotations(6)
    np.testing.assert_allclose(refine_rotation(np.zeros((3, 3)), start, step=step), start, atol=2e-15)


@pytest.mark.parametrize("step", STEPS)
def test_scale_changes_no_bit(step):
    matrices, start = RANDOM.standard_normal((5, 3, 3)).astype(np.float32), rotations(5).astype(np.float32)
    expected = np.asarray(refine_rotation(matrices, start, step=step))
    for exponent in (-120, -60, 60, 120):
        scaled = np.ldexp(matrices, exponent)
        where = (np.abs(scaled) >= np.finfo(np.float32).tiny).all(axis=(1, 2))
        assert where.any()
        np.testing.assert_array_equal(np.asarray(refine_rotation(scaled, start, step=step))[where], expected[where])


def test_the_torque_iteration_turns_the_right_way_beyond_a_right_angle():
    """The absolute value of the denominator: without it 7 % of random starts are not there after 50 iterations."""
    starts = rotations(300)
    assert (np.trace(starts, axis1=1, axis2=2) < 0).any()
    refined = refine_rotation(np.eye(3), starts, step="torque", iterations=50)
    np.testing.assert_allclose(refined, np.broadcast_to(np.eye(3), refined.shape), atol=1e-14)


def test_the_result_is_a_scan_carry(dtype):
    turns = np.stack([turned([0, 0, 1], angle) for angle in np.linspace(0, 2, 50)])
    path = (turns * [1, 0.8, 0.5]).astype(dtype)

    def frame(rotation, matrix):
        rotation = refine_rotation(matrix, rotation, iterations=4)
        return rotation, rotation

    _, followed = jax.jit(lambda start, path: jax.lax.scan(frame, start, path))(jnp.eye(3, dtype=dtype), path)
    assert followed.dtype == dtype
    np.testing.assert_allclose(followed, nearest_rotation(path), atol=2e-2)


def test_the_sign_of_a_quaternion_is_continuous():
    refine = jax.jit(functools.partial(refine_quaternion_wxyz, iterations=6))
    quaternion = jnp.asarray([1.0, 0, 0, 0])
    for angle in np.linspace(0, 4 * np.pi, 200):
        following = refine(turned([0, 0, 1], angle), quaternion)
        assert following @ quaternion > 0.9
        quaternion = following
    np.testing.assert_allclose(quaternion, [1, 0, 0, 0], atol=1e-3)


def test_the_derivative_is_implicit_and_forgets_the_start():
    matrix, start = np.diag([1.0, 0.9, 0.8]) + 0.1 * RANDOM.standard_normal((3, 3)), rotations(1)[0]
    function = functools.partial(refine_rotation, iterations=100)
    forward = jax.jit(jax.jacfwd(function, argnums=(0, 1)))(matrix, start)
    reverse = jax.jit(jax.jacrev(function, argnums=(0, 1)))(matrix, start)
    expected = jax.jit(jax.jacrev(nearest_rotation))(matrix)
    for by_matrix, by_start in (forward, reverse):
        np.testing.assert_allclose(by_matrix, expected, atol=1e-13)
        np.testing.assert_array_equal(by_start, np.zeros((3, 3, 3, 3)))


@pytest.mark.exhaustive
def test_the_quaternion_has_the_derivative_of_the_rotation():
    matrix = np.diag([1.0, 0.9, 0.8]) + 0.1 * RANDOM.standard_normal((3, 3))
    function = lambda a: refine_quaternion_wxyz(a, np.eye(4)[0], iterations=60)  # noqa: E731
    np.testing.assert_allclose(jax.jacrev(function)(matrix), difference_jacobian(function, matrix, 1e-6), atol=1e-9)

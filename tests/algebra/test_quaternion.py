import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certificate import assert_within, family_batch
from differences import assert_is_derivative, at_points, turned

from jaxrot import nearest_quaternion_wxyz, nearest_rotation
from jaxrot._algebra import mat3, quaternion

RANDOM = np.random.default_rng(0)
UNIT = RANDOM.standard_normal((500, 4))
UNIT /= np.linalg.norm(UNIT, axis=-1, keepdims=True)
UNIT *= np.where(UNIT[:, :1] < 0, -1, 1)


def to_matrix(quaternions):
    return np.asarray(mat3.stack(quaternion.to_rotation(quaternion.components(jnp.asarray(quaternions)))))


def from_matrix(matrices):
    return np.asarray(quaternion.stack(quaternion.from_rotation(mat3.components(jnp.asarray(matrices)))))


def exponential(vectors):
    vectors = jnp.asarray(vectors)
    return quaternion.stack(quaternion.exponential((vectors[..., 0], vectors[..., 1], vectors[..., 2])))


def logarithm(quaternions):
    return jnp.stack(quaternion.logarithm(quaternion.components(jnp.asarray(quaternions))), axis=-1)


def test_the_product_is_that_of_the_rotations():
    p, q = UNIT[:250], UNIT[250:]
    product = quaternion.stack(quaternion.product(quaternion.components(p), quaternion.components(q)))
    np.testing.assert_allclose(to_matrix(product), to_matrix(p) @ to_matrix(q), atol=4e-15)


def test_conversion_to_a_matrix_is_right_handed_from_wxyz_and_ignores_the_length():
    quarter_turn_about_z = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    np.testing.assert_allclose(to_matrix(quarter_turn_about_z) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    for scale in (1e-8, 1e8):
        np.testing.assert_allclose(to_matrix(UNIT * scale), to_matrix(UNIT), atol=4e-15)


def test_conversion_there_and_back_is_the_identity_with_finite_derivatives_half_turns_included():
    signs = np.array(list(itertools.product([-1, 0, 1], repeat=4)))
    corners = signs[np.abs(signs).sum(1) > 0] / np.linalg.norm(signs[np.abs(signs).sum(1) > 0], axis=1, keepdims=True)
    quaternions = np.concatenate([UNIT, corners])
    back = from_matrix(to_matrix(quaternions))
    assert (back[:, 0] >= 0).all()
    np.testing.assert_allclose(np.abs(np.sum(back * quaternions, -1)), 1, atol=4e-16 * 4)
    from_rotation = jax.jacrev(lambda m: quaternion.stack(quaternion.from_rotation(mat3.components(m))))
    for diagonal in ((1.0, 1, 1), (1.0, -1, -1), (-1.0, 1, -1), (-1.0, -1, 1)):
        jacobian = from_rotation(np.diag(diagonal))
        assert np.isfinite(jacobian).all()
        assert np.abs(jacobian).max() > 0.1


def test_exponential_and_logarithm_undo_each_other_the_short_way_round():
    np.testing.assert_allclose(logarithm(-UNIT), logarithm(UNIT))
    assert np.linalg.norm(logarithm(UNIT), axis=-1).max() <= np.pi
    directions = UNIT[:, 1:] / np.linalg.norm(UNIT[:, 1:], axis=-1, keepdims=True)
    for angle in (0, 1e-300, 1e-20, 1e-9, 1e-3, 0.01, 0.0109, 0.0111, 0.1, 1, 3, np.pi - 1e-9):
        vectors = directions * angle
        np.testing.assert_allclose(logarithm(exponential(vectors)), vectors, rtol=1e-14, atol=4e-15 * (angle > 1))
        np.testing.assert_allclose(np.linalg.norm(exponential(vectors), axis=-1), 1, atol=1e-15)


def test_the_exponential_meets_its_series_where_they_change_over():
    for dtype in (np.float32, np.float64):
        changeover = np.sqrt(np.finfo(dtype).eps ** 0.25)
        x = (np.linspace(0.99, 1.01, 101) * changeover).astype(dtype)
        vectors = np.stack([x, 0 * x, 0 * x], -1)
        exact = np.stack([np.cos(x / 2, dtype=np.longdouble), np.sin(x / 2, dtype=np.longdouble)], -1)
        np.testing.assert_allclose(exponential(vectors)[:, :2], exact, rtol=2 * np.finfo(dtype).eps)


SECOND_EXPONENTIAL = jax.jacfwd(jax.jacrev(exponential))
EXPONENTIAL_ORDERS = [
    jax.jit(f) for f in (exponential, jax.jacfwd(exponential), SECOND_EXPONENTIAL, jax.jacfwd(SECOND_EXPONENTIAL))
]


@pytest.mark.parametrize("vector", [(0.0, 0, 0), (1e-200, 0, 0), (1e-5, 2e-5, 0), (np.pi, 0, 0), (0, 0, 2 * np.pi)])
def test_the_exponential_has_finite_and_right_derivatives_to_third_order(vector):
    vector = np.array(vector)
    step = 1e-4
    for function, derivative in itertools.pairwise(EXPONENTIAL_ORDERS):
        got = np.asarray(derivative(vector))
        assert np.isfinite(got).all()
        for axis in range(3):
            h = step * np.eye(3)[axis]
            difference = (np.asarray(function(vector + h)) - np.asarray(function(vector - h))) / (2 * step)
            np.testing.assert_allclose(got[..., axis], difference, atol=2e-7)


@pytest.mark.parametrize(
    "quaternion",
    [(1.0, 0, 0, 0), (1, 1e-9, 0, 0), (1, 0.02, 0.1, 0), (0, 1, 0, 0), (1e-9, 0, 0.6, 0.8), (0.5, 0.5, -0.5, 0.5)],
)
@pytest.mark.exhaustive
def test_the_logarithm_has_finite_and_right_derivatives_to_second_order(quaternion):
    quaternion = np.array(quaternion, float)
    first = jax.jacrev(logarithm)
    second = np.asarray(jax.jacfwd(first)(quaternion))
    step = 1e-5
    for axis in range(4):
        h = step * np.eye(4)[axis]
        ahead = quaternion[0] < 2 * step and axis == 0  # beyond w = 0 the branch is another one
        there, back = (quaternion + h, quaternion if ahead else quaternion - h)
        length = step * (1 if ahead else 2)
        tolerance = 2e-5 if ahead else 1e-8
        difference = (np.asarray(logarithm(there)) - np.asarray(logarithm(back))) / length
        np.testing.assert_allclose(np.asarray(first(quaternion))[..., axis], difference, atol=tolerance)
        difference = (np.asarray(first(there)) - np.asarray(first(back))) / length
        np.testing.assert_allclose(second[..., axis], difference, atol=100 * tolerance)


def test_the_nearest_quaternion_is_that_of_the_nearest_rotation():
    matrices = RANDOM.standard_normal((200, 3, 3))
    quaternion = np.asarray(nearest_quaternion_wxyz(matrices))
    assert (quaternion[:, 0] >= 0).all()
    np.testing.assert_allclose(np.linalg.norm(quaternion, axis=-1), 1, atol=4e-16)
    np.testing.assert_allclose(to_matrix(quaternion), nearest_rotation(matrices), atol=4e-15)


def test_the_nearest_quaternion_is_that_of_the_nearest_rotation_on_every_family(dtype):
    """Jitted: where a choice, of a column or of a sign, hangs on rounding, all components must choose alike."""
    batch = family_batch(dtype)
    quaternion = np.asarray(jax.jit(nearest_quaternion_wxyz)(batch.matrices))
    eps = np.finfo(dtype).eps
    assert (quaternion[:, 0] >= 0).all()
    assert_within(np.abs(np.linalg.norm(quaternion.astype(float), axis=-1) - 1), 4 * eps, batch.families, "unit length")
    difference = to_matrix(quaternion.astype(float)) - np.asarray(jax.jit(nearest_rotation)(batch.matrices))
    assert_within(np.abs(difference).max((1, 2)), 16 * eps, batch.families, "the rotation of the quaternion")


FIRST = jax.jit(jax.jacrev(nearest_quaternion_wxyz))
SECOND = jax.jit(jax.jacfwd(jax.jacrev(nearest_quaternion_wxyz)))


@at_points
@pytest.mark.exhaustive
def test_the_derivatives_of_the_nearest_quaternion_are_right(matrix):
    # From a half turn, where w jumps, a little off.
    for turn in (np.eye(3), turned([1, 2, 3], 3.0)):
        assert_is_derivative(FIRST, jax.jit(nearest_quaternion_wxyz), turn @ matrix)
        assert_is_derivative(SECOND, FIRST, turn @ matrix)

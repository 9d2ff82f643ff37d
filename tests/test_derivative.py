import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certificate import analytic_jacobian, assert_within, family_batch, in_families, resolved
from differences import POINTS, assert_is_derivative, at_points, central_difference
from marks import mostly_exhaustive
from parts import decomposition, dense

from jaxrot import DEFAULT_METHOD, METHODS, nearest_quaternion_wxyz, nearest_rotation
from jaxrot.evaluation import reference

RANDOM = np.random.default_rng(0)


@functools.lru_cache
def jacobians(dtype, mode, damping=0.0):
    """The 9×9 Jacobian of every matrix of the family batch."""
    function = functools.partial(nearest_rotation, damping=damping)
    jacobian = {"forward": jax.jacfwd, "reverse": jax.jacrev}[mode]
    return np.asarray(jax.jit(jax.vmap(jacobian(function)))(family_batch(dtype).matrices)).reshape(-1, 9, 9)


@pytest.mark.parametrize("mode", ["forward", "reverse"])
def test_the_jacobian_is_right_to_rounding_on_every_family(dtype, mode):
    batch = family_batch(dtype)
    eps = np.finfo(dtype).eps
    where = resolved(batch, 1 / (128 * eps))
    exact = analytic_jacobian(batch.matrices[where])
    size = np.sqrt((exact**2).sum((1, 2)))
    error = np.sqrt(((jacobians(dtype, mode)[where] - exact) ** 2).sum((1, 2)))
    # At the ends of the dtype's range the exact Jacobian overflows, or its entries are flushed to zero.
    holds = size < np.finfo(dtype).max / 4
    error = np.maximum(error - 9 * np.finfo(dtype).tiny, 0)[holds] / size[holds]
    bound = 32 * eps * np.maximum(batch.condition[where], 1)
    assert_within(error, bound[holds], batch.families[where][holds], "Jacobian")


@pytest.mark.parametrize("mode", ["forward", "reverse"])
def test_the_jacobian_is_finite_and_bounded_on_every_family(dtype, mode):
    batch = family_batch(dtype)
    got = jacobians(dtype, mode).astype(np.longdouble)
    assert_within(np.abs(got).max(axis=(1, 2)), np.finfo(dtype).max, batch.families, "finite Jacobian")
    total = np.asarray(reference.signed_singular_values(batch.matrices)).sum(-1)
    normal = total > 64 * np.finfo(dtype).tiny
    norm = np.linalg.norm((got[normal] * total[normal, None, None]).astype(np.float64), 2, axis=(1, 2))
    assert_within(norm, 1.01 / (64 * np.finfo(dtype).eps), batch.families[normal], "norm of the Jacobian times tr S")


def test_forward_and_reverse_are_transposes(dtype):
    forward, reverse = jacobians(dtype, "forward"), jacobians(dtype, "reverse")
    size = np.abs(forward).max(axis=(1, 2), keepdims=True)
    # What is subnormal is flushed on one way or the other.
    slack = 64 * (np.finfo(dtype).eps * size + np.finfo(dtype).tiny)
    assert (np.abs(forward - reverse) <= slack).all()


@pytest.mark.parametrize(
    ("function", "highest", "dtype"),
    [
        (nearest_rotation, 2, "float32"),
        pytest.param(nearest_rotation, 3, "float32", marks=pytest.mark.exhaustive),
        pytest.param(nearest_rotation, 3, "float64", marks=pytest.mark.exhaustive),
        pytest.param(nearest_quaternion_wxyz, 2, "float32", marks=pytest.mark.exhaustive),
        pytest.param(dense, 1, "float32", marks=pytest.mark.exhaustive),
    ],
)
def test_derivatives_of_every_order_are_finite_on_every_family(function, highest, dtype):
    batch = family_batch(dtype)
    tangents = RANDOM.uniform(-1, 1, (highest, *batch.matrices.shape)).astype(dtype)

    def with_derivative(f, tangent):
        """Appends to the orders that f returns the derivative of the last of them."""

        def extended(a):
            orders, tangents_out = jax.jvp(f, (a,), (tangent,))
            return (*orders, tangents_out[-1])

        return extended

    extended = lambda a: (function(a),)  # noqa: E731
    for tangent in tangents:
        extended = with_derivative(extended, tangent)
    for order, value in enumerate(jax.jit(extended)(batch.matrices)):
        largest = np.abs(np.asarray(value)).reshape(len(batch.matrices), -1).max(-1)
        assert_within(largest, np.finfo(dtype).max, batch.families, f"finite derivative of order {order}")


def matrices_at_every_scale(dtype):
    """Matrices whose rotation is not unique, or hardly, and others, from the smallest normal numbers to the largest."""
    shapes = [-np.eye(3), np.eye(3), POINTS["generic"], np.outer([1, 2, 3], [0.3, -0.2, 0.5])]
    shapes += [np.diag(s) for s in ([1, 0, 0], [1, 1, -1], [1, 0.8, -0.8], [1, 0.8, -0.8 * (1 - 3e-6)])]
    shapes += [np.diag(s) for s in ([1, 1e-5, 1e-6], [1, 1e-4, -1e-5], [-1, -1 - 1e-5, -1 + 2e-5])]
    info = np.finfo(dtype)
    exponents = np.linspace(info.minexp, info.maxexp - 4, 13).astype(int)
    return np.concatenate([np.ldexp(np.stack(shapes).astype(dtype), exponent) for exponent in exponents])


@pytest.mark.parametrize(
    ("function", "mode"),
    [
        (nearest_rotation, "forward"),
        pytest.param(nearest_rotation, "reverse", marks=pytest.mark.exhaustive),
        pytest.param(decomposition, "forward", marks=pytest.mark.exhaustive),
    ],
)
def test_the_reverse_of_a_derivative_is_finite_for_every_matrix(function, mode):
    """The factors that saturate come in the other order: some are small, and those before them overflow."""
    batch, others = family_batch("float32"), matrices_at_every_scale("float32")
    matrices = np.concatenate([batch.matrices, others])
    names = np.concatenate([batch.families, [str(matrix.tolist()) for matrix in others]])
    value = jax.eval_shape(function, matrices)
    tangent = RANDOM.uniform(-1, 1, (matrices if mode == "forward" else value).shape).astype(np.float32)

    def along(a):
        if mode == "forward":
            return jax.jvp(function, (a,), (tangent,))[1]
        return jax.vjp(function, a)[1](tangent)[0]

    @jax.jit
    def both(a):
        first, pull = jax.vjp(along, a)
        return first, pull(jnp.asarray(RANDOM.uniform(-1, 1, first.shape), first.dtype))[0]

    for order, derivative in enumerate(both(matrices), start=1):
        largest = np.abs(np.asarray(derivative)).reshape(len(matrices), -1).max(axis=1)
        assert_within(largest, np.finfo(np.float32).max, names, f"finite derivative of order {order}")


TANGENT = np.array([[0.3, -0.5, 0.2], [0.7, 0.1, -0.4], [-0.6, 0.2, 0.5]])
FIRST = jax.jit(jax.jacrev(nearest_rotation))
SECOND = jax.jit(jax.jacfwd(jax.jacrev(nearest_rotation)))
THIRD_ALONG = jax.jit(lambda a, tangent: jax.jvp(jax.jacfwd(jax.jacrev(nearest_rotation)), (a,), (tangent,))[1])


@at_points
def test_the_derivative_of_each_order_is_that_of_the_lower_one(matrix):
    assert_is_derivative(FIRST, jax.jit(nearest_rotation), matrix)
    assert_is_derivative(SECOND, FIRST, matrix)


@pytest.mark.exhaustive
@at_points
def test_the_third_derivative_is_that_of_the_second(matrix):
    got = np.asarray(THIRD_ALONG(matrix, TANGENT))
    np.testing.assert_allclose(got, central_difference(SECOND, matrix, TANGENT), atol=2e-8 * max(1, np.abs(got).max()))


@pytest.mark.parametrize("method", mostly_exhaustive(METHODS, DEFAULT_METHOD, "svd", "gram_schmidt"))
def test_every_method_has_the_same_derivative_at_a_rotation(method):
    jacobian = jax.jacrev(functools.partial(nearest_rotation, method=method))(np.eye(3))
    np.testing.assert_allclose(np.asarray(jacobian).reshape(9, 9), analytic_jacobian(np.eye(3)), atol=1e-13)


@pytest.mark.parametrize("method", mostly_exhaustive(["svd", "davenport"], "svd"))
def test_the_second_derivative_is_of_the_rule_and_not_of_the_method(method):
    """At equal singular values the derivative of LAPACK's vectors is NaN, and the rule's is exact."""

    def second(function):
        first = lambda a: jax.jvp(function, (a,), (TANGENT,))[1]  # noqa: E731
        return jax.jit(lambda a: jax.jvp(first, (a,), (TANGENT,))[1])(np.eye(3))

    of_method = second(functools.partial(nearest_rotation, method=method))
    np.testing.assert_allclose(of_method, second(nearest_rotation), atol=1e-13)


def test_the_derivative_is_scale_free_bit_for_bit(dtype):
    matrices = RANDOM.standard_normal((16, 3, 3)).astype(dtype)
    matrices[0] = np.diag([1, 1, -1])
    jacobian = jax.jit(jax.vmap(jax.jacrev(nearest_rotation)))
    for exponent in (-60, 60):
        expected = np.ldexp(np.asarray(jacobian(matrices)), -exponent)
        np.testing.assert_array_equal(np.asarray(jacobian(np.ldexp(matrices, exponent))), expected)


@pytest.mark.exhaustive
def test_the_second_derivative_scales_too(dtype):
    matrix = POINTS["generic"].astype(dtype)
    expected = np.asarray(SECOND(matrix))
    for exponent in (-20, 20):
        got = np.ldexp(np.asarray(SECOND(np.ldexp(matrix, exponent))), 2 * exponent)
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e2 * np.finfo(dtype).eps)


@pytest.mark.parametrize("mode", ["forward", "reverse"])
@pytest.mark.parametrize("damping", [1e-2, 1.0])
@pytest.mark.exhaustive
def test_damping_is_relative_and_leaves_the_value_alone(mode, damping):
    batch = family_batch("float64")
    where = in_families(batch, ["gaussian", "rank_one", "sparse_inverted", "scale_large", "minus_identity"])
    exact = analytic_jacobian(batch.matrices[where], damping).astype(np.float64)
    got = jacobians("float64", mode, damping)[where]
    size = np.abs(exact).max(axis=(1, 2), keepdims=True)
    # R itself differs from the reference's where it is not unique; so does then the Jacobian.
    unique = batch.condition[where] < 1e6
    np.testing.assert_allclose((got / size)[unique], (exact / size)[unique], atol=1e-11)
    norm = np.linalg.norm(got, 2, axis=(1, 2)) * batch.singular_values[where].sum(-1)
    assert (norm <= 1.001 / damping).all()
    np.testing.assert_array_equal(nearest_rotation(batch.matrices, damping=damping), nearest_rotation(batch.matrices))


def test_an_unresolved_axis_does_not_move_and_a_resolved_one_does():
    """Rank 1: R may turn freely about a1, and the derivative says nothing of that turn, all of the others."""
    matrix = np.zeros((3, 3))
    matrix[0, 0] = 2.0
    rotation = np.asarray(nearest_rotation(matrix))
    jacobian = np.asarray(jax.jacfwd(nearest_rotation)(matrix))
    for axis, expected in ((0, 0.0), (1, 1.0), (2, 1.0)):
        # Turning A with R turns R as much; a turn about the first axis does not change A.
        moved = np.einsum("ijkl,kl->ij", jacobian, np.cross(np.eye(3)[axis], matrix.T).T)
        np.testing.assert_allclose(moved, expected * np.cross(np.eye(3)[axis], rotation.T).T, atol=1e-12)
    np.testing.assert_array_equal(jax.jacrev(nearest_rotation)(np.zeros((3, 3))), np.zeros((3, 3, 3, 3)))


def test_gradient_descent_leaves_a_singular_start():
    """A learned head may begin there: the loss must go down and never be NaN."""
    target = np.asarray(nearest_rotation(POINTS["generic"] + 0.3))
    loss = lambda a: jnp.sum((nearest_rotation(a, damping=1e-2) - target) ** 2)  # noqa: E731
    gradient = jax.jit(jax.vmap(jax.value_and_grad(loss)))
    starts = np.stack([np.zeros((3, 3)), np.diag([1.0, 0, 0]), -np.eye(3), np.diag([1.0, 1, -1])])
    matrices = starts + 1e-3 * np.random.default_rng(1).standard_normal((3, 3))
    values = []
    for _ in range(300):
        value, slope = gradient(matrices)
        values.append(np.asarray(value))
        # The gradient of a function without scale goes like 1/‖A‖.
        matrices = matrices - 0.02 * np.sum(np.square(matrices), axis=(1, 2), keepdims=True) * slope
    assert np.isfinite(values).all()
    assert (values[-1] < 0.05 * values[0]).all()

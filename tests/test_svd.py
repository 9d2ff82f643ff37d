"""A = U diag(s) Vᵀ with rotations U and V."""

import jax
import numpy as np
import pytest
from certificate import assert_rotations, assert_within, family_batch, survives_flushing
from differences import POINTS, assert_is_derivative, at_distinct_points, at_points

from jaxrot import nearest_rotation, rotation_variant_svd, signed_singular_values
from jaxrot.evaluation import reference


def test_the_factors_are_rotations_in_order_and_make_the_matrix_and_the_nearest_rotation(dtype):
    batch = family_batch(dtype)
    eps, tiny = np.finfo(dtype).eps, np.finfo(dtype).tiny
    left, s, right = (np.asarray(x) for x in jax.jit(rotation_variant_svd)(batch.matrices))
    for factor in (left, right):
        assert_rotations(factor, batch.families)
    assert (s[:, 0] >= s[:, 1]).all()
    assert (s[:, 1] >= np.abs(s[:, 2])).all()
    normal = survives_flushing(batch)
    matrices, names = batch.matrices[normal], batch.families[normal]
    size = np.maximum(batch.singular_values[normal][:, 0], tiny)
    error = np.abs(s[normal] - batch.singular_values[normal]).max(-1) / size
    assert_within(error, 16 * eps, names, "singular values")
    product = np.einsum("nij,nj,nkj->nik", *(x[normal].astype(np.longdouble) for x in (left, s, right)))
    error = np.sqrt(np.square((product - matrices) / size[:, None, None]).sum((1, 2)))
    assert_within(error, 32 * eps, names, "product of the factors")
    where = batch.condition < 1e3
    difference = np.abs(left @ right.swapaxes(1, 2) - np.asarray(jax.jit(nearest_rotation)(batch.matrices)))
    assert_within(difference[where].max((1, 2)), 32 * eps, batch.families[where], "left · rightᵀ")


@pytest.mark.exhaustive
def test_singular_values_alone_are_the_same_and_leave_the_factors_out():
    matrices = np.random.default_rng(0).standard_normal((1000, 3, 3)).astype(np.float32)

    def program(function):
        return jax.jit(function).lower(matrices).compile()

    alone, whole = program(signed_singular_values), program(rotation_variant_svd)
    np.testing.assert_allclose(alone(matrices), whole(matrices).singular_values, atol=1e-5)
    assert alone.cost_analysis()["flops"] < 0.9 * whole.cost_analysis()["flops"]
    assert alone.memory_analysis().output_size_in_bytes < 0.2 * whole.memory_analysis().output_size_in_bytes


@pytest.mark.exhaustive
def test_singular_values_alone_are_right_near_rank_one(dtype):
    """What decides between the axes of two nearly equal eigenvalues must decide alike for both."""
    random = np.random.default_rng(0)
    eps, count = np.finfo(dtype).eps, 60_000
    s = np.ones((count, 3))
    s[:, 1] = 10 ** random.uniform(np.log10(eps) - 1, 0, count)
    s[:, 2] = s[:, 1] * random.choice([-1, 1], count) * 10 ** random.uniform(-3, 0, count)
    left, right = (np.asarray(nearest_rotation(random.standard_normal((count, 3, 3)))) for _ in range(2))
    matrices = np.einsum("nij,nj,nkj->nik", left, s, right).astype(dtype)
    matrices[0] = [
        [0.5950136780738831, 0.13812802731990814, -0.10366281867027283],
        [-0.26072052121162415, -0.06051095575094223, 0.04541714861989021],
        [0.7073074579238892, 0.16420301795005798, -0.12323739379644394],
    ]
    s[0] = [1, 1.69996e-5, -3.7956e-6]
    # The matrices are rounded: by up to 2 eps s1.
    error = np.abs(np.asarray(jax.jit(signed_singular_values)(matrices)) - s).max(-1)
    assert error[1:].max() < 16 * eps
    assert error[0] < 16 * np.finfo(np.float32).eps


def factors_in_one(matrix):
    left, s, right = rotation_variant_svd(matrix)
    return jax.numpy.concatenate([left, s[..., None], right], axis=-1)


# The factors come out of the same program: at equal singular values another one may choose another basis.
FIRST_AND_FACTORS = jax.jit(jax.jacfwd(lambda a: 2 * (factors_in_one(a),), has_aux=True))
VALUES_FIRST = jax.jit(jax.jacrev(signed_singular_values))
VALUES_SECOND = jax.jit(jax.jacfwd(jax.jacrev(signed_singular_values)))


@at_distinct_points
@pytest.mark.exhaustive
def test_the_derivatives_are_right_where_singular_values_differ(matrix):
    assert_is_derivative(lambda a: FIRST_AND_FACTORS(a)[0], lambda a: FIRST_AND_FACTORS(a)[1], matrix)
    assert_is_derivative(VALUES_FIRST, jax.jit(signed_singular_values), matrix)
    assert_is_derivative(VALUES_SECOND, VALUES_FIRST, matrix)


@at_points
def test_the_product_of_the_factors_turns_as_the_nearest_rotation_does(matrix):
    """Equal singular values included, where U and V themselves are damped."""
    jacobian, factors = (np.asarray(x) for x in FIRST_AND_FACTORS(matrix))
    left, right = factors[:, :3], factors[:, 4:]
    product = np.einsum("ijkl,mj->imkl", jacobian[:, :3], right) + np.einsum("ij,mjkl->imkl", left, jacobian[:, 4:])
    np.testing.assert_allclose(product, jax.jacfwd(nearest_rotation)(matrix), atol=1e-12)


def test_singular_values_move_with_the_trace_and_the_sign_of_the_determinant():
    """d(s1+s2+s3) is the nearest rotation, and s3 passes through 0 with a slope, not with a kink."""
    gradient = jax.grad(lambda a: signed_singular_values(a).sum())(POINTS["generic"])
    np.testing.assert_allclose(gradient, nearest_rotation(POINTS["generic"]), atol=1e-14)
    flat = np.diag([1.0, 0.7, 0.0])
    assert signed_singular_values(flat + np.diag([0, 0, -1e-3]))[2] == pytest.approx(-1e-3)
    np.testing.assert_allclose(jax.jacrev(signed_singular_values)(flat)[2], np.diag([0, 0, 1.0]), atol=1e-15)


def test_the_factors_at_the_ends_of_the_range_are_those_of_the_middle():
    matrices = np.random.default_rng(0).standard_normal((16, 3, 3)).astype(np.float32)
    expected = [np.asarray(x) for x in rotation_variant_svd(matrices)]
    for exponent in (-100, 100):
        left, s, right = rotation_variant_svd(np.ldexp(matrices, exponent))
        np.testing.assert_array_equal(left, expected[0])
        np.testing.assert_array_equal(right, expected[2])
        np.testing.assert_array_equal(s, np.ldexp(expected[1], exponent))
    assert reference.orthogonality_error(expected[0]).max() < 1e-6

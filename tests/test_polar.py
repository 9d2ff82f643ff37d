"""A = R S, and `rotation_gap`: (s2+s3)/s1."""

import jax
import numpy as np
import pytest
from certificate import assert_within, family_batch, survives_flushing
from differences import DISTINCT, POINTS, assert_is_derivative, at_distinct_points, at_points

from jaxrot import nearest_rotation, polar_decomposition, rotation_gap


def stretch(matrix):
    return polar_decomposition(matrix).stretch


def test_the_parts_make_the_matrix_on_every_family(dtype):
    batch = family_batch(dtype)
    eps, tiny = np.finfo(dtype).eps, np.finfo(dtype).tiny
    rotation, symmetric = (np.asarray(x) for x in jax.jit(polar_decomposition)(batch.matrices))
    np.testing.assert_array_equal(symmetric, symmetric.swapaxes(1, 2))
    normal = survives_flushing(batch)
    size = np.maximum(batch.singular_values[normal][:, 0], tiny)
    product = rotation[normal].astype(np.longdouble) @ symmetric[normal].astype(np.longdouble)
    error = np.sqrt(np.square((product - batch.matrices[normal]) / size[:, None, None]).sum((1, 2)))
    assert_within(error, 32 * eps, batch.families[normal], "R S")


def test_the_eigenvalues_of_the_stretch_are_the_signed_singular_values():
    """One is negative where det A < 0; elsewhere S is the square root of AᵀA."""
    matrices = np.random.default_rng(0).standard_normal((50, 3, 3))
    symmetric = np.asarray(stretch(matrices))
    values = np.linalg.eigvalsh(symmetric)
    negative = np.linalg.det(matrices) < 0
    assert negative.any()
    np.testing.assert_array_equal((values < 0).sum(-1), negative)
    assert (np.abs(values[negative]).argmin(-1) == 0).all()
    np.testing.assert_allclose(symmetric @ symmetric, matrices.swapaxes(1, 2) @ matrices, atol=1e-13)


def test_the_rotation_is_that_of_the_method_asked_for():
    matrix = POINTS["generic"]
    for method in ("singular_pair", "taylor"):
        # Two programs may round differently.
        expected = nearest_rotation(matrix, method=method)
        np.testing.assert_allclose(polar_decomposition(matrix, method=method).rotation, expected, rtol=1e-15)


FIRST = jax.jit(jax.jacrev(stretch))
SECOND = jax.jit(jax.jacfwd(jax.jacrev(stretch)))


@at_points
@pytest.mark.exhaustive
def test_the_derivatives_of_the_stretch_are_exact_at_equal_singular_values_too(matrix):
    assert_is_derivative(FIRST, jax.jit(stretch), matrix)
    assert_is_derivative(SECOND, FIRST, matrix)


def test_the_derivative_of_the_stretch_does_not_depend_on_the_scale():
    """Through R alone it would overflow on the way, or be damped: 1/|A| times |A|."""
    matrix = POINTS["generic"].astype(np.float32)
    expected = np.asarray(FIRST(matrix))
    for exponent in (-120, -60, 60, 120):
        np.testing.assert_array_equal(FIRST(np.ldexp(matrix, exponent)), expected)


@pytest.mark.exhaustive
def test_forward_and_reverse_are_transposes():
    matrices, tangent, cotangent = np.random.default_rng(1).standard_normal((3, 20, 3, 3))

    @jax.jit
    def both(a):
        return jax.jvp(stretch, (a,), (tangent,))[1], jax.vjp(stretch, a)[1](cotangent)[0]

    forward, reverse = both(matrices)
    np.testing.assert_allclose(np.sum(forward * cotangent), np.sum(reverse * tangent), rtol=1e-12)


@pytest.mark.exhaustive
def test_the_rotation_alone_leaves_the_stretch_out():
    matrices = np.random.default_rng(0).standard_normal((1000, 3, 3)).astype(np.float32)
    functions = (lambda a: polar_decomposition(a).rotation, polar_decomposition)
    rotation, both = (jax.jit(f).lower(matrices).compile().cost_analysis()["flops"] for f in functions)
    # A product of matrices is 45 flops, the symmetric part six.
    assert both > rotation + 40 * len(matrices)


def test_the_gap_is_the_inverse_of_the_condition_number_on_every_family(dtype):
    batch = family_batch(dtype)
    gap = np.asarray(jax.jit(rotation_gap)(batch.matrices))
    assert ((gap >= 0) & (gap <= 2 * (1 + 8 * np.finfo(dtype).eps))).all()
    assert (gap[batch.singular_values[:, 0] == 0] == 0).all()
    normal = survives_flushing(batch) & (batch.singular_values[:, 0] > 0)
    error = np.abs(gap[normal] - 1 / batch.condition[normal])
    assert_within(error, 32 * np.finfo(dtype).eps, batch.families[normal], "gap")


def test_the_gap_says_how_far_a_disturbance_turns_the_rotation():
    random = np.random.default_rng(0)
    for gap in (1.0, 1e-2, 1e-4):
        matrix = np.diag([1.0, gap, 0.0])
        noise = random.standard_normal((2000, 3, 3))
        noise *= 1e-9 / np.linalg.norm(noise, axis=(1, 2), keepdims=True)
        turned = np.linalg.norm(np.asarray(nearest_rotation(matrix + noise)) - np.eye(3), axis=(1, 2)).max()
        assert 0.5 < turned * float(rotation_gap(matrix)) / 1e-9 < 2.1


GAP_FIRST = jax.jit(jax.jacrev(rotation_gap))


@at_distinct_points
@pytest.mark.exhaustive
def test_the_derivative_of_the_gap_is_right_where_singular_values_differ(matrix):
    assert_is_derivative(GAP_FIRST, jax.jit(rotation_gap), matrix)


@pytest.mark.exhaustive
def test_the_derivative_of_the_gap_scales_with_the_matrix_bit_for_bit():
    matrix = DISTINCT["generic"].astype(np.float32)
    expected = np.asarray(GAP_FIRST(matrix))
    for exponent in (-90, 90):
        np.testing.assert_array_equal(GAP_FIRST(np.ldexp(matrix, exponent)), np.ldexp(expected, -exponent))
    np.testing.assert_array_equal(GAP_FIRST(np.zeros((3, 3))), np.zeros((3, 3)))

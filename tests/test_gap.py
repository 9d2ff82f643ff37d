"""`rotation_gap`: (s2+s3)/s1."""

import jax
import numpy as np
import pytest
from certificate import assert_within, family_batch, survives_flushing
from differences import DISTINCT, assert_is_derivative

from jaxrot import nearest_rotation, rotation_gap


def test_the_gap_is_the_inverse_of_the_condition_number_on_every_family(dtype):
    batch = family_batch(dtype)
    gap = np.asarray(jax.jit(rotation_gap)(batch.matrices))
    assert ((gap >= 0) & (gap <= 2 * (1 + 8 * np.finfo(dtype).eps))).all()
    normal = survives_flushing(batch) & (batch.singular_values[:, 0] > 0)
    error = np.abs(gap[normal] - 1 / batch.condition[normal])
    assert_within(error, 32 * np.finfo(dtype).eps, batch.families[normal], "gap")


def test_the_gap_of_known_matrices():
    known = {0.0: [np.zeros((3, 3)), -np.eye(3), np.diag([1.0, 0, 0]), np.diag([1.0, 1, -1])], 2.0: [1e-30 * np.eye(3)]}
    known[0.75] = [np.diag([2.0, 2, -0.5]), 1e200 * np.diag([2.0, 2, -0.5])]
    for gap, matrices in known.items():
        for matrix in matrices:
            assert rotation_gap(matrix) == pytest.approx(gap, abs=1e-15)


def test_the_gap_says_how_far_a_disturbance_turns_the_rotation():
    random = np.random.default_rng(0)
    for gap in (1.0, 1e-2, 1e-4):
        matrix = np.diag([1.0, gap, 0.0])
        noise = random.standard_normal((2000, 3, 3))
        noise *= 1e-9 / np.linalg.norm(noise, axis=(1, 2), keepdims=True)
        turned = np.linalg.norm(np.asarray(nearest_rotation(matrix + noise)) - np.eye(3), axis=(1, 2)).max()
        assert 0.5 < turned * float(rotation_gap(matrix)) / 1e-9 < 2.1


FIRST = jax.jit(jax.jacrev(rotation_gap))


@pytest.mark.parametrize("matrix", DISTINCT.values(), ids=DISTINCT.keys())
@pytest.mark.exhaustive
def test_the_derivative_is_right_where_singular_values_differ(matrix):
    assert_is_derivative(FIRST, jax.jit(rotation_gap), matrix)


@pytest.mark.exhaustive
def test_the_derivative_scales_with_the_matrix_bit_for_bit():
    matrix = DISTINCT["generic"].astype(np.float32)
    expected = np.asarray(FIRST(matrix))
    for exponent in (-90, 90):
        np.testing.assert_array_equal(FIRST(np.ldexp(matrix, exponent)), np.ldexp(expected, -exponent))
    np.testing.assert_array_equal(FIRST(np.zeros((3, 3))), np.zeros((3, 3)))

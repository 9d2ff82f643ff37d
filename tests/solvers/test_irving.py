"""The inversion and rank cases of Müller et al. 2016, appendix C."""

import functools

import numpy as np
import pytest

from jaxrot import nearest_rotation
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES

solve = functools.partial(nearest_rotation, method="irving")


def composed(s, dtype, count=64):
    random = np.random.default_rng(0)
    left, _ = np.linalg.qr(random.standard_normal((count, 3, 3)))
    right, _ = np.linalg.qr(random.standard_normal((count, 3, 3)))
    # Orthogonal matrices of either determinant: the sign of det A is that of s alone after this.
    left *= np.linalg.det(left)[:, None, None] * np.linalg.det(right)[:, None, None]
    return np.einsum("nij,j,nkj->nik", left, s, right).astype(dtype)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("s", [(1, 0.8, 0.5), (1, 0.8, -0.3), (1, 0.8, 0), (1, 0.8, 1e-6), (1, 0.8, -1e-6)])
def test_full_rank_inversion_and_rank_two_give_the_nearest_rotation(s, dtype):
    matrices = composed(s, dtype)
    error = reference.forward_error(np.asarray(solve(matrices)), matrices)
    assert error.max() < 100 * np.finfo(dtype).eps


def test_rank_one_gives_a_rotation_and_not_a_nearest_one():
    matrices = composed((1, 0, 0), "float64")
    rotation = np.asarray(solve(matrices))
    assert reference.orthogonality_error(rotation).max() < 1e-14
    assert reference.lost_trace(rotation, matrices).min() > 1e-3


def test_zero_gives_the_identity():
    np.testing.assert_array_equal(solve(np.zeros((3, 3))), np.eye(3))


def test_a_matrix_that_is_not_finite_gives_nan():
    for value in (np.nan, np.inf):
        assert np.isnan(solve(np.diag([1.0, value, 1.0]))).all()


def test_the_thresholds_are_relative():
    """With the paper's absolute 1e-4 a small matrix would count as rank 0 and give U = 1."""
    matrices = FAMILIES["gaussian"].sample(64, dtype=np.float64).matrices
    np.testing.assert_array_equal(solve(matrices), solve(matrices * 2.0**-40))
    small = np.abs(np.linalg.svd(matrices * 2.0**-40, compute_uv=False)).max()
    assert small < 1e-4

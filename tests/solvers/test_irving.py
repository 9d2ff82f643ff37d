"""The inversion and rank cases of Müller et al. 2016, appendix C."""

import functools

import numpy as np
import pytest
from differences import stretched

from jaxrot import nearest_rotation
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES

solve = functools.partial(nearest_rotation, method="irving")


@pytest.mark.parametrize("s", [(1, 0.8, 0.5), (1, 0.8, -0.3), (1, 0.8, 0), (1, 0.8, 1e-6), (1, 0.8, -1e-6)])
def test_full_rank_inversion_and_rank_two_give_the_nearest_rotation(s, dtype):
    matrices = stretched(s, 64, dtype)
    error = reference.forward_error(np.asarray(solve(matrices)), matrices)
    assert error.max() < 100 * np.finfo(dtype).eps


def test_rank_one_gives_a_rotation_and_not_a_nearest_one_and_zero_the_identity():
    np.testing.assert_array_equal(solve(np.zeros((3, 3))), np.eye(3))
    matrices = stretched((1, 0, 0), 64, "float64")
    rotation = np.asarray(solve(matrices))
    assert reference.orthogonality_error(rotation).max() < 1e-14
    assert reference.lost_trace(rotation, matrices).min() > 1e-3


def test_the_thresholds_are_relative():
    """With the paper's absolute 1e-4 a small matrix would count as rank 0 and give U = 1."""
    matrices = FAMILIES["gaussian"].sample(64, dtype=np.float64).matrices
    np.testing.assert_array_equal(solve(matrices), solve(matrices * 2.0**-40))
    small = np.abs(np.linalg.svd(matrices * 2.0**-40, compute_uv=False)).max()
    assert small < 1e-4

"""Müller et al. 2016: `irving` of appendix C, and Gram-Schmidt, which depends on the order of the columns."""

import functools
import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from differences import stretched

from jaxrot import nearest_rotation
from jaxrot._nearest import solved
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES
from jaxrot.solvers import gram_schmidt

solve = functools.partial(nearest_rotation, method="irving")


@pytest.mark.parametrize("s", [(1, 0.8, 0.5), (1, 0.8, -0.3), (1, 0.8, 0), (1, 0.8, 1e-6), (1, 0.8, -1e-6)])
def test_full_rank_inversion_and_rank_two_give_the_nearest_rotation(s, dtype):
    matrices = stretched(s, 64, dtype)
    error = reference.forward_error(np.asarray(solve(matrices)), matrices)
    assert error.max() < 100 * np.finfo(dtype).eps


def test_rank_one_gives_a_rotation_zero_the_identity_and_the_thresholds_are_relative():
    np.testing.assert_array_equal(solve(np.zeros((3, 3))), np.eye(3))
    matrices = stretched((1, 0, 0), 64, "float64")
    rotation = np.asarray(solve(matrices))
    assert reference.orthogonality_error(rotation).max() < 1e-14
    assert reference.lost_trace(rotation, matrices).min() > 1e-3
    # With the paper's absolute 1e-4 a small matrix would count as rank 0 and give U = 1.
    matrices = FAMILIES["gaussian"].sample(64, dtype=np.float64).matrices
    np.testing.assert_array_equal(solve(matrices), solve(matrices * 2.0**-40))
    small = np.abs(np.linalg.svd(matrices * 2.0**-40, compute_uv=False)).max()
    assert small < 1e-4


ORDERS = list(itertools.permutations(range(3)))


def orthogonalised(matrices, order):
    return solved(functools.partial(gram_schmidt.orthogonalised, order=order), matrices)


def sample(family):
    return jnp.asarray(FAMILIES[family].sample(16, dtype=np.float64).matrices)


def test_every_order_gives_another_rotation_and_keeps_a_rotation():
    noisy, rotation = sample("noisy_rotation_0.3"), sample("rotation")
    results = [np.asarray(orthogonalised(noisy, order=order)) for order in ORDERS]
    for order, result in zip(ORDERS, results, strict=True):
        assert reference.orthogonality_error(result).max() < 1e-14
        assert (np.linalg.det(result) > 0).all()
        np.testing.assert_allclose(orthogonalised(rotation, order=order), rotation, atol=1e-15)
    for first, second in itertools.combinations(results, 2):
        assert np.linalg.norm(first - second, axis=(1, 2)).min() > 1e-3


def test_the_last_column_has_no_influence_and_parallel_columns_give_nan():
    noisy = sample("noisy_rotation_0.3")
    changed = noisy * jnp.array([[[1, 1, -0.5]]])
    np.testing.assert_array_equal(
        nearest_rotation(noisy, method="gram_schmidt"), nearest_rotation(changed, method="gram_schmidt")
    )
    assert np.isnan(nearest_rotation(jnp.ones((3, 3)) * jnp.array([[0.0, 1.0, 1.0]]), method="gram_schmidt")).any()

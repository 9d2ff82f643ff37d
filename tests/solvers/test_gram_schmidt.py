"""Müller et al. 2016, section 2: the result depends on the order of the columns."""

import functools
import itertools

import jax.numpy as jnp
import numpy as np
import pytest

from jaxrot import nearest_rotation
from jaxrot._nearest import solved
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES
from jaxrot.solvers import gram_schmidt

ORDERS = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]


def orthogonalised(matrices, order):
    return solved(functools.partial(gram_schmidt.orthogonalised, order=order), matrices)


def sample(family):
    return jnp.asarray(FAMILIES[family].sample(16, dtype=np.float64).matrices)


@pytest.mark.parametrize("order", ORDERS)
def test_every_order_gives_a_rotation_and_keeps_a_rotation(order):
    noisy = sample("noisy_rotation_0.3")
    assert reference.orthogonality_error(np.asarray(orthogonalised(noisy, order=order))).max() < 1e-14
    assert (np.linalg.det(orthogonalised(noisy, order=order)) > 0).all()
    rotation = sample("rotation")
    np.testing.assert_allclose(orthogonalised(rotation, order=order), rotation, atol=1e-15)


def test_no_two_orders_agree_on_a_noisy_rotation():
    noisy = sample("noisy_rotation_0.3")
    results = [np.asarray(orthogonalised(noisy, order=order)) for order in ORDERS]
    for first, second in itertools.combinations(results, 2):
        assert np.linalg.norm(first - second, axis=(1, 2)).min() > 1e-3


def test_the_last_column_has_no_influence():
    noisy = sample("noisy_rotation_0.3")
    changed = noisy * jnp.array([[[1, 1, -0.5]]])
    np.testing.assert_array_equal(
        nearest_rotation(noisy, method="gram_schmidt"), nearest_rotation(changed, method="gram_schmidt")
    )


def test_parallel_columns_give_nan():
    assert np.isnan(nearest_rotation(jnp.ones((3, 3)) * jnp.array([[0.0, 1.0, 1.0]]), method="gram_schmidt")).any()

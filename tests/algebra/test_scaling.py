import jax
import numpy as np

from jaxrot import nearest_rotation
from jaxrot._algebra import scaling


def test_the_factor_is_the_power_of_two_that_leads_into_two_to_four(dtype):
    info = np.finfo(dtype)
    exponents = np.arange(info.minexp, info.maxexp)
    magnitude = np.concatenate([np.ldexp(1.0, exponents), np.ldexp(2 - float(info.eps), exponents)]).astype(dtype)
    factor = np.asarray(scaling.power_of_two_factor(magnitude))
    assert factor.dtype == dtype
    product = factor.astype(np.longdouble) * magnitude
    assert ((product >= 2) & (product < 4)).all()
    assert (np.frexp(factor)[0] == 0.5).all()
    assert (factor >= info.tiny).all()
    # What has none.
    special = np.array([0, info.smallest_subnormal, np.inf, np.nan], dtype)
    largest = 2.0 ** (info.maxexp - 1)
    np.testing.assert_array_equal(scaling.power_of_two_factor(special), np.array([largest, largest, 0, 0], dtype))


def test_a_power_of_two_changes_no_bit(dtype):
    matrices = np.random.default_rng(0).standard_normal((64, 3, 3)).astype(dtype)
    rotation = np.asarray(nearest_rotation(matrices))
    limit = np.finfo(dtype).maxexp - 30
    for exponent in (-limit, -60, -1, 1, 60, limit):
        np.testing.assert_array_equal(nearest_rotation(np.ldexp(matrices, exponent).astype(dtype)), rotation)


def test_division_and_roots_are_safe_at_zero_and_honest_about_nan():
    assert scaling.safe_divide(np.ones(()), np.zeros(())) == 0
    assert scaling.safe_divide(np.ones(()), np.full((), 2.0)) == 0.5
    assert np.isfinite(jax.grad(scaling.safe_divide, argnums=(0, 1))(1.0, 0.0)).all()
    np.testing.assert_array_equal(scaling.safe_sqrt(np.array([4.0, 0.0, -1e-30])), [2, 0, 0])
    assert np.isnan(scaling.safe_sqrt(np.array(np.nan)))
    assert jax.grad(scaling.safe_sqrt)(0.0) == 0
    assert jax.grad(scaling.safe_sqrt)(4.0) == 0.25

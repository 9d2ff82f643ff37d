import numpy as np

from jaxrot.evaluation import gradient_reference, reference


def test_it_is_the_slope_of_the_rotation():
    random = np.random.default_rng(0)
    matrices, bar, direction = random.standard_normal((3, 50, 3, 3))
    h = 1e-6
    ahead, behind = (reference.reference_rotation(matrices + sign * h * direction) for sign in (1, -1))
    slope = np.sum(bar * (ahead - behind), axis=(1, 2)) / (2 * h)
    expected = np.sum(gradient_reference.pullback(matrices, bar) * direction, axis=(1, 2))
    gap = reference.signed_singular_values(matrices)[:, 1:].sum(axis=1)
    assert np.all(np.abs(slope - expected) * gap**3 < 1e-9 * (1 + np.abs(expected)))


def test_it_scales_with_the_inverse_of_the_matrix():
    random = np.random.default_rng(0)
    matrices, bar = random.standard_normal((2, 20, 3, 3))
    small = gradient_reference.pullback(2.0**-100 * matrices, bar)
    np.testing.assert_array_equal(small, np.longdouble(2.0) ** 100 * gradient_reference.pullback(matrices, bar))


def test_where_the_rotation_is_not_unique_it_is_no_number():
    matrices = np.stack([np.diag([1.0, 0, 0]), np.full((3, 3), np.nan), np.eye(3)])
    bar = np.random.default_rng(0).standard_normal((3, 3, 3))
    assert np.isfinite(gradient_reference.pullback(matrices, bar)).all(axis=(1, 2)).tolist() == [False, False, True]

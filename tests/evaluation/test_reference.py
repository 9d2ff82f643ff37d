"""The reference against mpmath, and every measure of error against a rotation that is wrong."""

import mpmath
import numpy as np
import pytest

from jaxrot.evaluation import gradient_reference, reference
from jaxrot.evaluation.reference import EPS
from jaxrot.families import FAMILIES, with_non_finite

MEASURES = (reference.forward_error, reference.lost_trace, reference.torque)


def rotation_about_z(angle):
    c, s = np.cos(np.longdouble(angle)), np.sin(np.longdouble(angle))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def nearest_rotation_in_50_digits(matrix):
    """R, s and kappa, rounded to long double."""
    with mpmath.workdps(50):
        left, s, right = mpmath.svd_r(mpmath.matrix(matrix.tolist()))
        sign = mpmath.sign(mpmath.det(left) * mpmath.det(right))
        r = left * mpmath.diag([1, 1, sign]) * right
        numbers = [*r, s[0], s[1], sign * s[2]]
        values = np.array([np.longdouble(mpmath.nstr(x, 30)) for x in numbers])
        return values[:9].reshape(3, 3), values[9:], float(s[0] / (s[1] + sign * s[2]))


@pytest.mark.parametrize(
    "name",
    ["gaussian", "ill_conditioned", "needle", "vanishing_gap", "minus_rotation_graded", "sparse_inverted", "rank_two"],
)
def test_float64_reference_agrees_with_50_digits(name):
    matrices = FAMILIES[name].sample(6, np.float64, seed=2).matrices
    solved = reference.solve(matrices)
    for i, matrix in enumerate(matrices):
        r, s, kappa = nearest_rotation_in_50_digits(matrix)
        assert np.linalg.norm((solved.rotation[i] - r).astype(float)) <= 16 * EPS * (1 + kappa)
        assert np.abs(solved.singular_values[i] - s).max() <= 8 * EPS * s[0]
        assert reference.condition(matrix) == pytest.approx(kappa, rel=float(16 * EPS * (1 + kappa)) + 1e-15)


def test_reference_passes_its_own_certificate_on_every_family(dtype):
    matrices = np.concatenate([family.sample(24, dtype, seed=1).matrices for family in FAMILIES.values()])
    solved = reference.solve(matrices)
    r = solved.rotation
    assert reference.orthogonality_error(r).max() <= 32 * EPS
    assert np.abs(reference.lost_trace(r, matrices, reference=solved)).max() <= 16 * EPS
    assert reference.torque(r, matrices, reference=solved).max() <= 16 * EPS
    for factor in (solved.left, solved.right):
        assert reference.orthogonality_error(factor).max() <= 32 * EPS


def test_reference_is_a_rotation_at_exact_rank_one():
    vectors = np.array(list(np.ndindex(4, 4, 4))[1:], float) * (1, -2, 0.5)
    for right in ((1, 0, 0), (0, 4, 0), (1, -1, 2), (3, 1, 2)):
        matrices = vectors[:, :, None] * np.array(right, float)
        solved = reference.solve(matrices)
        assert reference.orthogonality_error(solved.rotation).max() <= 32 * EPS
        assert np.abs(reference.lost_trace(solved.rotation, matrices, reference=solved)).max() <= 16 * EPS
        s1 = np.linalg.norm(vectors, axis=1) * np.linalg.norm(right)
        np.testing.assert_allclose(solved.singular_values[:, 0].astype(float), s1, rtol=1e-15)
        assert (np.abs(solved.singular_values[:, 1:]) <= 16 * EPS * s1[:, None]).all()


def test_reference_does_not_depend_on_the_scale_or_on_its_neighbours():
    matrices = FAMILIES["ill_conditioned"].sample(50, np.float64).matrices
    solved = reference.solve(matrices)
    # 2^-900 and not below: entries that become subnormal are another matrix.
    for exponent in (-900, 700):
        other = reference.solve(np.ldexp(matrices, exponent))
        np.testing.assert_array_equal(other.rotation, solved.rotation)
        np.testing.assert_array_equal(other.singular_values, np.ldexp(solved.singular_values, exponent))
    changed = reference.reference_rotation(with_non_finite(matrices))
    bad = np.arange(50) % 3 == 0
    assert np.isnan(changed[bad]).all()
    np.testing.assert_array_equal(changed[~bad], solved.rotation[~bad])


def test_reference_takes_any_batch_and_one_at_hand_changes_nothing():
    matrices = FAMILIES["gaussian"].sample(6).matrices
    whole = reference.reference_rotation(matrices)
    np.testing.assert_array_equal(reference.reference_rotation(matrices.reshape(2, 3, 3, 3)).reshape(6, 3, 3), whole)
    np.testing.assert_array_equal(reference.reference_rotation(matrices[4]), whole[4])
    assert reference.reference_rotation(matrices[:0]).shape == (0, 3, 3)
    assert [measure(whole[:0], matrices[:0]).shape for measure in MEASURES] == [(0,)] * len(MEASURES)
    assert [measure(whole[4], matrices[4]).shape for measure in MEASURES] == [()] * len(MEASURES)
    matrices = FAMILIES["gaussian"].sample(20).matrices
    wrong = FAMILIES["rotation"].sample(20).matrices
    solved = reference.solve(matrices)
    for measure in MEASURES:
        np.testing.assert_array_equal(measure(wrong, matrices), measure(wrong, matrices, reference=solved))
        assert (measure(wrong, matrices) != 0).all()


def test_zero_has_no_error_not_a_number_stays_one_and_the_condition_is_that_of_the_spectrum():
    zero, turn = np.zeros((3, 3), np.float32), rotation_about_z(1.0)
    np.testing.assert_array_equal(reference.reference_rotation(zero), np.eye(3))
    assert reference.condition(zero) == np.inf
    for measure in MEASURES:
        assert measure(turn, zero) == 0
        for broken in (turn * np.nan, np.full((3, 3), np.inf)):
            assert np.isnan(measure(broken, zero))
            assert np.isnan(measure(broken, np.eye(3)))
        assert np.isnan(measure(turn, np.full((3, 3), np.inf)))
    assert np.isnan(reference.orthogonality_error(turn * np.nan))
    diagonals = np.array([(1, 1, 1), (4, 2, 0), (4, 2, -1), (1, 0.5, -0.5), (1, 0, 0), (-1, -1, -1), (0, 0, 0)])
    expected = (0.5, 2, 4, np.inf, np.inf, np.inf, np.inf)
    np.testing.assert_array_equal(reference.condition(diagonals[:, None] * np.eye(3)), expected)


# A turn about the third principal axis of diag(3, 2, 1): every measure has a closed form.
@pytest.mark.parametrize("angle", [1e-6, 0.1, 2.0])
@pytest.mark.parametrize("scale", [2.0**-1000, 1.0, 2.0**1000])
def test_a_turned_rotation_is_reported(angle, scale):
    turn, matrix = rotation_about_z(angle), scale * np.diag((3.0, 2.0, 1.0))
    assert reference.forward_error(turn, matrix) == pytest.approx(np.sqrt(8) * np.sin(angle / 2), rel=1e-12)
    # The trace loses what the cosine does.
    assert reference.lost_trace(turn, matrix) == pytest.approx(10 / 3 * np.sin(angle / 2) ** 2, rel=1e-5)
    assert reference.torque(turn, matrix) == pytest.approx(np.sqrt(2) * 5 / 3 * abs(np.sin(angle)), rel=1e-12)


def test_an_equilibrium_that_is_not_nearest_and_what_is_no_rotation_are_reported():
    matrix, half_turn = np.diag((3.0, 2.0, 1.0)), np.diag((1.0, -1.0, -1.0))
    assert reference.torque(half_turn, matrix) == 0
    assert reference.lost_trace(half_turn, matrix) == 2
    assert reference.orthogonality_error(np.eye(3)) == 0
    assert reference.orthogonality_error(1.5 * np.eye(3)) == pytest.approx(np.sqrt(3) * 1.25)
    assert reference.orthogonality_error(np.zeros((3, 3))) >= 2
    for reflection in (-np.eye(3), np.diag((1, 1, -1))):
        assert reference.orthogonality_error(reflection) >= 2


def test_the_pullback_is_the_slope_of_the_rotation():
    random = np.random.default_rng(0)
    matrices, bar, direction = random.standard_normal((3, 50, 3, 3))
    h = 1e-6
    ahead, behind = (reference.reference_rotation(matrices + sign * h * direction) for sign in (1, -1))
    slope = np.sum(bar * (ahead - behind), axis=(1, 2)) / (2 * h)
    expected = np.sum(gradient_reference.pullback(matrices, bar) * direction, axis=(1, 2))
    gap = reference.signed_singular_values(matrices)[:, 1:].sum(axis=1)
    assert np.all(np.abs(slope - expected) * gap**3 < 1e-9 * (1 + np.abs(expected)))


def test_the_pullback_scales_with_the_inverse_of_the_matrix():
    random = np.random.default_rng(0)
    matrices, bar = random.standard_normal((2, 20, 3, 3))
    small = gradient_reference.pullback(2.0**-100 * matrices, bar)
    np.testing.assert_array_equal(small, np.longdouble(2.0) ** 100 * gradient_reference.pullback(matrices, bar))


def test_where_the_rotation_is_not_unique_the_pullback_is_no_number():
    matrices = np.stack([np.diag([1.0, 0, 0]), np.full((3, 3), np.nan), np.eye(3)])
    bar = np.random.default_rng(0).standard_normal((3, 3, 3))
    assert np.isfinite(gradient_reference.pullback(matrices, bar)).all(axis=(1, 2)).tolist() == [False, False, True]

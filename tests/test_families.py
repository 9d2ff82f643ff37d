import re

import numpy as np
import pytest

from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES, Family, half_turn_starts, with_non_finite

COUNT = 96
NAMES = """zero identity minus_identity reflection half_turn swap signed_permutation small_integers gaussian rotation
scaled_rotation drifted_rotation noisy_rotation_0.1 noisy_rotation_0.3 noisy_rotation_0.5 log_uniform equal_large
equal_small rank_one single_entry rank_two planar planar_motion needle stretch_1e7 ill_conditioned nearly_not_unique
vanishing_gap vanishing_rank exact_tie near_tie minus_rotation minus_rotation_1e-1 minus_rotation_1e-2
minus_rotation_1e-4 minus_rotation_graded sparse_inverted near_half_turn scale_large scale_small scale_huge scale_tiny
scale_mixed subnormal"""
WANTED = NAMES.split()

every_family = pytest.mark.parametrize("family", FAMILIES.values(), ids=lambda family: family.name)


def singular_value_error(matrices, stated):
    """The error of stated singular values in units of what rounding and LAPACK may cost; at most 1 is right."""
    info, s = np.finfo(matrices.dtype), reference.signed_singular_values(matrices)
    unit = (2 * info.eps + 20 * np.finfo(np.float64).eps) * s[:, 0] + 4 * np.longdouble(info.smallest_subnormal)
    return float(np.max(np.abs(stated - s).max(axis=1) / unit))


def condition(name, dtype):
    return reference.condition(FAMILIES[name].sample(COUNT, dtype).matrices)


def test_every_named_family_is_there():
    assert set(FAMILIES) == set(WANTED)
    for name, family in FAMILIES.items():
        assert isinstance(family, Family)
        assert family.name == name
        assert re.fullmatch(r"[a-z][a-z0-9_.-]*", name)
        assert family.description
        assert "\n" not in family.description


@every_family
def test_samples_are_finite_sorted_of_the_dtype_and_have_their_singular_values(family, dtype):
    matrices, s = family.sample(COUNT, dtype)
    assert singular_value_error(matrices, s) <= 1
    assert matrices.shape == (COUNT, 3, 3)
    assert (matrices.dtype, s.dtype, s.shape) == (dtype, np.float64, (COUNT, 3))
    assert np.isfinite(matrices).all()
    assert np.isfinite(s).all()
    assert ((s[:, 0] >= s[:, 1]) & (s[:, 1] >= np.abs(s[:, 2]))).all()
    matrices[:] = 0  # writable, and of its own
    assert family.sample(0, dtype).matrices.shape == (0, 3, 3)
    assert family.sample(0, dtype).singular_values.shape == (0, 3)


def test_a_wrong_singular_value_is_noticed(dtype):
    matrices, s = FAMILIES["gaussian"].sample(COUNT, dtype)
    assert singular_value_error(matrices, s * (1 + 64 * np.finfo(dtype).eps)) > 1
    assert singular_value_error(matrices, s * (1, 1, -1)) > 1


@every_family
def test_the_seed_decides(family):
    first, again, other = (family.sample(COUNT, np.float64, seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first.matrices, again.matrices)
    np.testing.assert_array_equal(first.singular_values, again.singular_values)
    fixed = (first.matrices == first.matrices[0]).all()
    assert (first.matrices != other.matrices).any() or fixed


def test_other_dtypes_are_refused_and_families_do_not_share_random_numbers():
    for dtype in (np.float16, np.int32, np.complex64):
        with pytest.raises(TypeError, match="dtype must be float32 or float64"):
            FAMILIES["gaussian"].sample(1, dtype)
    one, two = (FAMILIES[name].sample(COUNT, np.float64).matrices for name in ("rank_one", "rotation"))
    assert (one != two).all()


def test_the_explicit_matrices_are_what_they_are_called(dtype):
    diagonals = {"identity": (1, 1, 1), "minus_identity": (-1, -1, -1), "reflection": (1, 1, -1)}
    for name, diagonal in {"zero": (0, 0, 0), "half_turn": (1, -1, -1), **diagonals}.items():
        assert (FAMILIES[name].sample(2, dtype).matrices == np.diag(diagonal)).all()
    values = {"swap": (1, 1, 1), "reflection": (1, 1, -1), "minus_identity": (1, 1, -1), "zero": (0, 0, 0)}
    for name, s in values.items():
        assert (FAMILIES[name].sample(2, dtype).singular_values == s).all()
    swap = FAMILIES["swap"].sample(1, dtype).matrices[0]
    assert (swap @ (1, 2, 3) == (2, 1, -3)).all()
    assert (FAMILIES["planar"].sample(COUNT, dtype).matrices[:, :, 2] == 0).all()
    assert (FAMILIES["planar_motion"].sample(COUNT, dtype).matrices[:, 2, :] == 0).all()
    assert (np.count_nonzero(FAMILIES["single_entry"].sample(COUNT, dtype).matrices, axis=(1, 2)) == 1).all()
    sparse, s = FAMILIES["sparse_inverted"].sample(COUNT, dtype)
    assert (np.count_nonzero(sparse, axis=(1, 2)) <= 4).all()
    assert (s[:, 2] < 0).all()


def test_condition_numbers_reach_as_far_as_they_say(dtype):
    eps = float(np.finfo(dtype).eps)
    for name in ("zero", "minus_identity", "reflection", "single_entry", "exact_tie"):
        assert np.isinf(condition(name, dtype)).all()
    for name in ("rotation", "identity", "swap", "half_turn", "scaled_rotation"):
        np.testing.assert_allclose(condition(name, dtype), 0.5, rtol=4 * eps)
    for name in ("needle", "ill_conditioned"):
        kappa = condition(name, dtype)
        assert kappa.min() < 10
        assert 1e-2 / eps < kappa.max() < 1 / (4 * eps)
    kappa = condition("nearly_not_unique", dtype)
    assert (kappa > 1 / (80 * eps)).all()
    assert kappa.max() > 1 / eps
    # Rounding leaves a gap of about eps, of random size and sign.
    assert (condition("minus_rotation", dtype) > 0.1 / eps).all()


def test_near_half_turn_has_w_about_0_and_neighbours_of_vanishing_gap_are_half_a_turn_apart(dtype):
    rotation = reference.reference_rotation(FAMILIES["near_half_turn"].sample(COUNT, dtype).matrices)
    w = np.sqrt(np.abs(np.trace(rotation, axis1=1, axis2=2) + 1)) / 2
    assert w.max() < 0.01
    assert (w[::3] < 1e-3).all()
    matrices, s = FAMILIES["vanishing_gap"].sample(COUNT, dtype)
    r = reference.reference_rotation(matrices)
    gap = s[::2, 1] + s[::2, 2]
    resolved = gap > 8 * np.finfo(dtype).eps
    assert 0.2 < resolved.mean() < 1
    assert np.abs(r[::2] - r[1::2]).max(axis=(1, 2))[resolved].min() > 0.5
    np.testing.assert_allclose((r[::2] * r[1::2]).sum(axis=(1, 2))[resolved].astype(float), -1, atol=0.05)


def test_scales_reach_the_ends_of_the_dtype(dtype):
    info = np.finfo(dtype)
    largest = {name: np.abs(FAMILIES[name].sample(COUNT, dtype).matrices).max(axis=(1, 2)) for name in WANTED}
    assert largest["scale_huge"].max() > info.max / 16
    assert largest["scale_tiny"].min() < 8 * info.smallest_normal
    assert largest["subnormal"].max() < info.smallest_normal
    assert largest["subnormal"].min() > 0
    assert largest["subnormal"].min() < 1024 * info.smallest_subnormal
    assert largest["scale_large"].min() > 1e19
    assert largest["scale_small"].max() < 1e-19
    assert np.ptp(np.log10(largest["scale_mixed"])) > 40


def test_half_turn_starts_have_no_torque_and_their_neighbours_a_little(dtype):
    matrices = FAMILIES["gaussian"].sample(COUNT, dtype).matrices
    solved = reference.solve(matrices)
    eps = np.finfo(dtype).eps
    one = np.eye(3, dtype=dtype)[None]
    for a, r, axes in ((matrices, solved.rotation, solved.right), (one, np.eye(3)[None], None)):
        starts = half_turn_starts(r.astype(dtype), axes)
        assert starts.shape == (9, *a.shape)
        assert starts.dtype == dtype
        torque = np.stack([reference.torque(start, a) for start in starts])
        trace = np.einsum("knij,nij->kn", starts.astype(float), r.astype(float))
        np.testing.assert_allclose(trace, -1, atol=16 * eps)
        assert torque[:3].max() < 16 * eps
        assert torque[3:].max() < 32 * eps
    # At A = 1 nothing is rounded: no torque at all, and some a rounding away.
    assert torque[:3].max() == 0
    assert torque[3:].min() > eps


def test_with_non_finite_leaves_the_neighbours_alone():
    matrices = FAMILIES["gaussian"].sample(10).matrices
    before = matrices.copy()
    changed = with_non_finite(matrices)
    np.testing.assert_array_equal(matrices, before)
    bad = ~np.isfinite(changed).all(axis=(1, 2))
    np.testing.assert_array_equal(np.flatnonzero(bad), (0, 3, 6, 9))
    np.testing.assert_array_equal(changed[~bad], matrices[~bad])
    assert (np.count_nonzero(~np.isfinite(changed[bad]), axis=(1, 2)) == 1).all()
    assert np.isnan(changed).any()
    assert {np.inf, -np.inf} <= set(changed.flat)

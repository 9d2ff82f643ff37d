"""The maps show a planted fault where it is and nowhere else, and the default method without any."""

import json

import jax
import numpy as np
import pytest

import jaxrot
from jaxrot.evaluation import reference
from jaxrot.evaluation.accuracy import run_in_chunks
from jaxrot.report.measure.stability import Kind, map_conditions, map_scales, summarise_conditions, summarise_scales

STEPS = 8
A_CELL = 16


def good(name, matrices):
    """The reference's rotations, rounded to the dtype of the matrices."""
    return reference.reference_rotation(matrices).astype(matrices.dtype)


def cell(s2, s3):
    """The number of a cell of the map of 8 steps."""
    found = map_conditions([], good, "float32", STEPS)
    return int(np.flatnonzero((found.s2 == s2) & (found.s3 == s3))[0])


def with_fault(number, change):
    """Good rotations but for the last matrix of one cell."""

    def run(name, matrices):
        rotations = good(name, matrices)
        last = A_CELL * (number + 1) - 1
        rotations[last] = change(rotations[last])
        return rotations

    return run


def matrices_given(dtype):
    """All matrices of the map, shape (cells, 16, 3, 3), and the map."""
    given = []

    def run(name, matrices):
        given.append(matrices)
        return good(name, matrices)

    found = map_conditions(["good"], run, dtype, STEPS)
    return given[0].reshape(-1, A_CELL, 3, 3), found


def test_the_grid_is_the_region_with_its_lines_and_corners():
    found = map_conditions([], good, "float32", STEPS)
    assert np.all((found.s2 >= 0) & (found.s2 <= 1) & (np.abs(found.s3) <= found.s2))
    points = set(zip(found.s2.tolist(), found.s3.tolist(), strict=True))
    assert len(points) == len(found.s2) == (STEPS + 1) ** 2
    for t in np.arange(STEPS + 1) / STEPS:
        assert {(t, t), (t, -t), (t, 0.0), (1.0, t), (1.0, -t)} <= points


def test_every_cell_has_its_singular_values_and_some_matrices_to_the_last_bit(dtype):
    matrices, found = matrices_given(dtype)
    wanted = np.stack([np.ones_like(found.s2), found.s2, found.s3], -1)
    values = reference.signed_singular_values(matrices)
    assert np.abs(values - wanted[:, None]).max() < 4 * np.finfo(dtype).eps
    assert matrices.dtype == dtype
    exact = -np.sort(-np.abs(matrices[:, -4:].reshape(-1, 4, 9)), axis=-1)
    np.testing.assert_array_equal(exact[..., 1], np.repeat(found.s2[:, None], 4, 1))
    np.testing.assert_array_equal(exact[..., 2], np.repeat(np.abs(found.s3)[:, None], 4, 1))
    assert not exact[..., 3:].any()


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda rotation: rotation * np.nan, Kind.NOT_FINITE),
        (lambda rotation: np.where(np.eye(3) > 0, rotation, np.inf), Kind.NOT_FINITE),
        (lambda rotation: -rotation, Kind.NOT_A_ROTATION),
        (lambda rotation: rotation * 1.001, Kind.NOT_A_ROTATION),
        (lambda rotation: rotation * 1.00001, Kind.OUTSIDE),
        (lambda rotation: rotation[:, [1, 2, 0]], Kind.OUTSIDE),
    ],
)
def test_a_planted_fault_is_in_its_cell_and_nowhere_else(change, kind, dtype):
    number = cell(0.75, 0.25)
    cells = map_conditions(["planted"], with_fault(number, change), dtype, STEPS).methods["planted"]
    assert cells.kind[number] == kind
    assert cells.excess[number] > 1
    others = np.arange(len(cells.kind)) != number
    assert (cells.kind[others] == Kind.KEPT).all()
    assert (cells.excess[others] <= 1).all()


def turned(eps_times):
    """A turn by a small angle, in eps of float32, about no principal axis of any matrix."""
    angle = eps_times * np.finfo("float32").eps / 3**0.5
    cross = angle * np.array([[0, -1, 1], [1, 0, -1], [-1, 1, 0]])
    return lambda rotation: (rotation + rotation @ cross).astype("float32")


def test_a_small_error_is_shown_in_its_units():
    number = cell(0.5, 0.25)
    cells = map_conditions(["planted"], with_fault(number, turned(100)), "float32", STEPS).methods["planted"]
    # κ = 1/(0.5 + 0.25), and ‖R - R*‖_F is √2 times the angle.
    expected = 100 * 2**0.5 / (1 + 4 / 3)
    np.testing.assert_allclose(cells.forward_units[number], expected, rtol=0.02)
    assert cells.excess[number] >= cells.forward_units[number] / 8


# Half a turn about a principal axis costs trace and no torque, a small turn the other way round.
@pytest.mark.parametrize(
    "change",
    [lambda rotation: rotation * np.array([1, -1, -1], "float32"), turned(1000)],
    ids=["trace", "torque"],
)
def test_where_r_is_not_unique_trace_and_torque_are_judged(change):
    number = cell(0.5, -0.5)
    cells = map_conditions(["planted"], with_fault(number, change), "float32", STEPS).methods["planted"]
    assert np.isnan(cells.forward_units[number])
    assert cells.kind[number] == Kind.OUTSIDE
    assert cells.excess[number] > 1


def test_an_excess_beyond_one_and_a_broken_contract_are_the_same(dtype):
    random = np.random.default_rng(0)

    def noisy(name, matrices):
        size = np.repeat(10 ** random.uniform(-1, 2, len(matrices) // A_CELL), A_CELL)[:, None, None]
        noise = random.uniform(-1, 1, matrices.shape)
        return (good(name, matrices) + np.finfo(dtype).eps * size * noise).astype(dtype)

    cells = map_conditions(["noisy"], noisy, dtype, STEPS).methods["noisy"]
    np.testing.assert_array_equal(cells.excess > 1, cells.kind != Kind.KEPT)
    assert 0 < np.mean(cells.kind == Kind.KEPT) < 1


@pytest.mark.parametrize(("dtype", "end"), [("float32", 38), ("float64", 308)])
def test_an_absolute_epsilon_is_found_on_the_scale(dtype, end):
    def absolute(name, matrices):
        norm = np.sqrt((matrices.astype(np.longdouble) ** 2).sum((1, 2)))
        return np.where((norm > 3e-10)[:, None, None], good(name, matrices), np.eye(3, dtype=dtype))

    found = map_scales(["absolute", "good"], lambda name, a: (absolute if name == "absolute" else good)(name, a), dtype)
    summary = summarise_scales(found)
    step = int(np.diff(found.exponents)[0])
    for sign in ("upright", "inverted"):
        lowest = summary["absolute"][sign]["kept"][0]
        assert -10 < lowest <= -10 + step
        assert summary["absolute"][sign]["kept"][1] == end
        assert summary["absolute"][sign]["like_at_1"][0] >= lowest
        assert summary["good"][sign]["kept"] == [-end, end]
    assert found.exponents[found.is_scored].min() <= -end + step
    assert {-38, 0, 38} <= set(found.exponents.tolist())


def test_the_signs_of_the_determinant_are_told_apart():
    def upright_only(name, matrices):
        signs = np.sign(reference.signed_singular_values(matrices)[:, 2]).astype("float32")
        return good(name, matrices) * signs[:, None, None]

    found = map_scales(["upright_only"], upright_only, "float32", exponents=(-2, -1, 0, 1))
    summary = summarise_scales(found)["upright_only"]
    assert summary["upright"] == {"kept": [-2, 1], "like_at_1": [-2, 1]}
    assert summary["inverted"] == {"kept": None, "like_at_1": [-2, 1]}


def test_the_shares_are_json_and_add_up():
    found = map_conditions(["planted"], with_fault(0, lambda rotation: -rotation), "float32", STEPS)
    shares = json.loads(json.dumps(summarise_conditions(found)))["planted"]
    np.testing.assert_allclose(sum(shares.values()), 1)
    assert shares["not_a_rotation"] == 1 / len(found.s2)


def test_the_default_method_keeps_the_contract_on_both_maps(dtype):
    call = jax.jit(jaxrot.nearest_rotation)

    def run(name, matrices):
        return run_in_chunks(call, matrices, 1000)

    conditions = map_conditions(["default"], run, dtype, STEPS)
    assert summarise_conditions(conditions)["default"]["kept"] == 1
    scales = map_scales(["default"], run, dtype)
    assert (scales.methods["default"].kind == Kind.KEPT).all()

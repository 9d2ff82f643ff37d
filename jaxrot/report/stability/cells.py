"""Where each method keeps the contract, and how it fails: over the ratios of the singular values and over the scale."""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from jaxrot.evaluation.accuracy import Errors, measure_errors
from jaxrot.evaluation.ground_truth import judge
from jaxrot.families import Family

Run = Callable[[str, np.ndarray], np.ndarray]

# Largest ‖RᵀR - 1‖_F of what may still be called a rotation: one that stretches by less is a matter of precision and
# shown as an error, one that stretches by more, or reflects, is a failure of another kind.
ROTATION_TOLERANCE = 1e-3

# A power of two, so that every ratio on the grid is a number of both dtypes.
STEPS = 64
_TURNED, _EXACT = 12, 4
_MATRICES_A_SCALE = 16
# How much the error of the same matrices may change with the scale by the chance of rounding.
_STEADY = 10
# Powers of 10 by which the scale changes, from the smallest to the largest. The wider range of float64 holds that of
# float32, in steps which meet its ends.
_EXPONENTS = {"float32": np.arange(-38, 39), "float64": np.arange(-308, 309, 2)}


class Kind(IntEnum):
    """How the worst matrix of a cell came out, from good to bad.

    KEPT: within the contract. OUTSIDE: a rotation, to `ROTATION_TOLERANCE`, that breaks one of its lines.
    NOT_A_ROTATION: stretched by more, or a reflection. NOT_FINITE: with a NaN or an infinity.
    """

    KEPT = 0
    OUTSIDE = 1
    NOT_A_ROTATION = 2
    NOT_FINITE = 3


class Cells(NamedTuple):
    """How one method did, one entry a cell: the worst of the cell's matrices.

    Attributes:
        forward_units: Largest ‖R - R*‖_F / (eps (1 + κ)); NaN where it is judged on no matrix, because R is not unique
            or subnormal entries carry it; inf where R is no number.
        excess: Largest of all the errors that the contract bounds, as a multiple of its bound: at most 1 where the
            contract is kept. inf where R is no number.
        kind: A `Kind`, int8.
    """

    forward_units: np.ndarray
    excess: np.ndarray
    kind: np.ndarray


class ConditionMap(NamedTuple):
    """The methods over the region |s3| ≤ s2 ≤ s1 = 1, in one dtype.

    Attributes:
        dtype: "float32" or "float64".
        steps: From one grid point to the next it is 1/steps, in both directions.
        s2: One entry a cell, from 0 to 1.
        s3: One entry a cell, from -s2 to s2; negative for an inverted matrix.
        matrices_a_cell: In each of the cells.
        methods: By name, in the order they were given.
    """

    dtype: str
    steps: int
    s2: np.ndarray
    s3: np.ndarray
    matrices_a_cell: int
    methods: dict[str, Cells]


class ScaleMap(NamedTuple):
    """The methods over the scale s1 of well-conditioned matrices, in one dtype.

    Attributes:
        dtype: "float32" or "float64".
        exponents: log10 of the scale, one entry a cell; ascending within each sign of the determinant.
        is_inverted: det A < 0, one entry a cell.
        is_scored: One entry a cell: whether any of its matrices is free of subnormal entries that matter. Where not, R
            has to be a rotation and nothing else is asked.
        matrices_a_cell: In each of the cells, the same but for the scale.
        methods: By name, in the order they were given.
    """

    dtype: str
    exponents: np.ndarray
    is_inverted: np.ndarray
    is_scored: np.ndarray
    matrices_a_cell: int
    methods: dict[str, Cells]


def map_conditions(names: Sequence[str], run: Run, dtype: str, steps: int = STEPS) -> ConditionMap:
    """Judges methods on every pair of ratios of the singular values.

    The grid holds every special line exactly: s3 = 0, s3 = s2, s2 = s1, and s3 = -s2, where R is not unique. Most
    matrices of a cell are U diag(s) Vᵀ with random rotations, which rounding moves off these lines by eps; the others
    stay on them to the last bit, because U and V are symmetries of the cube.

    Args:
        names: The methods.
        run: From a method's name and matrices (n, 3, 3) of the dtype, any n, to its rotations (n, 3, 3).
        dtype: "float32" or "float64".
        steps: Cells from 0 to 1; a power of two.
    """
    s2, s3 = _grid(steps)
    turned = Family("turned", "U diag(s) Vᵀ", lambda _: (1, np.repeat(s2, _TURNED), np.repeat(s3, _TURNED)))
    parts = [
        turned.sample(len(s2) * _TURNED, np.dtype(dtype)).matrices.reshape(-1, _TURNED, 3, 3),
        _between_cube_rotations(s2, s3, _EXACT).astype(dtype).reshape(-1, _EXACT, 3, 3),
    ]
    methods, _ = _judge_cells(np.concatenate(parts, axis=1), names, run, dtype)
    return ConditionMap(dtype, steps, s2, s3, _TURNED + _EXACT, methods)


def map_scales(names: Sequence[str], run: Run, dtype: str, exponents: Sequence[int] | None = None) -> ScaleMap:
    """Judges methods on the same matrices, upright and inverted, at every scale.

    Args:
        names: The methods.
        run: As in `map_conditions`.
        dtype: "float32" or "float64".
        exponents: log10 of the scales, ascending, 0 among them; when absent the range of the dtype.
    """
    powers = _EXPONENTS[dtype] if exponents is None else np.asarray(exponents)
    count = _MATRICES_A_SCALE
    signs = np.repeat((1.0, -1.0), count)
    family = Family("unit", "κ < 10", lambda draw: (1, draw.uniform(0.5, 1), signs * draw.uniform(0.1, 0.4)))
    unit = family.sample(2 * count, np.float64).matrices.reshape(2, 1, count, 3, 3)
    scales = np.longdouble(10) ** powers
    methods, is_scored = _judge_cells(
        (unit * scales[:, None, None, None]).reshape(-1, count, 3, 3), names, run, dtype
    )  # fmt: skip
    is_inverted = np.repeat((False, True), len(powers))
    return ScaleMap(dtype, np.tile(powers, 2), is_inverted, is_scored, count, methods)


def summarise_conditions(found: ConditionMap) -> dict[str, dict[str, float]]:
    """The share of the cells that came out as each `Kind`, by method."""
    return {
        name: {kind.name.lower(): float(np.mean(cells.kind == kind)) for kind in Kind}
        for name, cells in found.methods.items()
    }


def summarise_scales(found: ScaleMap) -> dict[str, dict[str, dict[str, list[int] | None]]]:
    """By method and by sign of the determinant, two ranges of the scale around 1, as powers of 10.

    "kept": the contract is kept at all scales of the range; None where it is not kept at 1. "like_at_1": the error is
    at most `_STEADY` times that at 1, within the contract or not, and R a rotation at least if it is one at 1.
    """

    def ranges(cells: Cells, part: np.ndarray) -> dict[str, list[int] | None]:
        exponents, excess, kind = found.exponents[part], cells.excess[part], cells.kind[part]
        one = int(np.searchsorted(exponents, 0))
        is_like = (excess <= _STEADY * excess[one]) & (kind <= max(kind[one], Kind.OUTSIDE))
        return {
            "kept": _range_around(one, exponents, kind == Kind.KEPT),
            "like_at_1": _range_around(one, exponents, is_like),
        }

    parts = {"upright": ~found.is_inverted, "inverted": found.is_inverted}
    return {name: {word: ranges(cells, part) for word, part in parts.items()} for name, cells in found.methods.items()}


def _grid(steps: int) -> tuple[np.ndarray, np.ndarray]:
    ratio = np.arange(-steps, steps + 1) / steps
    s2, s3 = (values.ravel() for values in np.meshgrid(ratio[steps:], ratio))
    inside = np.abs(s3) <= s2
    return s2[inside], s3[inside]


def _between_cube_rotations(s2: np.ndarray, s3: np.ndarray, count: int) -> np.ndarray:
    """`count` products P diag(1, s2, s3) Q for each pair, P and Q rotations that permute and negate the axes."""
    turns = Family("cube", "the 24 rotations of the cube", lambda draw: draw.signed_permutations())
    left, right = (turns.sample(len(s2) * count, np.float64, seed).matrices for seed in (0, 1))
    left, right = (turn * np.linalg.det(turn).round()[:, None, None] for turn in (left, right))
    spectrum = np.repeat(np.stack([np.ones_like(s2), s2, s3], -1), count, axis=0)
    return (left * spectrum[:, None, :]) @ right


def _judge_cells(
    matrices: np.ndarray, names: Sequence[str], run: Run, dtype: str
) -> tuple[dict[str, Cells], np.ndarray]:
    """The methods on matrices of shape (cells, count, 3, 3); and the cells with a matrix on which all is judged."""
    shape = matrices.shape[:2]
    judged = judge({"cells": matrices.reshape(-1, 3, 3)}, dtype)
    eps = float(np.finfo(dtype).eps)
    methods = {}
    for name in names:
        errors = measure_errors(run(name, judged.matrices), judged)
        methods[name] = Cells(
            # Unlike max, fmax passes over what is not judged.
            forward_units=np.fmax.reduce(errors.forward_units.reshape(shape), axis=1),
            excess=np.fmax.reduce(_excess(errors).reshape(shape), axis=1),
            kind=_kind(errors, eps).reshape(shape).max(axis=1),
        )
    return methods, np.asarray(judged.is_normal.reshape(shape).any(axis=1))


def _excess(errors: Errors) -> np.ndarray:
    return np.fmax.reduce(list(errors.over_bounds.values()))


def _kind(errors: Errors, eps: float) -> np.ndarray:
    kind = np.where(errors.is_outside, Kind.OUTSIDE, Kind.KEPT).astype(np.int8)
    kind[errors.orthogonality * eps > ROTATION_TOLERANCE] = Kind.NOT_A_ROTATION
    kind[np.isinf(errors.orthogonality)] = Kind.NOT_FINITE
    return kind


def _range_around(one: int, exponents: np.ndarray, is_good: np.ndarray) -> list[int] | None:
    if not is_good[one]:
        return None
    bad = np.flatnonzero(~is_good)
    first = np.max(bad[bad < one], initial=-1) + 1
    last = np.min(bad[bad > one], initial=len(is_good)) - 1
    return [int(exponents[first]), int(exponents[last])]

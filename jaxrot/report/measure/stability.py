"""Where each method keeps the contract, over the ratios of the singular values and over the scale."""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from jaxrot.evaluation.accuracy import Errors, measure_errors
from jaxrot.evaluation.ground_truth import judge
from jaxrot.families import Family

Run = Callable[[str, np.ndarray], np.ndarray]

# Largest ‖RᵀR - 1‖_F of a result that counts as an inaccurate rotation. Beyond it, or if det R < 0, the result counts
# as no rotation.
ROTATION_TOLERANCE = 1e-3

_TURNED, _EXACT = 12, 4
_MATRICES_A_SCALE = 16
# Rounding may change the error of the same matrices with the scale by this factor.
_STEADY = 10
# Powers of 10 of the scales. Those of float64 include the ends of float32's range.
_EXPONENTS = {"float32": np.arange(-38, 39), "float64": np.arange(-308, 309, 2)}


class Kind(IntEnum):
    """The result for the worst matrix of a cell, from good to bad.

    KEPT is within the contract. OUTSIDE is a rotation to `ROTATION_TOLERANCE` outside the contract. NOT_A_ROTATION is
    beyond this tolerance or a reflection. NOT_FINITE has a NaN or an infinity.
    """

    KEPT = 0
    OUTSIDE = 1
    NOT_A_ROTATION = 2
    NOT_FINITE = 3


class Cells(NamedTuple):
    """The worst results of one method, one entry for each cell."""

    # Largest ‖R - R*‖_F / (eps (1 + κ)). NaN if R is not unique or depends on subnormal entries, inf if R is not
    # finite.
    forward_units: np.ndarray
    # Largest error over its bound in the contract: at most 1 if the contract is kept, inf if R is not finite.
    excess: np.ndarray
    kind: np.ndarray  # A `Kind`, int8


class ConditionMap(NamedTuple):
    """The methods over the region |s3| ≤ s2 ≤ s1 = 1, in one dtype."""

    dtype: str  # "float32" or "float64"
    steps: int  # The grid points are 1/steps apart in both directions
    s2: np.ndarray  # One entry for each cell, from 0 to 1
    s3: np.ndarray  # One entry for each cell, from -s2 to s2; negative for an inverted matrix
    matrices_a_cell: int  # Matrices in each cell
    methods: dict[str, Cells]  # By name, in the order given


class ScaleMap(NamedTuple):
    """The methods over the scale s1 of well-conditioned matrices, in one dtype."""

    dtype: str  # "float32" or "float64"
    exponents: np.ndarray  # log10 of the scale, one entry for each cell; ascending for each sign of the determinant
    is_inverted: np.ndarray  # Whether det A < 0, one entry for each cell
    # Whether R of some matrix does not depend on subnormal entries, one entry for each cell. If false, R must only be a
    # rotation.
    is_scored: np.ndarray
    matrices_a_cell: int  # Matrices in each cell, the same in all cells except for the scale
    methods: dict[str, Cells]  # By name, in the order given


def map_conditions(names: Sequence[str], run: Run, dtype: str, steps: int) -> ConditionMap:
    """Returns the results of methods on every pair of ratios of the singular values.

    The grid contains the lines s3 = 0, s3 = s2, s2 = s1 and s3 = -s2, where R is not unique. Most matrices of a cell
    are U diag(s) Vᵀ with random rotations; rounding moves them off these lines by eps. In the others U and V are
    symmetries of the cube, so that these matrices lie on the lines exactly.

    Args:
        names: The methods.
        run: From a method's name and any number of matrices of the dtype to rotations.
        dtype: "float32" or "float64".
        steps: Cells from 0 to 1: a power of two, so that both dtypes represent every ratio.
    """
    s2, s3 = _grid(steps)
    turned = Family("turned", "U diag(s) Vᵀ", lambda _: (1, np.repeat(s2, _TURNED), np.repeat(s3, _TURNED)))
    parts = [
        turned.sample(len(s2) * _TURNED, np.dtype(dtype)).matrices.reshape(-1, _TURNED, 3, 3),
        _between_cube_rotations(s2, s3, _EXACT).astype(dtype).reshape(-1, _EXACT, 3, 3),
    ]
    methods, _ = _judge_cells(np.concatenate(parts, axis=1), names, run, dtype)
    return ConditionMap(dtype=dtype, steps=steps, s2=s2, s3=s3, matrices_a_cell=_TURNED + _EXACT, methods=methods)


def map_scales(names: Sequence[str], run: Run, dtype: str, exponents: Sequence[int] | None = None) -> ScaleMap:
    """Returns the results of methods on the same matrices, with either sign of the determinant, at every scale.

    Args:
        names: The methods.
        run: As in `map_conditions`.
        dtype: "float32" or "float64".
        exponents: log10 of the scales, ascending, including 0; None for the range of the dtype.
    """
    powers = _EXPONENTS[dtype] if exponents is None else np.asarray(exponents)
    count = _MATRICES_A_SCALE
    signs = np.repeat((1.0, -1.0), count)
    family = Family("unit", "κ < 10", lambda draw: (1, draw.uniform(0.5, 1), signs * draw.uniform(0.1, 0.4)))
    unit = family.sample(2 * count, np.float64).matrices.reshape(2, 1, count, 3, 3)
    scales = np.longdouble(10) ** powers
    matrices = (unit * scales[:, None, None, None]).reshape(-1, count, 3, 3)
    methods, is_scored = _judge_cells(matrices, names, run, dtype)
    return ScaleMap(
        dtype=dtype,
        exponents=np.tile(powers, 2),
        is_inverted=np.repeat((False, True), len(powers)),
        is_scored=is_scored,
        matrices_a_cell=count,
        methods=methods,
    )


def summarise_conditions(found: ConditionMap) -> dict[str, dict[str, float]]:
    """The share of the cells of each `Kind`, by method."""
    return {
        name: {kind.name.lower(): float(np.mean(cells.kind == kind)) for kind in Kind}
        for name, cells in found.methods.items()
    }


def summarise_scales(found: ScaleMap) -> dict[str, dict[str, dict[str, list[int] | None]]]:
    """Two ranges of the scale around 1, as powers of 10, by method and sign of the determinant.

    In the range "kept" the contract is kept; None if it is not kept at scale 1. In the range "like_at_1" the error is
    at most `_STEADY` times the error at scale 1, and R is a rotation if it is one at scale 1.
    """

    def ranges(cells: Cells, part: np.ndarray) -> dict[str, list[int] | None]:
        exponents, excess, kind = found.exponents[part], cells.excess[part], cells.kind[part]
        one = int(np.searchsorted(exponents, 0))
        is_like = (excess <= _STEADY * excess[one]) & (kind <= max(kind[one], Kind.OUTSIDE))
        is_good = {"kept": kind == Kind.KEPT, "like_at_1": is_like}
        return {name: _range_around(one, exponents, good) for name, good in is_good.items()}

    parts = {"upright": ~found.is_inverted, "inverted": found.is_inverted}
    return {name: {word: ranges(cells, part) for word, part in parts.items()} for name, cells in found.methods.items()}


def _grid(steps: int) -> tuple[np.ndarray, np.ndarray]:
    ratio = np.arange(-steps, steps + 1) / steps
    s2, s3 = (values.ravel() for values in np.meshgrid(ratio[steps:], ratio))
    inside = np.abs(s3) <= s2
    return s2[inside], s3[inside]


def _between_cube_rotations(s2: np.ndarray, s3: np.ndarray, count: int) -> np.ndarray:
    """`count` products P diag(1, s2, s3) Q for each pair, with rotations P and Q of the cube."""
    turns = Family("cube", "the 24 rotations of the cube", lambda draw: draw.signed_permutations())
    left, right = (turns.sample(len(s2) * count, np.float64, seed).matrices for seed in (0, 1))
    left, right = (turn * np.linalg.det(turn).round()[:, None, None] for turn in (left, right))
    spectrum = np.repeat(np.stack([np.ones_like(s2), s2, s3], -1), count, axis=0)
    return (left * spectrum[:, None, :]) @ right


def _judge_cells(
    matrices: np.ndarray, names: Sequence[str], run: Run, dtype: str
) -> tuple[dict[str, Cells], np.ndarray]:
    """The methods on matrices of shape (cells, count, 3, 3), and `ScaleMap.is_scored`."""
    shape = matrices.shape[:2]
    judged = judge({"cells": matrices.reshape(-1, 3, 3)}, dtype)
    eps = float(np.finfo(dtype).eps)
    methods = {}
    for name in names:
        errors = measure_errors(run(name, judged.matrices), judged)
        methods[name] = Cells(
            # fmax ignores NaN, the error of a matrix that is not judged.
            forward_units=np.fmax.reduce(errors.forward_units.reshape(shape), axis=1),
            excess=np.fmax.reduce(np.fmax.reduce(list(errors.over_bounds.values())).reshape(shape), axis=1),
            kind=_kind(errors, eps).reshape(shape).max(axis=1),
        )
    return methods, np.asarray(judged.is_normal.reshape(shape).any(axis=1))


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

"""How far results are from what is promised, in one number a matrix, and which families a guard keeps inside."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxrot.evaluation.accuracy import measure_errors
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.families import FAMILIES, with_non_finite
from jaxrot.report.inputs import family_matrices

# A set of its own beside `FAMILIES`; the promise there is NaN, and nothing but NaN.
NOT_FINITE = "not finite"


class Verdict(NamedTuple):
    """One entry a matrix.

    Attributes:
        over_bound: Every error over its bound by the name of the promise: more than 1 where that is broken, inf where
            it has no size, 0 where the promise does not speak of the matrix.
        is_finite: No NaN and no infinity in the result.
    """

    over_bound: Mapping[str, np.ndarray]
    is_finite: np.ndarray

    @property
    def worst(self) -> np.ndarray:
        """The largest of the errors over their bounds."""
        return np.max(list(self.over_bound.values()), axis=0)

    @property
    def is_kept(self) -> np.ndarray:
        """Whether every promise is kept."""
        return self.worst <= 1


class Broken(NamedTuple):
    """What breaks in one family.

    Attributes:
        family: Its name, or `NOT_FINITE`.
        matrices: Matrices (for a step: starts) that keep every promise with the guard and break one without it.
        not_finite: Of these, results with a NaN or an infinity.
        worst: The largest error of them over its bound; inf where that has no size.
        promise: The one that this error breaks.
    """

    family: str
    matrices: int
    not_finite: int
    worst: float
    promise: str


def sample_families(count: int, dtype: str) -> dict[str, np.ndarray]:
    """`count` matrices of every family, and matrices that are not finite."""
    # Every third is changed.
    return family_matrices(count, dtype) | {
        NOT_FINITE: with_non_finite(FAMILIES["gaussian"].sample(3 * count, dtype=np.dtype(dtype)).matrices)[::3]
    }


def judge_contract(rotation: np.ndarray, judged: Judged) -> Verdict:
    """The contract's errors over their bounds.

    A rotation that is not finite is infinitely wrong; so is a number in the place of NaN.
    """
    errors = measure_errors(rotation, judged)
    ratios = errors.over_bounds | {"NaN": np.where(errors.is_outside & ~judged.is_finite, np.inf, 0.0)}
    # NaN among the errors: not defined for this matrix.
    over_bound = {name: np.where(np.isnan(ratio), 0.0, ratio) for name, ratio in ratios.items()}
    return Verdict(over_bound, np.asarray(np.isfinite(rotation).all(axis=(1, 2))))


def broken_families(
    sets: Mapping[str, slice], kept: np.ndarray, without: Verdict, counted: np.ndarray
) -> tuple[Broken, ...]:
    """The families with a matrix that breaks a promise, the worst first.

    Args:
        sets: The families' parts of the batch.
        kept: Which matrices keep every promise with the guard.
        without: What was reached without it.
        counted: Which matrices count.
    """
    breaks = kept & counted & ~without.is_kept
    found = []
    for name, part in sets.items():
        if breaks[part].any():
            worst = {promise: float(over[part][breaks[part]].max()) for promise, over in without.over_bound.items()}
            promise = max(worst, key=lambda promise: worst[promise])
            not_finite = int((breaks & ~without.is_finite)[part].sum())
            found.append(Broken(name, int(breaks[part].sum()), not_finite, worst[promise], promise))
    return tuple(sorted(found, key=lambda entry: (-entry.worst, -entry.matrices)))

"""How far results are from each promise, one number for each matrix, and which families break a promise."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxrot.evaluation.accuracy import measure_errors
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.families import FAMILIES, with_non_finite
from jaxrot.report.inputs import family_matrices

# A set in addition to `FAMILIES`. Its promise is NaN in every entry.
NOT_FINITE = "not finite"


class Verdict(NamedTuple):
    """The errors of one program, one entry for each matrix."""

    # Every error over its bound, by the name of the promise: more than 1 if the promise is broken, inf if the result is
    # not finite, 0 if the promise does not cover the matrix.
    over_bound: Mapping[str, np.ndarray]
    is_finite: np.ndarray  # The result has no NaN and no infinity

    @property
    def worst(self) -> np.ndarray:
        """The largest of the errors over their bounds."""
        return np.max(list(self.over_bound.values()), axis=0)

    @property
    def is_kept(self) -> np.ndarray:
        """Whether all promises are kept."""
        return self.worst <= 1


class Broken(NamedTuple):
    """What breaks in one family."""

    family: str  # Its name, or `NOT_FINITE`
    matrices: int  # Matrices (starts of a step) that keep every promise with the guard and break one without it
    not_finite: int  # Of these, results with a NaN or an infinity
    worst: float  # Their largest error over its bound
    promise: str  # The promise that this error breaks


def sample_families(count: int, dtype: str) -> dict[str, np.ndarray]:
    """`count` matrices of every family, and as many that are not finite."""
    # `with_non_finite` changes every third matrix.
    return family_matrices(count, dtype) | {
        NOT_FINITE: with_non_finite(FAMILIES["gaussian"].sample(3 * count, dtype=np.dtype(dtype)).matrices)[::3]
    }


def judge_contract(rotation: np.ndarray, judged: Judged) -> Verdict:
    """The contract's errors over their bounds.

    The error is infinite if the rotation is not finite, or if it is finite and the matrix is not.
    """
    errors = measure_errors(rotation, judged)
    ratios = errors.over_bounds | {"NaN": np.where(errors.is_outside & ~judged.is_finite, np.inf, 0.0)}
    # An error is NaN if it is not defined for the matrix.
    over_bound = {name: np.where(np.isnan(ratio), 0.0, ratio) for name, ratio in ratios.items()}
    return Verdict(over_bound, np.asarray(np.isfinite(rotation).all(axis=(1, 2))))


def broken_families(
    sets: Mapping[str, slice], kept: np.ndarray, without: Verdict, counted: np.ndarray
) -> tuple[Broken, ...]:
    """The families with a matrix that breaks a promise, the worst first.

    Args:
        sets: The families' parts of the batch.
        kept: Whether each matrix keeps every promise with the guard.
        without: The errors without the guard.
        counted: Whether each matrix counts.
    """
    breaks = kept & counted & ~without.is_kept
    found = []
    for name, part in sets.items():
        if breaks[part].any():
            worst = {promise: float(over[part][breaks[part]].max()) for promise, over in without.over_bound.items()}
            promise = max(worst, key=lambda promise: worst[promise])
            not_finite = int((breaks & ~without.is_finite)[part].sum())
            count = int(breaks[part].sum())
            found.append(Broken(name, matrices=count, not_finite=not_finite, worst=worst[promise], promise=promise))
    return tuple(sorted(found, key=lambda entry: (-entry.worst, -entry.matrices)))

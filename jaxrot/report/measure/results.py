"""Results of the methods, and the summaries of errors and times that all results share."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.timing import Timing
from jaxrot.report.inputs import WHOLE


class Spread(NamedTuple):
    """Median and quartiles of the time per matrix, in ns."""

    median: float
    quartile_1: float
    quartile_3: float


class Quantiles(NamedTuple):
    """Median, 99th percentile and largest of some errors. The error of a result that is not finite is infinite."""

    median: float
    percentile_99: float
    largest: float


class Results(NamedTuple):
    """Accuracy and time of the methods, one entry for each method, dtype and set or batch size."""

    accuracy: list[Accuracy]  # On every set
    timing: list[Timing]  # At every batch size
    remarks: tuple[str, ...]  # What was left out and why, one sentence each


def quantiles(errors: np.ndarray) -> Quantiles | None:
    """The quantiles of the errors that are not NaN; None if all are NaN."""
    errors = errors[~np.isnan(errors)]
    # "higher" does not interpolate: between a finite number and infinity the result would be NaN.
    return Quantiles(*np.quantile(errors, [0.5, 0.99, 1.0], method="higher").tolist()) if errors.size else None


def spread(seconds: Sequence[float], batch: int) -> Spread:
    """The time per matrix, from samples in seconds per call."""
    first, median, third = (np.quantile(seconds, [0.25, 0.5, 0.75]) * 1e9 / batch).tolist()
    return Spread(median, first, third)


def largest_batch(timing: Sequence[Timing]) -> int:
    """The largest batch size timed in every dtype, so that dtypes can be compared."""
    by_dtype: dict[str, set[int]] = {}
    for entry in timing:
        by_dtype.setdefault(entry.dtype, set()).add(entry.batch)
    return max(set.intersection(*by_dtype.values()))


def times_at_largest_batch(results: Results, dtype: str) -> dict[str, Timing]:
    """The timing of every method in a dtype at the largest batch, by the method's name, the fastest first."""
    batch = largest_batch(results.timing)
    entries = [entry for entry in results.timing if entry.dtype == dtype and entry.batch == batch]
    return {entry.method: entry for entry in sorted(entries, key=lambda entry: entry.median_ns)}


def on_input(results: Results, dtype: str) -> dict[str, Accuracy]:
    """The accuracy of every method on the whole input, by the method's name."""
    return {entry.method: entry for entry in results.accuracy if entry.dtype == dtype and entry.set_name == WHOLE}

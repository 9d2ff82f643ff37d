"""Times and errors compared with those of an earlier report."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxrot.console.errors import UserError, shown
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.timing import Timing
from jaxrot.report.inputs import WHOLE
from jaxrot.report.measure.results import Results

# The median of fewer ratios says little about the machine: it may be the ratio of the method in question.
_FEWEST_FOR_MACHINE = 4
EXPECTED = "expected the report.json of an earlier run"


class TimeChange(NamedTuple):
    """Times of one method at one batch size in two runs."""

    method: str  # Its name
    dtype: str  # "float32" or "float64"
    batch: int  # Matrices in a call
    before_ns: float  # Median per matrix in the earlier run
    now_ns: float  # Median per matrix in this run
    ratio: float  # now / before
    relative: float  # The ratio over the machine's share
    # "slower" or "faster" if the quartiles of the runs do not overlap, with and without the machine's share, and the
    # ratio is an outlier at this batch size; else "".
    verdict: str


class ErrorChange(NamedTuple):
    """Errors of one method on the whole input in two runs."""

    method: str  # Its name
    dtype: str  # "float32" or "float64"
    before: float | None  # 99th percentile of the forward error in the earlier run; None if no error was defined
    now: float | None  # The same in this run
    outside_before: int  # Matrices of input and families outside the contract in the earlier run
    outside_now: int  # The same in this run
    # "worse" or "better" if more or fewer matrices are outside, or the error changed by more than a twentieth; else "".
    verdict: str


class Comparison(NamedTuple):
    """Two runs compared."""

    name: str  # Of the earlier file
    environment: dict[str, str]  # Of the earlier run
    machine: float  # The machine's share in the times: the median of all ratios, or 1 if there are too few
    times: tuple[TimeChange, ...]  # One entry for each method, dtype and batch size of both runs
    # One entry for each method and dtype of both runs; empty if the inputs differ. Only families of which both runs
    # drew the same number of matrices count.
    errors: tuple[ErrorChange, ...]
    remarks: tuple[str, ...]  # What cannot be compared and why, one sentence each


def read_report(path: Path) -> dict[str, Any]:
    """Returns the content of an earlier report.json.

    Raises:
        UserError: The file does not exist, or is no report.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror.lower() if isinstance(error, OSError) and error.strerror else "it is no text"
        raise UserError(f"--compare {shown(path)}: cannot be read ({reason}); {EXPECTED}") from None
    except json.JSONDecodeError:
        raise UserError(f"--compare {shown(path)}: this is no JSON; {EXPECTED}") from None
    try:
        for entry in content["timing"]:
            Timing(**entry)
        for entry in content["accuracy"]:
            Accuracy(**entry)
        environment, sets = content["environment"], content["input"]["sets"]
        is_report = bool(isinstance(environment, dict) and sets and content["accuracy"] and content["timing"])
    except (KeyError, TypeError):
        is_report = False
    if not is_report:
        raise UserError(f"--compare {shown(path)}: holds no report; {EXPECTED}")
    return content


def compare(name: str, before: dict[str, Any], results: Results, sets: dict[str, int]) -> Comparison:
    """Compares new results with those of an earlier report.

    Args:
        name: The name of the earlier file.
        before: Its content.
        results: The new results.
        sets: Names and sizes of the sets in the new input.
    """
    remarks = []
    machine, times = _times([Timing(**entry) for entry in before["timing"]], results.timing)
    if 0 < len(times) < _FEWEST_FOR_MACHINE:
        remarks.append("Too few times are common to both runs to tell the machine's share.")
    if not times:
        remarks.append("No method was timed in both runs at the same batch size and dtype.")
    is_same_input = before["input"]["sets"] == sets
    if not is_same_input:
        remarks.append("The earlier run was on another input; errors are not compared.")
    return Comparison(
        name=name,
        environment=before["environment"],
        machine=machine,
        times=times,
        errors=_errors([Accuracy(**entry) for entry in before["accuracy"]], results.accuracy) if is_same_input else (),
        remarks=tuple(remarks),
    )


def _times(before: Sequence[Timing], now: Sequence[Timing]) -> tuple[float, tuple[TimeChange, ...]]:
    """The machine's share and the changes."""
    earlier = {(entry.method, entry.dtype, entry.batch): entry for entry in before}
    pairs = [(earlier[key], entry) for entry in now if (key := (entry.method, entry.dtype, entry.batch)) in earlier]
    ratios = [new.median_ns / old.median_ns for old, new in pairs]
    machine = float(np.median(ratios)) if len(ratios) >= _FEWEST_FOR_MACHINE else 1.0
    batches = {new.batch for _, new in pairs}
    usual = {batch: _usual([n.median_ns / o.median_ns for o, n in pairs if n.batch == batch]) for batch in batches}
    return machine, tuple(
        TimeChange(
            method=new.method,
            dtype=new.dtype,
            batch=new.batch,
            before_ns=old.median_ns,
            now_ns=new.median_ns,
            ratio=new.median_ns / old.median_ns,
            relative=new.median_ns / old.median_ns / machine,
            verdict=_verdict(old, new, machine, usual[new.batch]),
        )
        for old, new in pairs
    )


def _usual(ratios: Sequence[float]) -> tuple[float, float]:
    """The range of ratios without outliers: the quartiles, extended by one and a half times their range.

    Times differ more between runs than within one. Of 126 ratios of the same code, the quartiles did not overlap in 35,
    and 3 of these are outliers.
    """
    if len(ratios) < _FEWEST_FOR_MACHINE:
        return 1.0, 1.0
    first, third = np.quantile(np.log(ratios), [0.25, 0.75])
    reach = 1.5 * (third - first)
    return float(np.exp(first - reach)), float(np.exp(third + reach))


def _verdict(old: Timing, new: Timing, machine: float, usual: tuple[float, float]) -> str:
    if usual[0] <= new.median_ns / old.median_ns <= usual[1]:
        return ""
    if all(new.quartile_1_ns / share > old.quartile_3_ns for share in (1.0, machine)):
        return "slower"
    if all(new.quartile_3_ns / share < old.quartile_1_ns for share in (1.0, machine)):
        return "faster"
    return ""


def _errors(before: Sequence[Accuracy], now: Sequence[Accuracy]) -> tuple[ErrorChange, ...]:
    # A run with --quick draws fewer matrices of each family, so that the numbers outside are not comparable.
    common = {_set(entry) for entry in before} & {_set(entry) for entry in now}
    earlier = {(entry.method, entry.dtype): entry for entry in before if entry.set_name == WHOLE}

    def outside(entries: Sequence[Accuracy], key: tuple[str, str]) -> int:
        of_method = [entry for entry in entries if (entry.method, entry.dtype) == key and _set(entry) in common]
        # The whole input includes the other sets of the input.
        return sum(entry.outside for entry in of_method if entry.group != "input" or entry.set_name == WHOLE)

    return tuple(
        _error_change(earlier[key], entry, outside(before, key), outside(now, key))
        for entry in now
        if entry.set_name == WHOLE and (key := (entry.method, entry.dtype)) in earlier
    )


def _set(entry: Accuracy) -> tuple[str, str, int]:
    return entry.group, entry.set_name, entry.matrices


def _error_change(old: Accuracy, new: Accuracy, outside_before: int, outside_now: int) -> ErrorChange:
    # The file holds an infinite error as a string.
    before, now = (None if error is None else float(error) for error in (old.forward_99th, new.forward_99th))
    grew = before is not None and now is not None and now > 1.05 * before
    shrank = before is not None and now is not None and before > 1.05 * now
    better = "better" if outside_now < outside_before or shrank else ""
    return ErrorChange(
        method=new.method,
        dtype=new.dtype,
        before=before,
        now=now,
        outside_before=outside_before,
        outside_now=outside_now,
        verdict="worse" if outside_now > outside_before or grew else better,
    )

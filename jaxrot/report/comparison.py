"""This report against an earlier one: what got slower, what got worse."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxrot.console.errors import UserError, shown
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.timing import Timing
from jaxrot.report.measurement import WHOLE, Results

# The median of fewer ratios is as good as the ratio of the method that is looked at.
_FEWEST_FOR_MACHINE = 4
EXPECTED = "expected the report.json of an earlier run"


class TimeChange(NamedTuple):
    """One method at one batch size, then and now.

    Attributes:
        method: Its name.
        dtype: "float32" or "float64".
        batch: Matrices in a call.
        before_ns: Median a matrix in the earlier run.
        now_ns: Median a matrix in this one.
        ratio: now / before; above 1 it takes longer.
        relative: The ratio over the median of all ratios, which is what the machine itself contributes.
        verdict: "slower" or "faster" where the quartiles of both runs stand apart, also when the machine's share is
            taken out, and the ratio stands out from those of the other methods at that batch size; else "".
    """

    method: str
    dtype: str
    batch: int
    before_ns: float
    now_ns: float
    ratio: float
    relative: float
    verdict: str


class ErrorChange(NamedTuple):
    """One method on the whole input, then and now.

    Attributes:
        method: Its name.
        dtype: "float32" or "float64".
        before: 99th percentile of the forward error in the earlier run; None where there was none.
        now: The same in this one.
        outside_before: Matrices outside the contract, input and families together.
        outside_now: The same in this one.
        verdict: "worse", "better", or "" where neither number changed by more than a twentieth.
    """

    method: str
    dtype: str
    before: float | None
    now: float | None
    outside_before: int
    outside_now: int
    verdict: str


class Comparison(NamedTuple):
    """Two runs.

    Attributes:
        name: Of the earlier file.
        environment: Of the earlier run.
        machine: Median of all ratios of times: what changed for all methods alike; 1 where they are too few to tell.
        times: One entry a method, dtype and batch size that both runs have.
        errors: One entry a method and dtype that both have; empty where the input is another. Families count where both
            runs drew as many matrices.
        remarks: What cannot be compared and why, one sentence each.
    """

    name: str
    environment: dict[str, str]
    machine: float
    times: tuple[TimeChange, ...]
    errors: tuple[ErrorChange, ...]
    remarks: tuple[str, ...]


def read_report(path: Path) -> dict[str, Any]:
    """The content of an earlier report.json.

    Raises:
        UserError: There is no such file, or it is none.
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
    """Sets an earlier report beside new results.

    Args:
        name: The earlier file's, for the reader.
        before: Its content.
        results: The new ones.
        sets: Names and sizes of the new input's sets.
    """
    remarks = []
    machine, times = _times([Timing(**entry) for entry in before["timing"]], results.timing)
    if 0 < len(times) < _FEWEST_FOR_MACHINE:
        remarks.append("Too few times are common to tell the machine's share in them.")
    if not times:
        remarks.append("No method was timed in both runs at the same batch size and dtype.")
    errors: tuple[ErrorChange, ...] = ()
    if before["input"]["sets"] == sets:
        errors = _errors(before["accuracy"], results)
    else:
        remarks.append("The earlier run was on another input; errors are not compared.")
    return Comparison(name, before["environment"], machine, times, errors, tuple(remarks))


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
    """Between which ratios a method does not stand out: one and a half times the interquartile range beyond either end.

    Times differ more from run to run than within one: of 126 ratios of the same code 35 had their quartiles apart, and
    3 of these stand out.
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


def _errors(before: Sequence[dict[str, Any]], results: Results) -> tuple[ErrorChange, ...]:
    now = [entry._asdict() for entry in results.accuracy]
    # A run with --quick draws fewer matrices of each family; what is outside of them says nothing about another run's.
    common = {_set(entry) for entry in before} & {_set(entry) for entry in now}

    def outside(entries: Sequence[dict[str, Any]], method: str, dtype: str) -> int:
        return sum(
            entry["outside"]
            for entry in entries
            if (entry["method"], entry["dtype"]) == (method, dtype)
            and _set(entry) in common
            # The input's parts are in the whole.
            and (entry["group"] != "input" or entry["set_name"] == WHOLE)
        )

    earlier = {(entry["method"], entry["dtype"]): entry for entry in before if entry["set_name"] == WHOLE}
    changes = []
    for entry in now:
        key = entry["method"], entry["dtype"]
        if entry["set_name"] == WHOLE and key in earlier:
            old, new = (None if e["forward_99th"] is None else float(e["forward_99th"]) for e in (earlier[key], entry))
            counts = outside(before, *key), outside(now, *key)
            changes.append(ErrorChange(*key, old, new, *counts, _error_verdict((old, counts[0]), (new, counts[1]))))
    return tuple(changes)


def _set(entry: dict[str, Any]) -> tuple[str, str, int]:
    return entry["group"], entry["set_name"], entry["matrices"]


def _error_verdict(old: tuple[float | None, int], new: tuple[float | None, int]) -> str:
    if _is_more(old, new):
        return "worse"
    return "better" if _is_more(new, old) else ""


def _is_more(small: tuple[float | None, int], large: tuple[float | None, int]) -> bool:
    return large[1] > small[1] or (None not in (small[0], large[0]) and (large[0] or 0.0) > 1.05 * (small[0] or 0.0))

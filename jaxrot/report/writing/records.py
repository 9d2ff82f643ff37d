"""The report as records: CSV and JSON to go on computing with."""

import csv
import io
import json
import math
from collections.abc import Mapping
from typing import Any

from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.timing import Timing
from jaxrot.report.bench import Bench
from jaxrot.report.content import Content
from jaxrot.report.findings import findings
from jaxrot.report.measurement import WHOLE, Results
from jaxrot.report.stability.cells import summarise_conditions, summarise_scales


def as_json(content: Content) -> str:
    """report.json: everything measured. Infinity is the string "inf": JSON has no number for it."""
    given, beside = content.given, content.beside
    return _dumped(
        {
            "environment": content.environment,
            "options": content.options,
            "input": {"name": given.name, "sets": {name: len(part) for name, part in given.sets.items()}},
            "remarks": [*given.remarks, *content.results.remarks],
            "findings": findings(content),
            "accuracy": content.results.accuracy,
            "timing": content.results.timing,
            "peers": None if beside is None else beside,
            "warm_starts": content.warm_starts,
            "guards": content.guards,
            "stability": {
                "conditions": {found.dtype: summarise_conditions(found) for found in content.conditions},
                "scales": {found.dtype: summarise_scales(found) for found in content.scales},
            },
            "comparison": content.comparison,
        }
    )


def as_csv(results: Results) -> str:
    """report.csv: one row a method, dtype and set; in the rows of the whole input the times, too."""
    columns = ("median_ns", "quartile_1_ns", "quartile_3_ns", "fastest_ns", "compile_s")
    batches = sorted({entry.batch for entry in results.timing})
    by_key: dict[tuple[str, str, int], Timing] = {
        (entry.method, entry.dtype, entry.batch): entry for entry in results.timing
    }
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*Accuracy._fields, *(f"{column}_batch_{batch}" for batch in batches for column in columns)])
    for entry in results.accuracy:
        is_timed = entry.group == "input" and entry.set_name == WHOLE
        times = []
        for batch in batches:
            timing = by_key.get((entry.method, entry.dtype, batch)) if is_timed else None
            times += [getattr(timing, column, None) for column in columns]
        writer.writerow([*entry, *times])
    return text.getvalue()


def as_bench_json(bench: Bench, environment: Mapping[str, str]) -> str:
    """bench.json: everything measured."""
    return _dumped(
        {
            "environment": environment,
            "goals": [goal._asdict() | {"is_met": goal.is_met} for goal in bench.goals],
            "nanoseconds": bench.nanoseconds,
        }
    )


def _dumped(content: Mapping[str, Any]) -> str:
    return json.dumps(_plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    """NamedTuples as objects with the names of their fields, infinities as strings."""
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return str(value) if isinstance(value, float) and math.isinf(value) else value

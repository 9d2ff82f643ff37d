"""The report as data: CSV and JSON."""

import csv
import io
import json
import math
from collections.abc import Mapping
from typing import Any

from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.report.data import ReportData
from jaxrot.report.inputs import WHOLE
from jaxrot.report.measure.bench import Bench
from jaxrot.report.measure.results import Results
from jaxrot.report.measure.stability import summarise_conditions, summarise_scales
from jaxrot.report.show.findings import findings


def as_json(data: ReportData) -> str:
    """report.json: everything measured. JSON has no infinity, which becomes the string "inf"."""
    return _dumped(
        {
            "environment": data.environment,
            "options": data.options,
            "input": {"name": data.given.name, "sets": data.given.counts},
            "remarks": [*data.given.remarks, *data.results.remarks],
            "findings": findings(data),
            "accuracy": data.results.accuracy,
            "timing": data.results.timing,
            "peers": data.peers,
            "warm_starts": data.warm_starts,
            "guards": data.guards,
            "stability": {
                "conditions": {found.dtype: summarise_conditions(found) for found in data.conditions},
                "scales": {found.dtype: summarise_scales(found) for found in data.scales},
            },
            "comparison": data.comparison,
        }
    )


def as_csv(results: Results) -> str:
    """report.csv: one row for each method, dtype and set. The rows of the whole input include the times."""
    columns = ("median_ns", "quartile_1_ns", "quartile_3_ns", "fastest_ns", "compile_s")
    batches = sorted({entry.batch for entry in results.timing})
    by_key = {(entry.method, entry.dtype, entry.batch): entry for entry in results.timing}
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
    """NamedTuples as dictionaries of their fields, infinities as strings."""
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return str(value) if isinstance(value, float) and math.isinf(value) else value

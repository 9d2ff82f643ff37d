"""The report as files: Markdown to read, CSV and JSON to go on computing with."""

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from jaxrot.measuring.accuracy import Accuracy
from jaxrot.measuring.timing import Timing
from jaxrot.report.bench import Bench
from jaxrot.report.findings import findings
from jaxrot.report.inputs import Input
from jaxrot.report.measurement import WHOLE, Results
from jaxrot.report.tables import (
    Table,
    accuracy_table,
    as_markdown,
    as_text,
    goals_table,
    sets_table,
    summary_table,
    timing_table,
)

_CONTRACT = """\
The **contract**, for a finite matrix with singular values s1 ≥ s2 ≥ |s3|, κ = s1/(s2+s3), R* its nearest rotation:
forward error ‖R - R\\*‖_F ≤ 8 eps (1+κ) where κ < 1/(8 eps); ‖RᵀR - 1‖_F ≤ 10 eps and det R > 0; lost trace
tr(R\\*ᵀA) - tr(RᵀA) ≤ 16 eps s1; torque ‖RᵀA - AᵀR‖_F ≤ 128 eps s1. Errors are judged against a wider arithmetic, on
the matrices as rounded to the dtype; columns without another word are maxima. A method's **own domain** is the part of
all matrices for which it declares that it keeps the contract; an approximation declares none."""

_TIMES = """\
Median (quartiles) over rounds in which every method runs once, in random order, on a batch filled with matrices of
the input; compiled and warmed up beforehand, each call waited for. Compile time is that of the largest batch
timed in every dtype, without a cache."""

_BENCH = """\
Gaussian matrices, float32 where not said otherwise. Ratios of times are medians and quartiles over rounds in which
every function of a group runs once, in random order; compiled and warmed up beforehand, each call waited for. The copy
is `A * c`, into a new array. *In blocks*: `in_blocks`."""

_VERDICTS = """\
Matrices outside the contract: `·` none, **bold** inside the method's own domain (a broken promise), (in parentheses)
beyond it."""


def as_report_markdown(
    results: Results, given: Input, environment: Mapping[str, str], dtypes: Sequence[str], picture: str
) -> str:
    """report.md: header, findings, picture, tables."""
    parts = [f"# Error against run time: {given.name}", _header(environment)]
    parts += ["## Findings", *findings(results, dtypes, given.name)]
    parts += [f"![Error against time a matrix, the Pareto front marked]({picture})"]
    parts += ["## Errors and time", *given.remarks, *results.remarks, _CONTRACT]
    for dtype in dtypes:
        parts += _section(accuracy_table(results, dtype, given.name))
    parts += ["## Time", _TIMES]
    for dtype in dtypes:
        parts += _section(timing_table(results, dtype))
    parts += ["## Where the contract breaks", _VERDICTS]
    for dtype in dtypes:
        parts += _section(sets_table(results, dtype, "input", given.name))
        parts += _section(sets_table(results, dtype, "families", "Families"))
    return "\n\n".join(parts) + "\n"


def as_terminal_text(results: Results, given: Input, environment: Mapping[str, str], dtypes: Sequence[str]) -> str:
    """What the command prints: header, one table a dtype, findings."""
    parts = [_columns(environment)]
    parts += [as_text(summary_table(results, dtype, given.name)) for dtype in dtypes]
    parts.append(
        "outside: matrices outside the contract; own: of these, inside the domain the method declares;\n"
        "ns: median (quartiles) a matrix"
    )
    parts += [paragraph.replace("**", "") for paragraph in findings(results, dtypes, given.name)]
    return "\n\n".join([*parts, *results.remarks])


def as_json(
    results: Results, given: Input, environment: Mapping[str, str], dtypes: Sequence[str], options: Mapping[str, Any]
) -> str:
    """report.json: everything measured. Infinity is the string "inf": JSON has no number for it."""
    content = {
        "environment": dict(environment),
        "options": dict(options),
        "input": {"name": given.name, "sets": {name: len(part) for name, part in given.sets.items()}},
        "remarks": [*given.remarks, *results.remarks],
        "findings": findings(results, dtypes, given.name),
        "accuracy": [_finite(entry._asdict()) for entry in results.accuracy],
        "timing": [entry._asdict() for entry in results.timing],
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


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


def as_bench_markdown(bench: Bench, environment: Mapping[str, str]) -> str:
    """bench.md: header and table."""
    table = goals_table(bench.goals)
    parts = ["# Speed of jaxrot", _header(environment), _BENCH, f"## {table.title}", as_markdown(table)]
    return "\n\n".join(parts) + "\n"


def as_bench_text(bench: Bench, environment: Mapping[str, str]) -> str:
    """What the command prints."""
    return "\n\n".join([_columns(environment), as_text(goals_table(bench.goals))])


def as_bench_json(bench: Bench, environment: Mapping[str, str]) -> str:
    """bench.json: everything measured."""
    content = {
        "environment": dict(environment),
        "goals": [goal._asdict() | {"is_met": goal.is_met} for goal in bench.goals],
        "nanoseconds": bench.nanoseconds,
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _columns(environment: Mapping[str, str]) -> str:
    width = max(map(len, environment))
    return "\n".join(f"{name.ljust(width)}  {value}" for name, value in environment.items())


def _header(environment: Mapping[str, str]) -> str:
    return "\n".join(f"- {name}: {value}" for name, value in environment.items())


def _section(table: Table) -> list[str]:
    return [f"### {table.title}", as_markdown(table)]


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: str(value) if isinstance(value, float) and math.isinf(value) else value for name, value in values.items()
    }

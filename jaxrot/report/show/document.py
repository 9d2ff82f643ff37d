"""The report as Markdown, and its summary for a terminal."""

from collections.abc import Iterable, Mapping

import jaxrot
from jaxrot.console.tables import Table, as_markdown, as_text
from jaxrot.report.data import ReportData
from jaxrot.report.measure.bench import Bench
from jaxrot.report.measure.results import on_input
from jaxrot.report.measure.warm_starts import ANGLE_DEGREES
from jaxrot.report.show import pictures as names
from jaxrot.report.show.comparison_tables import (
    compared_sentence,
    errors_compared_table,
    peers_table,
    sources_table,
    times_compared_table,
    verdicts,
    warm_starts_table,
)
from jaxrot.report.show.findings import faster_outside, findings, warm_starts_finding
from jaxrot.report.show.guard_tables import GUARDS_CAPTION, guards_table
from jaxrot.report.show.robustness import ROBUSTNESS_CAPTION, robustness_table
from jaxrot.report.show.stability_maps import CONDITIONS_CAPTION, SCALES_CAPTION
from jaxrot.report.show.tables import accuracy_table, goals_table, sets_table, summary_table, timing_table

_CONTRACT = """\
The **contract** bounds four errors for a finite matrix A with singular values s1 ≥ s2 ≥ |s3|, condition number
κ = s1/(s2+s3) and nearest rotation R\\*. Forward error: ‖R - R\\*‖_F ≤ 8 eps (1+κ) where κ < 1/(8 eps). Orthogonality:
‖RᵀR - 1‖_F ≤ 10 eps and det R > 0. Lost trace: tr(R\\*ᵀA) - tr(RᵀA) ≤ 16 eps s1. Torque: ‖RᵀA - AᵀR‖_F ≤ 128 eps s1.
The reference values come from wider arithmetic, for the matrices as rounded to the dtype. Errors are maxima unless the
column says otherwise. A method's **own domain** is the part of all matrices for which it declares that it keeps the
contract; an approximation declares none."""

_TIMES = """\
Median (quartiles) over rounds in which every method runs once, in random order. The batch is filled with matrices of
the input. Methods are compiled and warmed up beforehand, and each call is waited for. The compile time is that of the
largest batch timed in every dtype, without a cache."""

_SETS = """\
Matrices outside the contract: `·` none, **bold** inside the method's own domain (a broken promise), (in parentheses)
outside that domain."""

_PEERS = """\
The methods on jaxrot's front and other packages on the same matrices, in the same rounds, each with its own copy in its
own memory. The gradient is the cotangent of A for a random cotangent of R. Its error is relative to wider arithmetic,
where κ ≤ 1/(128 eps). *No result* counts NaN and refused matrices: their error is infinite, and a package is timed on
the matrices that it accepts. Matrices that are not finite are left out. *Families with such* counts the families of
extreme matrices with a gradient that is not finite. A peer is beyond jaxrot's front, and filled in the picture, if no
method measured here is as accurate, up to a tenth, and as fast, up to the spread."""

_WARM_STARTS = f"""\
Starts are the nearest rotation turned by {ANGLE_DEGREES:.0f}° about a random axis. The time is that of all iterations
together."""

_COMPARED = """\
A method is called slower or faster if the quartiles of the two runs do not overlap, with and without the machine's
share, which is the median of all ratios. Its ratio must also be an outlier among those of all methods at that batch
size: beyond the quartiles by one and a half times their range. A method is called worse if more matrices are outside
the contract, or if the error grew by more than a twentieth."""

_CAPTIONS = {
    names.METHODS: "Every method: error against time per matrix. Below and to the left is better.",
    names.PEERS: "Values: the methods on jaxrot's front, and other packages.",
    names.GRADIENTS: "Value and gradient together, for the same methods and packages.",
    names.WARM_STARTS: "Every step from a warm start. The numbers are iterations.",
    names.conditions("float32"): CONDITIONS_CAPTION,
    names.conditions("float64"): "The same in float64.",
    names.SCALES: SCALES_CAPTION,
    names.SURVIVAL: "Every method on the extreme families. A table below describes them.",
}


_BENCH = """\
Gaussian matrices, in float32 unless stated otherwise. Ratios of times are medians and quartiles over rounds in which
every function of a group runs once, in random order. Functions are compiled and warmed up beforehand, and each call is
waited for. The copy is `A * c`, into a new array. *In blocks* means `in_blocks`."""


def as_report_markdown(data: ReportData, pictures: Mapping[str, bytes]) -> str:
    """report.md: findings, pictures, tables."""
    results, name = data.results, data.given.name
    machine = "; ".join(data.environment[line] for line in ("date", "device", "threads", "jaxrot"))
    parts = [f"# Error against run time: {name}", f"{machine}.", *findings(data)]
    parts += [compared_sentence(data.comparison)] if data.comparison else []
    parts += ["## Pictures"] if pictures else []
    for picture in pictures:
        first_sentence = " ".join(_CAPTIONS[picture].split()).split(". ")[0].rstrip(".")
        parts += [f"![{first_sentence}]({picture})", _CAPTIONS[picture]]
    parts += ["## Errors and time", *remarks(data), _CONTRACT]
    for dtype in data.dtypes:
        parts += [*_section(accuracy_table(results, dtype, name)), faster_outside(results, dtype)]
    parts += ["## Time", _TIMES, *_sections(timing_table(results, dtype) for dtype in data.dtypes)]
    if (peers := data.peers) is not None:
        parts += ["## Peers", *verdicts(peers.contenders), *peers.skipped, _PEERS]
        parts += _sections(peers_table(peers.contenders, dtype) for dtype in data.dtypes)
        parts += _section(sources_table(peers.contenders))
    if data.warm_starts:
        parts += ["## Warm starts", _WARM_STARTS, warm_starts_finding(data.warm_starts)]
        parts += _sections(warm_starts_table(data.warm_starts, dtype) for dtype in data.dtypes)
    if (guards := data.guards) is not None:
        parts += ["## The price of every guard", GUARDS_CAPTION]
        parts += _section(guards_table(guards.default, f"The default method, {jaxrot.DEFAULT_METHOD}"))
        parts += _section(guards_table(guards.steps, "The steps"))
    if (comparison := data.comparison) is not None:
        parts += ["## Against an earlier run", compared_sentence(comparison), _COMPARED]
        parts += [*_section(times_compared_table(comparison)), *_section(errors_compared_table(comparison))]
    parts += ["## Where the contract breaks", _SETS]
    parts += _sections(sets_table(results, dtype, name) for dtype in data.dtypes)
    parts += ["## Stiff and extreme cases", ROBUSTNESS_CAPTION, *_section(robustness_table(results.accuracy))]
    parts += ["## Where this was measured", header(data.environment)]
    return "\n\n".join(part for part in parts if part) + "\n"


def as_terminal_text(data: ReportData) -> str:
    """What the command prints: header, one table for each dtype, findings."""
    parts = [columns(data.environment)]
    parts += [as_text(summary_table(data.results, dtype, data.given.name)) for dtype in data.dtypes]
    parts.append(
        "outside: matrices outside the contract; own: of these, inside the domain the method declares;\n"
        "ns: median (quartiles) per matrix"
    )
    parts += [sentence.replace("**", "") for sentence in findings(data)]
    parts += [compared_sentence(data.comparison)] if data.comparison else []
    parts += data.peers.skipped if data.peers else []
    return "\n\n".join([*parts, *remarks(data)])


def as_bench_markdown(bench: Bench, environment: Mapping[str, str]) -> str:
    """bench.md: header and table."""
    table = goals_table(bench.goals)
    parts = ["# Speed of jaxrot", header(environment), _BENCH, f"## {table.title}", as_markdown(table)]
    return "\n\n".join(parts) + "\n"


def as_bench_text(bench: Bench, environment: Mapping[str, str]) -> str:
    """What the command prints."""
    return "\n\n".join([columns(environment), as_text(goals_table(bench.goals))])


def remarks(data: ReportData) -> list[str]:
    """What the reader must know about the input and about what was left out."""
    entry = next(iter(on_input(data.results, data.dtypes[0]).values()))
    not_finite = (
        f"{entry.not_finite:,} of the {entry.matrices:,} matrices of {data.given.name} hold a NaN or an infinity in"
        f" {data.dtypes[0]}; they are timed but left out of every error."
    )
    return [*data.given.remarks, *data.results.remarks, *([not_finite] if entry.not_finite else [])]


def columns(environment: Mapping[str, str]) -> str:
    """The header for a terminal."""
    width = max(map(len, environment))
    return "\n".join(f"{name.ljust(width)}  {value}" for name, value in environment.items())


def header(environment: Mapping[str, str]) -> str:
    """The header as a list."""
    return "\n".join(f"- {name}: {value}" for name, value in environment.items())


def _section(table: Table) -> list[str]:
    return [f"### {table.title}", as_markdown(table)]


def _sections(tables: Iterable[Table]) -> list[str]:
    return [part for table in tables for part in _section(table)]

"""The report as text: Markdown to read, and what the terminal has room for."""

from collections.abc import Mapping

import jaxrot
from jaxrot.report.content import Content
from jaxrot.report.drawing import pictures as picture_names
from jaxrot.report.findings import faster_outside, findings, on_input, warm_starts_finding
from jaxrot.report.guards.tables import GUARDS_CAPTION, guards_table
from jaxrot.report.stability.maps import CONDITIONS_CAPTION, SCALES_CAPTION
from jaxrot.report.stability.survivors import SURVIVORS_CAPTION, survivors_table
from jaxrot.report.warm_starts import ANGLE_DEGREES
from jaxrot.report.writing.beside_tables import (
    compared_sentence,
    contenders_table,
    errors_compared_table,
    sources_table,
    times_compared_table,
    verdicts,
    warm_starts_table,
)
from jaxrot.report.writing.tables import (
    Table,
    accuracy_table,
    as_markdown,
    as_text,
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

_VERDICTS = """\
Matrices outside the contract: `·` none, **bold** inside the method's own domain (a broken promise), (in parentheses)
beyond it."""


_CAPTIONS = {
    picture_names.METHODS: "Every method: error against time a matrix. Below and to the left is better.",
    picture_names.PEERS: "The methods of jaxrot's front and what other packages offer, values.",
    picture_names.GRADIENTS: "The same, value and gradient together.",
    picture_names.WARM_STARTS: "Every step from a warm start: the numbers are iterations.",
    picture_names.conditions("float32"): CONDITIONS_CAPTION,
    picture_names.conditions("float64"): "The same in float64.",
    picture_names.SCALES: SCALES_CAPTION,
    picture_names.SURVIVAL: "Who survives the stiff and extreme cases; what each is, is in the table further down.",
}

_PEERS = """\
Own and other methods on the same matrices, in the same rounds, each on its own copy in its own memory. The gradient is
the cotangent of A for a random one of R, its error relative, against a wider arithmetic where κ ≤ 1/(128 eps). *No
result*: NaN, or the package refuses the matrix; its error counts as infinite, and its time is that of the matrices it
takes. Matrices that are not finite are left out. *Families with such*: how many of the families of extreme matrices
hold one whose gradient is no number. A peer is beyond jaxrot's front, and filled in the picture, where no method
measured here is as accurate, to a tenth, and as fast, within the spread."""

_WARM_STARTS = f"""\
Starts are the nearest rotation turned by {ANGLE_DEGREES:.0f}° about a random axis; the time is that of all iterations
together."""

_COMPARED = """\
A method is called slower or faster only where the quartiles of the two runs stand apart, as they are and with the
machine's share, the median of all ratios, taken out, and where its ratio stands out from those of the other methods at
that batch size, by one and a half times their interquartile range; worse where more matrices are outside the contract
or the error grew by more than a twentieth."""


def as_report_markdown(content: Content, pictures: Mapping[str, bytes]) -> str:
    """report.md: findings, pictures, tables."""
    parts = [f"# Error against run time: {content.given.name}", _machine(content), *findings(content)]
    if content.comparison is not None:
        parts.append(compared_sentence(content.comparison))
    parts += ["## Pictures"] if pictures else []
    for name in pictures:
        first_sentence = " ".join(_CAPTIONS[name].split()).split(". ")[0]
        parts += [f"![{first_sentence}]({name})", _CAPTIONS[name]]
    parts += ["## Errors and time", *remarks(content), _CONTRACT]
    for dtype in content.dtypes:
        parts += _section(accuracy_table(content.results, dtype, content.given.name))
        parts += [sentence] if (sentence := faster_outside(content.results, dtype)) else []
    parts += ["## Time", _TIMES]
    for dtype in content.dtypes:
        parts += _section(timing_table(content.results, dtype))
    if content.beside is not None:
        parts += ["## Peers", *verdicts(content.beside.contenders), *content.beside.skipped, _PEERS]
        for dtype in content.dtypes:
            parts += _section(contenders_table(content.beside.contenders, dtype))
        parts += _section(sources_table(content.beside.contenders))
    if content.warm_starts:
        parts += ["## Warm starts", _WARM_STARTS, warm_starts_finding(content.warm_starts)]
        for dtype in content.dtypes:
            parts += _section(warm_starts_table(content.warm_starts, dtype))
    if content.guards is not None:
        parts += ["## The price of every guard", GUARDS_CAPTION]
        parts += _section(guards_table(content.guards.default, f"The default method, {jaxrot.DEFAULT_METHOD}"))
        parts += _section(guards_table(content.guards.steps, "The steps"))
    if content.comparison is not None:
        parts += ["## Against an earlier run", compared_sentence(content.comparison), _COMPARED]
        for table in (times_compared_table(content.comparison), errors_compared_table(content.comparison)):
            parts += _section(table)
    parts += ["## Where the contract breaks", _VERDICTS]
    for dtype in content.dtypes:
        parts += _section(sets_table(content.results, dtype, "input", content.given.name))
    parts += ["## Stiff and extreme cases", SURVIVORS_CAPTION, *_section(survivors_table(content.results.accuracy))]
    parts += ["## Where this was measured", header(content.environment)]
    return "\n\n".join(parts) + "\n"


def as_terminal_text(content: Content) -> str:
    """What the command prints: header, one table a dtype, findings."""
    parts = [columns(content.environment)]
    parts += [as_text(summary_table(content.results, dtype, content.given.name)) for dtype in content.dtypes]
    parts.append(
        "outside: matrices outside the contract; own: of these, inside the domain the method declares;\n"
        "ns: median (quartiles) a matrix"
    )
    parts += [paragraph.replace("**", "") for paragraph in findings(content)]
    if content.comparison is not None:
        parts.append(compared_sentence(content.comparison))
    if content.beside is not None:
        parts += content.beside.skipped
    return "\n\n".join([*parts, *remarks(content)])


def remarks(content: Content) -> list[str]:
    """What the reader must know about the input and about what was left out."""
    entry = next(iter(on_input(content.results, content.dtypes[0]).values()))
    not_finite = (
        f"{entry.not_finite:,} of the {entry.matrices:,} matrices of {content.given.name} hold a NaN or an infinity in"
        f" {content.dtypes[0]}; they are timed but left out of every error."
    )
    return [*content.given.remarks, *content.results.remarks, *([not_finite] if entry.not_finite else [])]


def columns(environment: Mapping[str, str]) -> str:
    """The header's lines for a terminal."""
    width = max(map(len, environment))
    return "\n".join(f"{name.ljust(width)}  {value}" for name, value in environment.items())


def header(environment: Mapping[str, str]) -> str:
    """The header's lines as a list."""
    return "\n".join(f"- {name}: {value}" for name, value in environment.items())


def _machine(content: Content) -> str:
    names = ("date", "device", "threads", "jaxrot")
    return "; ".join(content.environment[name] for name in names) + "."


def _section(table: Table) -> list[str]:
    return [f"### {table.title}", as_markdown(table)]

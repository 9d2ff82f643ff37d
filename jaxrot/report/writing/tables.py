"""The report's tables, as rows of words; how they are set is the caller's."""

from typing import NamedTuple

import jaxrot
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.domain import describe_domain
from jaxrot.evaluation.formatting import number
from jaxrot.evaluation.timing import Timing
from jaxrot.report.bench import Goal
from jaxrot.report.findings import on_input, times_at_largest_batch
from jaxrot.report.measurement import WHOLE, Results


class Table(NamedTuple):
    """A table of words.

    Attributes:
        title: What it shows.
        header: One word or a few for each column.
        rows: As many words each.
    """

    title: str
    header: list[str]
    rows: list[list[str]]


def as_text(table: Table) -> str:
    """The table for a terminal: the first column to the left, numbers to the right."""
    lines = [table.header, *table.rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(table.header))]
    is_number = [all(_is_number(row[column]) for row in table.rows) for column in range(len(table.header))]
    set_lines = [
        "  ".join(
            word.rjust(width) if right else word.ljust(width)
            for word, width, right in zip(line, widths, is_number, strict=True)
        ).rstrip()
        for line in lines
    ]
    rule = "  ".join("-" * width for width in widths)
    return "\n".join([table.title, "", set_lines[0], rule, *set_lines[1:]])


def as_markdown(table: Table) -> str:
    """The table as Markdown, without its title."""
    is_number = [all(_is_number(row[column]) for row in table.rows) for column in range(len(table.header))]
    rule = ["---:" if right else ":---" for right in is_number]
    return "\n".join(f"| {' | '.join(line)} |" for line in [table.header, rule, *table.rows])


def _is_number(word: str) -> bool:
    return word[:1].isdigit() or word[:1] in "-∞·(*"


def nanoseconds(timing: Timing) -> str:
    """Median and quartiles."""
    return f"{number(timing.median_ns)} ({number(timing.quartile_1_ns)}-{number(timing.quartile_3_ns)})"


def summary_table(results: Results, dtype: str, input_name: str) -> Table:
    """What a terminal has room for: each method's domain, error and time on the whole input, the fastest first."""
    times, accuracy = times_at_largest_batch(results, dtype), on_input(results, dtype)
    batch = next(iter(times.values())).batch
    header = ["method", "domain", "median error", "max / eps(1+κ)", "outside", "own", f"ns at {batch:,}", "compile s"]
    rows = []
    for name, time in times.items():
        entry = accuracy[name]
        rows.append(
            [
                name,
                describe_domain(jaxrot.METHODS[name], dtype),
                number(entry.forward_median),
                number(entry.forward_units_max),
                f"{entry.outside:,}",
                _own(entry),
                nanoseconds(time),
                number(time.compile_s),
            ]
        )
    count = next(iter(accuracy.values())).matrices
    return Table(f"{input_name}: {count:,} matrices, {dtype}", header, rows)


def accuracy_table(results: Results, dtype: str, input_name: str) -> Table:
    """Every error on the whole input, with the time beside it, the fastest first."""
    times, accuracy = times_at_largest_batch(results, dtype), on_input(results, dtype)
    batch = next(iter(times.values())).batch
    header = ["method", "domain", "error, median", "error, 99 %", "error, max", "per eps(1+κ), median"]
    header += ["per eps(1+κ), max", "orthogonality / eps", "lost trace / eps s1", "torque / eps s1"]
    header += ["outside contract", "outside own domain", f"ns a matrix at {batch:,}"]
    rows = []
    for name, time in times.items():
        entry = accuracy[name]
        errors = [entry.forward_median, entry.forward_99th, entry.forward_max, entry.forward_units_median]
        errors += [entry.forward_units_max, entry.orthogonality_max, entry.lost_trace_max, entry.torque_max]
        words = [name, describe_domain(jaxrot.METHODS[name], dtype), *map(number, errors)]
        rows.append([*words, f"{entry.outside:,}", _own(entry), number(time.median_ns)])
    return Table(f"Errors on {input_name}, {dtype}", header, rows)


def timing_table(results: Results, dtype: str) -> Table:
    """Time a matrix at every batch size: median and quartiles; and the seconds to compile."""
    times = times_at_largest_batch(results, dtype)
    batches = sorted({entry.batch for entry in results.timing if entry.dtype == dtype})
    by_key = {(entry.method, entry.batch): entry for entry in results.timing if entry.dtype == dtype}
    rows = [
        [name, *(nanoseconds(by_key[name, batch]) for batch in batches), number(times[name].compile_s)]
        for name in times
    ]
    header = ["method", *(f"batch {batch:,}" for batch in batches), "compile s"]
    return Table(f"ns a matrix, {dtype}", header, rows)


def sets_table(results: Results, dtype: str, group: str, title: str) -> Table:
    """How many matrices of each set every method leaves outside the contract."""
    names = list(times_at_largest_batch(results, dtype))
    entries = {
        (entry.set_name, entry.method): entry
        for entry in results.accuracy
        if entry.dtype == dtype and entry.group == group and not (group == "input" and entry.set_name == WHOLE)
    }
    sets = list(dict.fromkeys(set_name for set_name, _ in entries))
    rows = [
        [set_name, f"{entries[set_name, names[0]].matrices:,}", *(_verdict(entries[set_name, name]) for name in names)]
        for set_name in sets
    ]
    return Table(f"{title}, {dtype}", ["set", "matrices", *names], rows)


def _own(entry: Accuracy) -> str:
    """Broken promises, of promises; a dash where the method promises nothing."""
    return f"{entry.outside_in_domain:,} of {entry.in_domain:,}" if entry.in_domain else "-"


def _verdict(entry: Accuracy) -> str:
    if entry.outside == 0:
        return "·"
    if entry.outside_in_domain == 0:
        return f"({entry.outside:,})"
    beyond = entry.outside - entry.outside_in_domain
    return f"**{entry.outside_in_domain:,}**" + (f" ({beyond:,})" if beyond else "")


def goals_table(goals: list[Goal]) -> Table:
    """The goals as a table of words."""
    rows = [
        [
            goal.what,
            f"{goal.batch:,}",
            number(goal.median),
            f"{number(goal.quartile_1)}-{number(goal.quartile_3)}",
            ("≥ " if goal.at_least else "≤ ") + number(goal.bound),
            "yes" if goal.is_met else "no",
        ]
        for goal in goals
    ]
    return Table("Speed", ["what", "batch", "median", "quartiles", "goal", "met"], rows)

"""Tables of the methods' errors and times, and of the speed goals."""

from collections.abc import Sequence

import jaxrot
from jaxrot.console.tables import Table, tabulate
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.domain import describe_domain
from jaxrot.evaluation.formatting import number
from jaxrot.evaluation.timing import Timing
from jaxrot.report.inputs import WHOLE
from jaxrot.report.measure.bench import Goal
from jaxrot.report.measure.results import Results, Spread, on_input, times_at_largest_batch


def spread_text(time: Spread | None) -> str:
    """Median and quartiles."""
    return "-" if time is None else f"{number(time.median)} ({number(time.quartile_1)}-{number(time.quartile_3)})"


def summary_table(results: Results, dtype: str, input_name: str) -> Table:
    """What a terminal has room for: domain, error and time of each method on the whole input, the fastest first."""
    entries = _errors_and_times(results, dtype)
    accuracy, time = entries[0]
    return tabulate(
        f"{input_name}: {accuracy.matrices:,} matrices, {dtype}",
        entries,
        {
            "method": lambda entry: entry[0].method,
            "domain": lambda entry: describe_domain(jaxrot.METHODS[entry[0].method], dtype),
            "median error": lambda entry: number(entry[0].forward_median),
            "max / eps(1+κ)": lambda entry: number(entry[0].forward_units_max),
            "outside": lambda entry: f"{entry[0].outside:,}",
            "own": lambda entry: _own(entry[0]),
            f"ns at {time.batch:,}": lambda entry: _timing_text(entry[1]),
            "compile s": lambda entry: number(entry[1].compile_s),
        },
    )


def accuracy_table(results: Results, dtype: str, input_name: str) -> Table:
    """All errors of each method on the whole input, the fastest first."""
    entries = _errors_and_times(results, dtype)
    return tabulate(
        f"Errors on {input_name}, {dtype}",
        entries,
        {
            "method": lambda entry: entry[0].method,
            "domain": lambda entry: describe_domain(jaxrot.METHODS[entry[0].method], dtype),
            "error, median": lambda entry: number(entry[0].forward_median),
            "error, 99 %": lambda entry: number(entry[0].forward_99th),
            "error, max": lambda entry: number(entry[0].forward_max),
            "per eps(1+κ), median": lambda entry: number(entry[0].forward_units_median),
            "per eps(1+κ), max": lambda entry: number(entry[0].forward_units_max),
            "orthogonality / eps": lambda entry: number(entry[0].orthogonality_max),
            "lost trace / eps s1": lambda entry: number(entry[0].lost_trace_max),
            "torque / eps s1": lambda entry: number(entry[0].torque_max),
            "outside contract": lambda entry: f"{entry[0].outside:,}",
            "outside own domain": lambda entry: _own(entry[0]),
            f"ns per matrix at {entries[0][1].batch:,}": lambda entry: number(entry[1].median_ns),
        },
    )


def _errors_and_times(results: Results, dtype: str) -> list[tuple[Accuracy, Timing]]:
    accuracy = on_input(results, dtype)
    return [(accuracy[name], time) for name, time in times_at_largest_batch(results, dtype).items()]


def timing_table(results: Results, dtype: str) -> Table:
    """Time per matrix at every batch size, and the seconds to compile."""
    times = times_at_largest_batch(results, dtype)
    batches = sorted({entry.batch for entry in results.timing if entry.dtype == dtype})
    by_key = {(entry.method, entry.batch): entry for entry in results.timing if entry.dtype == dtype}
    rows = [
        [name, *(_timing_text(by_key[name, batch]) for batch in batches), number(time.compile_s)]
        for name, time in times.items()
    ]
    return Table(f"ns per matrix, {dtype}", ["method", *(f"batch {batch:,}" for batch in batches), "compile s"], rows)


def sets_table(results: Results, dtype: str, title: str) -> Table:
    """The number of matrices outside the contract, for each set of the input and each method."""
    names = list(times_at_largest_batch(results, dtype))
    entries = {
        (entry.set_name, entry.method): entry
        for entry in results.accuracy
        if entry.dtype == dtype and entry.group == "input" and entry.set_name != WHOLE
    }
    rows = [
        [set_name, f"{entries[set_name, names[0]].matrices:,}", *(_outside(entries[set_name, name]) for name in names)]
        for set_name in dict.fromkeys(set_name for set_name, _ in entries)
    ]
    return Table(f"{title}, {dtype}", ["set", "matrices", *names], rows)


def goals_table(goals: Sequence[Goal]) -> Table:
    """The speed goals, and whether each is met."""
    return tabulate(
        "Speed",
        goals,
        {
            "what": lambda goal: goal.what,
            "batch": lambda goal: f"{goal.batch:,}",
            "median": lambda goal: number(goal.median),
            "quartiles": lambda goal: f"{number(goal.quartile_1)}-{number(goal.quartile_3)}",
            "goal": lambda goal: ("≥ " if goal.at_least else "≤ ") + number(goal.bound),
            "met": lambda goal: "yes" if goal.is_met else "no",
        },
    )


def _timing_text(timing: Timing) -> str:
    return spread_text(Spread(timing.median_ns, timing.quartile_1_ns, timing.quartile_3_ns))


def _own(entry: Accuracy) -> str:
    """Broken promises of all promises; a dash if the method promises nothing."""
    return f"{entry.outside_in_domain:,} of {entry.in_domain:,}" if entry.in_domain else "-"


def _outside(entry: Accuracy) -> str:
    beyond = entry.outside - entry.outside_in_domain
    texts = [f"**{entry.outside_in_domain:,}**"] * bool(entry.outside_in_domain) + [f"({beyond:,})"] * bool(beyond)
    return " ".join(texts) or "·"

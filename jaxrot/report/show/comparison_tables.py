"""Tables that compare: jaxrot with its peers, the steps from a warm start, and two runs."""

import math
from collections.abc import Sequence

from jaxrot.console.tables import Table, tabulate
from jaxrot.evaluation.formatting import number
from jaxrot.report.comparison import Comparison
from jaxrot.report.measure.front import beyond_front
from jaxrot.report.measure.peer_comparison import ComparedMethod
from jaxrot.report.measure.results import Quantiles
from jaxrot.report.measure.warm_starts import WarmStart
from jaxrot.report.show.tables import spread_text


def peers_table(compared: Sequence[ComparedMethod], dtype: str) -> Table:
    """Error and time of value and gradient: jaxrot's methods first, then the peers, each the fastest first."""

    def order(entry: ComparedMethod) -> tuple[bool, float]:
        return not entry.is_own, entry.time.median if entry.time else math.inf

    def of_gradient(entry: ComparedMethod, count: int) -> str:
        return "-" if entry.gradient_time is None else f"{count:,}"

    return tabulate(
        f"jaxrot and its peers, {dtype}",
        sorted((entry for entry in compared if entry.dtype == dtype), key=order),
        {
            "method": lambda entry: entry.name,
            "threads": lambda entry: str(entry.threads),
            "computes in": lambda entry: entry.computes_in,
            "batch": lambda entry: f"{entry.batch:,}",
            "error, median / 99 %": lambda entry: _pair(entry.error),
            "no result": lambda entry: f"{entry.no_result:,}",
            "outside contract": lambda entry: f"{entry.outside:,}",
            "ns per matrix": lambda entry: spread_text(entry.time),
            "gradient's error, median / 99 %": lambda entry: _pair(entry.gradient_error),
            "gradient not finite": lambda entry: of_gradient(entry, entry.gradient_no_number),
            "families with such": lambda entry: of_gradient(entry, len(entry.families_no_number)),
            "ns with gradient": lambda entry: spread_text(entry.gradient_time),
        },
    )


def sources_table(compared: Sequence[ComparedMethod]) -> Table:
    """A description of each method and peer."""
    described = {entry.name: entry.description for entry in compared}
    return Table("What they are", ["method", "what it is"], [[name, text] for name, text in described.items()])


def verdicts(compared: Sequence[ComparedMethod]) -> list[str]:
    """One sentence for every peer that no method of jaxrot beats."""
    return [
        f"**{entry.name} in {entry.dtype} is beyond jaxrot's front for {what}**: no method of jaxrot that was measured"
        " here is as accurate in as short a time."
        for what, of_gradients in (("values", False), ("gradients", True))
        for entry in beyond_front(compared, of_gradients=of_gradients)
    ]


def warm_starts_table(entries: Sequence[WarmStart], dtype: str) -> Table:
    """Error and time of every step and number of iterations, the fastest first."""
    return tabulate(
        f"Warm starts, {dtype}",
        sorted((entry for entry in entries if entry.dtype == dtype), key=lambda entry: entry.time.median),
        {
            "step": lambda entry: entry.step,
            "iterations": lambda entry: f"{entry.iterations}",
            "error, median": lambda entry: number(entry.error.median),
            "error, 99 %": lambda entry: number(entry.error.percentile_99),
            "error, max": lambda entry: number(entry.error.largest),
            "ns per matrix": lambda entry: spread_text(entry.time),
        },
    )


def times_compared_table(comparison: Comparison) -> Table:
    """The times of two runs, the largest ratio first."""
    return tabulate(
        "Times, then and now",
        sorted(comparison.times, key=lambda change: -change.ratio),
        {
            "method": lambda change: change.method,
            "dtype": lambda change: change.dtype,
            "batch": lambda change: f"{change.batch:,}",
            "ns then": lambda change: number(change.before_ns),
            "ns now": lambda change: number(change.now_ns),
            "ratio": lambda change: number(change.ratio),
            "without the machine's share": lambda change: number(change.relative),
            "verdict": lambda change: _emphasised(change.verdict),
        },
    )


def errors_compared_table(comparison: Comparison) -> Table:
    """The errors of two runs."""
    return tabulate(
        "Errors, then and now",
        comparison.errors,
        {
            "method": lambda change: change.method,
            "dtype": lambda change: change.dtype,
            "99 % error then": lambda change: number(change.before),
            "99 % error now": lambda change: number(change.now),
            "outside contract then": lambda change: f"{change.outside_before:,}",
            "outside contract now": lambda change: f"{change.outside_now:,}",
            "verdict": lambda change: _emphasised(change.verdict),
        },
    )


def compared_sentence(comparison: Comparison) -> str:
    """The summary of a comparison, in a sentence."""
    slower = [
        f"{change.method} ({change.dtype}, batch {change.batch:,}: {change.ratio:.2f})"
        for change in comparison.times
        if change.verdict == "slower"
    ]
    faster = sum(change.verdict == "faster" for change in comparison.times)
    worse = [f"{change.method} ({change.dtype})" for change in comparison.errors if change.verdict == "worse"]
    parts = []
    if comparison.times:
        parts.append(f"the machine's share in all times is {comparison.machine:.2f}")
        parts += [f"slower: {', '.join(slower) or 'none'}", f"faster: {faster}"]
    if comparison.errors:
        parts.append(f"less accurate: {', '.join(worse) or 'none'}")
    date, version = (comparison.environment.get(name, f"no {name}") for name in ("date", "jaxrot"))
    head = f"Against {comparison.name} ({date}, {version})"
    return " ".join([f"{head}: {'; '.join(parts) or 'nothing to compare'}.", *comparison.remarks])


def _emphasised(verdict: str) -> str:
    return f"**{verdict}**" if verdict in ("slower", "worse") else verdict


def _pair(error: Quantiles | None) -> str:
    return "-" if error is None else f"{number(error.median)} / {number(error.percentile_99)}"

"""Tables of what stands beside each other: jaxrot and its peers, the steps from a warm start, this run and another."""

import math
from collections.abc import Sequence

from jaxrot.evaluation.formatting import number
from jaxrot.report.comparison import Comparison
from jaxrot.report.contenders import Contender, Quantiles, Spread, beyond_front
from jaxrot.report.warm_starts import WarmStart
from jaxrot.report.writing.tables import Table


def contenders_table(contenders: Sequence[Contender], dtype: str) -> Table:
    """Error and time of value and gradient, jaxrot's first, the fastest first."""
    header = ["method", "threads", "computes in", "batch", "error, median / 99 %", "no result", "outside contract"]
    header += ["ns a matrix", "gradient's error, median / 99 %", "gradient no number", "families with such"]
    header += ["ns with gradient"]
    rows = []
    for contender in sorted(
        (contender for contender in contenders if contender.dtype == dtype),
        key=lambda contender: (not contender.is_own, contender.time.median if contender.time else math.inf),
    ):
        has_gradient = contender.gradient_time is not None
        rows.append(
            [
                contender.name,
                str(contender.threads),
                contender.computes_in,
                f"{contender.batch:,}",
                _pair(contender.error),
                f"{contender.no_result:,}",
                f"{contender.outside:,}",
                _time(contender.time),
                _pair(contender.gradient_error),
                f"{contender.gradient_no_number:,}" if has_gradient else "-",
                f"{len(contender.families_no_number):,}" if has_gradient else "-",
                _time(contender.gradient_time),
            ]
        )
    return Table(f"jaxrot and its peers, {dtype}", header, rows)


def sources_table(contenders: Sequence[Contender]) -> Table:
    """What each of them is."""
    described = {contender.name: contender.description for contender in contenders}
    return Table("What they are", ["method", "what it is"], [[name, words] for name, words in described.items()])


def verdicts(contenders: Sequence[Contender]) -> list[str]:
    """One sentence for every peer that no method of jaxrot's beats."""
    sentences = []
    for what, of_gradients in (("values", False), ("gradients", True)):
        for contender in beyond_front(contenders, of_gradients=of_gradients):
            sentences.append(
                f"**{contender.name} in {contender.dtype} lies beyond jaxrot's front for {what}**: no method of"
                " jaxrot's measured here is as accurate in as short a time."
            )
    return sentences


def warm_starts_table(entries: Sequence[WarmStart], dtype: str) -> Table:
    """Every step and number of iterations, by time."""
    rows = [
        [
            entry.step,
            f"{entry.iterations}",
            number(entry.error.median),
            number(entry.error.percentile_99),
            number(entry.error.largest),
            _time(entry.time),
        ]
        for entry in sorted(entries, key=lambda entry: entry.time.median)
        if entry.dtype == dtype
    ]
    header = ["step", "iterations", "error, median", "error, 99 %", "error, max", "ns a matrix"]
    return Table(f"Warm starts, {dtype}", header, rows)


def times_compared_table(comparison: Comparison) -> Table:
    """Times then and now, the worst ratio first."""
    rows = [
        [
            change.method,
            change.dtype,
            f"{change.batch:,}",
            number(change.before_ns),
            number(change.now_ns),
            number(change.ratio),
            number(change.relative),
            f"**{change.verdict}**" if change.verdict == "slower" else change.verdict,
        ]
        for change in sorted(comparison.times, key=lambda change: -change.ratio)
    ]
    header = ["method", "dtype", "batch", "ns then", "ns now", "ratio", "without the machine's share", "verdict"]
    return Table("Times, then and now", header, rows)


def errors_compared_table(comparison: Comparison) -> Table:
    """Errors then and now."""
    rows = [
        [
            change.method,
            change.dtype,
            number(change.before),
            number(change.now),
            f"{change.outside_before:,}",
            f"{change.outside_now:,}",
            f"**{change.verdict}**" if change.verdict == "worse" else change.verdict,
        ]
        for change in comparison.errors
    ]
    header = ["method", "dtype", "99 % error then", "now", "outside contract then", "now", "verdict"]
    return Table("Errors, then and now", header, rows)


def compared_sentence(comparison: Comparison) -> str:
    """What changed, in a sentence."""
    slower = [
        f"{c.method} ({c.dtype}, batch {c.batch:,}: {c.ratio:.2f})" for c in comparison.times if c.verdict == "slower"
    ]
    faster = sum(change.verdict == "faster" for change in comparison.times)
    worse = [f"{change.method} ({change.dtype})" for change in comparison.errors if change.verdict == "worse"]
    environment = comparison.environment
    clauses = []
    if comparison.times:
        clauses.append(f"the machine's share in all times is {comparison.machine:.2f}")
        clauses += [f"slower: {', '.join(slower) or 'none'}", f"faster: {faster}"]
    if comparison.errors:
        clauses.append(f"less accurate: {', '.join(worse) or 'none'}")
    head = (
        f"Against {comparison.name} ({environment.get('date', 'no date')}, {environment.get('jaxrot', 'no version')})"
    )
    return " ".join([f"{head}: {'; '.join(clauses) or 'nothing to compare'}.", *comparison.remarks])


def _pair(error: Quantiles | None) -> str:
    return "-" if error is None else f"{number(error.median)} / {number(error.percentile_99)}"


def _time(time: Spread | None) -> str:
    return "-" if time is None else f"{number(time.median)} ({number(time.quartile_1)}-{number(time.quartile_3)})"

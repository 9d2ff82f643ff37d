"""What the numbers say, in sentences computed from them."""

from collections.abc import Sequence

import jaxrot
from jaxrot.measuring.accuracy import Accuracy
from jaxrot.measuring.timing import Timing
from jaxrot.measuring.words import listed, number
from jaxrot.report.measurement import WHOLE, Results

CONTROL = "svd"


def largest_batch(timing: Sequence[Timing]) -> int:
    """The largest batch size timed in every dtype, so that dtypes can be compared."""
    by_dtype: dict[str, set[int]] = {}
    for entry in timing:
        by_dtype.setdefault(entry.dtype, set()).add(entry.batch)
    return max(set.intersection(*by_dtype.values()))


def times_at_largest_batch(results: Results, dtype: str) -> dict[str, Timing]:
    """The timing of every method in a dtype at the largest batch, by the method's name, the fastest first."""
    batch = largest_batch(results.timing)
    entries = [entry for entry in results.timing if entry.dtype == dtype and entry.batch == batch]
    return {entry.method: entry for entry in sorted(entries, key=lambda entry: entry.median_ns)}


def on_input(results: Results, dtype: str) -> dict[str, Accuracy]:
    """The accuracy of every method on the whole input, by the method's name."""
    return {
        entry.method: entry
        for entry in results.accuracy
        if entry.dtype == dtype and entry.group == "input" and entry.set_name == WHOLE
    }


def findings(results: Results, dtypes: Sequence[str], input_name: str) -> list[str]:
    """The paragraphs that open the report, the most useful first."""
    paragraphs = [_fastest(results, dtype, input_name) for dtype in dtypes]
    paragraphs.append(_broken_promises(results))
    counted = on_input(results, dtypes[0])
    first = next(iter(counted.values()))
    if first.not_finite:
        paragraphs.append(
            f"{first.not_finite:,} of the {first.matrices:,} matrices of {input_name} hold a NaN or an infinity in"
            f" {dtypes[0]}; they are timed but left out of every error."
        )
    return paragraphs


def _fastest(results: Results, dtype: str, input_name: str) -> str:
    times = times_at_largest_batch(results, dtype)
    accuracy = on_input(results, dtype)
    count = next(iter(accuracy.values())).matrices
    keeping = [name for name in times if accuracy[name].outside == 0]
    if not keeping:
        best = min(accuracy.values(), key=lambda entry: entry.outside)
        return (
            f"In {dtype} no method measured keeps the contract on all {count:,} matrices of {input_name};"
            f" {best.method} comes closest, outside it on {best.outside:,}."
        )
    chosen = times[keeping[0]]
    text = (
        f"In {dtype} the fastest method that keeps the contract on all {count:,} matrices of {input_name} is"
        f" **{chosen.method}**: {number(chosen.median_ns)} ns a matrix at batch {chosen.batch:,}"
        f"{_against_control(times, chosen)}."
    )
    faster = [name for name in times if times[name].quartile_3_ns < chosen.quartile_1_ns]
    if faster:
        beaten_by = ", ".join(
            f"{name} ({number(times[name].median_ns)} ns, outside on {accuracy[name].outside:,})" for name in faster
        )
        text += f" Faster, but not within the contract here: {beaten_by}."
    return text


def _against_control(times: dict[str, Timing], chosen: Timing) -> str:
    """How it compares with the singular value decomposition; a difference within the spread is none."""
    control = times.get(CONTROL)
    if control is None or chosen.method == CONTROL:
        return ""
    if chosen.quartile_3_ns < control.quartile_1_ns:
        return f", {control.median_ns / chosen.median_ns:.2g} times faster than {CONTROL}"
    return f", within the spread of {CONTROL}"


def _broken_promises(results: Results) -> str:
    broken: dict[str, int] = {}
    for entry in results.accuracy:
        # The input's parts are in the whole.
        if entry.group != "input" or entry.set_name == WHOLE:
            broken[entry.method] = broken.get(entry.method, 0) + entry.outside_in_domain
    promising = [name for name in broken if any(jaxrot.METHODS[name].condition_limit.values())]
    text = "Input and families together: "
    failed = [f"{name} on {broken[name]:,}" for name in promising if broken[name]]
    kept = [name for name in promising if not broken[name]]
    if kept:
        text += f"{listed(kept)} {'keeps' if len(kept) == 1 else 'keep'} the contract everywhere in the declared domain"
    if failed:
        text += f"{'; ' if kept else ''}broken inside the declared domain: {', '.join(failed)}"
    without = [name for name in broken if name not in promising]
    if without:
        verb = "declares" if len(without) == 1 else "declare"
        text += (
            f"{'; ' if kept or failed else ''}{listed(without)} {verb} no domain in which the whole contract is kept"
        )
    return text + "."

"""The three sentences that open the report, computed from the results."""

from collections.abc import Sequence

import jaxrot
from jaxrot.evaluation.formatting import number
from jaxrot.evaluation.timing import Timing
from jaxrot.report.data import ReportData
from jaxrot.report.inputs import WHOLE
from jaxrot.report.measure.front import beyond_front, placed
from jaxrot.report.measure.peer_comparison import ComparedMethod, PeerComparison
from jaxrot.report.measure.results import Results, on_input, times_at_largest_batch
from jaxrot.report.measure.warm_starts import ANGLE_DEGREES, COLD_START, PAPER, WarmStart

CONTROL = "svd"


def findings(data: ReportData) -> list[str]:
    """The sentences that open the report: the best method, its rivals, and where promises break."""
    second = warm_starts_finding(data.warm_starts) if data.peers is None else _peers(data.peers)
    sentences = [_fastest(data), second, _promises(data.results)]
    return [sentence for sentence in sentences if sentence]


def faster_outside(results: Results, dtype: str) -> str:
    """The methods that are faster than the fastest one within the contract, and how many matrices they miss."""
    times, accuracy = times_at_largest_batch(results, dtype), on_input(results, dtype)
    within = [name for name in times if accuracy[name].outside == 0]
    faster = [
        f"{name} ({number(time.median_ns)} ns, outside on {accuracy[name].outside:,})"
        for name, time in times.items()
        if within and time.quartile_3_ns < times[within[0]].quartile_1_ns
    ]
    return f"Faster in {dtype}, but not within the contract here: {', '.join(faster)}." if faster else ""


def _fastest(data: ReportData) -> str:
    parts = []
    for dtype in data.dtypes:
        times, accuracy = times_at_largest_batch(data.results, dtype), on_input(data.results, dtype)
        chosen = next((time for name, time in times.items() if accuracy[name].outside == 0), None)
        if chosen is None:
            closest = min(accuracy.values(), key=lambda entry: entry.outside)
            parts.append(f"none in {dtype} ({closest.method} comes closest, outside on {closest.outside:,})")
        else:
            time = f"{number(chosen.median_ns)} ns per matrix at batch {chosen.batch:,}"
            parts.append(f"**{chosen.method}** in {dtype}, {time}{_against_control(times.get(CONTROL), chosen)}")
    count = sum(data.given.counts.values())
    return (
        f"Fastest method that keeps the contract on all matrices of {data.given.name} ({count:,}): {'; '.join(parts)}."
    )


def _against_control(control: Timing | None, chosen: Timing) -> str:
    """The comparison with the singular value decomposition, if the times differ by more than their spread."""
    if control is None or chosen.method == CONTROL:
        return ""
    if chosen.quartile_3_ns < control.quartile_1_ns:
        return f", {control.median_ns / chosen.median_ns:.2g} times faster than {CONTROL}"
    if control.quartile_3_ns < chosen.quartile_1_ns:
        return f", {chosen.median_ns / control.median_ns:.2g} times slower than {CONTROL}, which breaks the contract"
    return f", within the spread of {CONTROL}"


def _peers(comparison: PeerComparison) -> str:
    compared, parts = comparison.contenders, []
    for what, of_gradients in (("values", False), ("gradients", True)):
        beyond = [f"{entry.name} in {entry.dtype}" for entry in beyond_front(compared, of_gradients=of_gradients)]
        if beyond:
            parts.append(f"beyond jaxrot's front for {what}: **{', '.join(beyond)}**")
        elif any(placed(entry, of_gradients=of_gradients) for entry in compared if not entry.is_own):
            fastest = _fastest_peers(compared, of_gradients)
            parts.append(f"none beyond jaxrot's front for {what}" + (f" (fastest: {fastest})" if fastest else ""))
    return f"Peers: {'; '.join(parts) or 'no error of theirs could be judged here'}."


def _fastest_peers(compared: Sequence[ComparedMethod], of_gradients: bool) -> str:
    """The fastest peer in each dtype, compared with the default method."""
    parts = []
    for dtype in dict.fromkeys(entry.dtype for entry in compared):
        places = [(entry, placed(entry, of_gradients=of_gradients)) for entry in compared if entry.dtype == dtype]
        times = [(entry, place[1]) for entry, place in places if place is not None]
        default = next((time for entry, time in times if entry.name == jaxrot.DEFAULT_METHOD), None)
        peers = [(entry, time) for entry, time in times if not entry.is_own]
        if default is None or not peers:
            continue
        fastest, time = min(peers, key=lambda pair: pair[1].median)
        relation = f"within the spread of {jaxrot.DEFAULT_METHOD}"
        if default.quartile_3 < time.quartile_1 or time.quartile_3 < default.quartile_1:
            relation = f"{time.median / default.median:.2g} times the time of {jaxrot.DEFAULT_METHOD}"
        parts.append(f"{fastest.name} in {dtype}, {relation}")
    return "; ".join(parts)


def warm_starts_finding(entries: Sequence[WarmStart]) -> str:
    """The cheapest number of iterations that is as accurate as the cold start, in each dtype."""
    parts = []
    for dtype in dict.fromkeys(entry.dtype for entry in entries):
        of_dtype = [entry for entry in entries if entry.dtype == dtype and entry.step != PAPER]
        cold = next((entry for entry in of_dtype if entry.step == COLD_START), None)
        if cold is None:
            continue
        accurate = [e for e in of_dtype if e != cold and e.error.percentile_99 <= 2 * cold.error.percentile_99]
        if not accurate:
            parts.append(f"none in {dtype}")
            continue
        best = min(accurate, key=lambda entry: entry.time.median)
        if best.time.quartile_3 < cold.time.quartile_1:
            relation = f"{best.time.median / cold.time.median:.2g} times the time of the cold start"
        else:
            relation = "not faster than the cold start, by the spread"
        parts.append(f"{best.step} with iterations={best.iterations} in {dtype}, {relation}")
    head = f"Fastest step, from starts {ANGLE_DEGREES:.0f}° off, with at most twice the error of the cold start"
    return f"{head}: {'; '.join(parts)}." if parts else ""


def _promises(results: Results) -> str:
    broken: dict[str, int] = {}
    for entry in results.accuracy:
        # The whole input includes the other sets of the input.
        if entry.group != "input" or entry.set_name == WHOLE:
            broken[entry.method] = broken.get(entry.method, 0) + entry.outside_in_domain
    promising = [name for name in broken if any(jaxrot.METHODS[name].condition_limit.values())]
    others = [name for name in broken if name not in promising]
    lists = {
        "kept by": [name for name in promising if not broken[name]],
        "broken by": [f"{name} on {broken[name]:,} matrices" for name in promising if broken[name]],
        "no such domain declared by": others if len(others) < 4 else [f"{len(others)} others"],
    }
    parts = [f"{verb} {', '.join(names)}" for verb, names in lists.items() if names]
    return f"Contract on the input and the families, inside the domain that each method declares: {'; '.join(parts)}."

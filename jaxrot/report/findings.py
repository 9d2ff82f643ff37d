"""What the numbers say: the three sentences that open the report, computed from them."""

from collections.abc import Sequence

import jaxrot
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.formatting import listed, number
from jaxrot.evaluation.timing import Timing
from jaxrot.report.contenders import Beside, Contender, Spread, beyond_front
from jaxrot.report.content import Content
from jaxrot.report.measurement import WHOLE, Results
from jaxrot.report.warm_starts import ANGLE_DEGREES, COLD_START, PAPER, WarmStart

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


def findings(content: Content) -> list[str]:
    """The sentences that open the report: which method, against whom, and where promises break."""
    second = _peers(content.beside) if content.beside is not None else warm_starts_finding(content.warm_starts)
    sentences = [_fastest(content.results, content.dtypes, content.given.name), second]
    return [sentence for sentence in [*sentences, _promises(content.results)] if sentence]


def faster_outside(results: Results, dtype: str) -> str:
    """Which methods are faster than the fastest one within the contract, and on how much of the input outside it."""
    times, accuracy = times_at_largest_batch(results, dtype), on_input(results, dtype)
    keeping = [name for name in times if accuracy[name].outside == 0]
    faster = [name for name in times if keeping and times[name].quartile_3_ns < times[keeping[0]].quartile_1_ns]
    words = [f"{name} ({number(times[name].median_ns)} ns, outside on {accuracy[name].outside:,})" for name in faster]
    return f"Faster in {dtype}, but not within the contract here: {', '.join(words)}." if words else ""


def _fastest(results: Results, dtypes: Sequence[str], input_name: str) -> str:
    kept, closest = [], []
    for dtype in dtypes:
        times, accuracy = times_at_largest_batch(results, dtype), on_input(results, dtype)
        keeping = [name for name in times if accuracy[name].outside == 0]
        if keeping:
            chosen = times[keeping[0]]
            time = f"{number(chosen.median_ns)} ns a matrix at batch {chosen.batch:,}"
            kept.append(f"**{chosen.method}** in {dtype}, {time}{_against_control(times, chosen)}")
        else:
            best = min(accuracy.values(), key=lambda entry: entry.outside)
            closest.append(f"{best.method} comes closest in {dtype}, outside on {best.outside:,}")
    count = next(iter(on_input(results, dtypes[0]).values())).matrices
    all_of_them = f"all {count:,} matrices" if count > 1 else "the one matrix"
    which = f"keeps the contract on {all_of_them} of {input_name}"
    if not kept:
        return f"No method measured {which}: {'; '.join(closest)}."
    none = "; none keeps it in the other dtype: " if closest else ""
    return f"The fastest method that {which} is {'; '.join(kept)}{none}{'; '.join(closest)}."


def _against_control(times: dict[str, Timing], chosen: Timing) -> str:
    """How it compares with the singular value decomposition; a difference within the spread is none."""
    control = times.get(CONTROL)
    if control is None or chosen.method == CONTROL:
        return ""
    if chosen.quartile_3_ns < control.quartile_1_ns:
        return f", {control.median_ns / chosen.median_ns:.2g} times faster than {CONTROL}"
    if control.quartile_3_ns < chosen.quartile_1_ns:
        return (
            f", {chosen.median_ns / control.median_ns:.2g} times the time of {CONTROL}, which is outside the contract"
        )
    return f", within the spread of {CONTROL}"


def _peers(beside: Beside) -> str:
    clauses = []
    for what, of_gradients in (("values", False), ("gradients", True)):
        beyond = beyond_front(beside.contenders, of_gradients=of_gradients)
        if beyond:
            names = listed([f"{contender.name} in {contender.dtype}" for contender in beyond])
            clauses.append(f"for {what} **{names} {'lies' if len(beyond) == 1 else 'lie'} beyond jaxrot's front**")
        elif any(_is_placed(contender, of_gradients) for contender in beside.contenders if not contender.is_own):
            clauses.append(f"for {what} no peer lies below and left of jaxrot's front{_nearest(beside, of_gradients)}")
    return f"Peers: {'; '.join(clauses)}." if clauses else "Peers: no error of theirs could be judged here."


def _nearest(beside: Beside, of_gradients: bool) -> str:
    """The fastest peer against the default method, in each dtype."""
    words = []
    for dtype in dict.fromkeys(contender.dtype for contender in beside.contenders):
        of_dtype = [contender for contender in beside.contenders if contender.dtype == dtype]
        times = {c.name: t for c in of_dtype if (t := _time(c, of_gradients)) is not None}
        default = times.get(jaxrot.DEFAULT_METHOD)
        peers = [contender for contender in of_dtype if not contender.is_own and contender.name in times]
        if default is None or not peers:
            continue
        fastest = min(peers, key=lambda contender: times[contender.name].median)
        time = times[fastest.name]
        ratio = time.median / default.median
        is_apart = default.quartile_3 < time.quartile_1 or time.quartile_3 < default.quartile_1
        words.append(
            f"{fastest.name} in {dtype}, {ratio:.2g} times the time of {jaxrot.DEFAULT_METHOD}"
            if is_apart
            else f"{fastest.name} in {dtype}, within the spread of {jaxrot.DEFAULT_METHOD}"
        )
    return f" (the fastest is {'; '.join(words)})" if words else ""


def _is_placed(contender: Contender, of_gradients: bool) -> bool:
    error = contender.gradient_error if of_gradients else contender.error
    return error is not None and _time(contender, of_gradients) is not None


def _time(contender: Contender, of_gradients: bool) -> Spread | None:
    return contender.gradient_time if of_gradients else contender.time


def warm_starts_finding(entries: Sequence[WarmStart]) -> str:
    """The cheapest number of iterations that is as right as the cold start, in each dtype."""
    clauses = []
    for dtype in dict.fromkeys(entry.dtype for entry in entries):
        of_dtype = [entry for entry in entries if entry.dtype == dtype and entry.step != PAPER]
        cold = next((entry for entry in of_dtype if entry.step == COLD_START), None)
        if cold is None:
            continue
        as_right = [e for e in of_dtype if e != cold and e.error.percentile_99 <= 2 * cold.error.percentile_99]
        if not as_right:
            clauses.append(f"no step measured is as accurate as the cold start in {dtype}")
            continue
        best = min(as_right, key=lambda entry: entry.time.median)
        if best.time.quartile_3 < cold.time.quartile_1:
            share = f"in {best.time.median / cold.time.median:.2g} times the time of the cold start"
        else:
            share = "in no less time than the cold start, by the spread"
        plural = "" if best.iterations == 1 else "s"
        clauses.append(f"{best.iterations} iteration{plural} of {best.step} in {dtype}, {share}")
    if not clauses:
        return ""
    return f"From a start {ANGLE_DEGREES:.0f}° off, to twice the cold start's error: {'; '.join(clauses)}."


def _promises(results: Results) -> str:
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
        names = listed(without) if len(without) < 4 else f"the {len(without)} others"
        verb = "declares" if len(without) == 1 else "declare"
        text += f"{'; ' if kept or failed else ''}{names} {verb} no domain in which the whole contract is kept"
    return text + "."

import numpy as np
import pytest

import jaxrot
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.timing import Timing
from jaxrot.report.data import ReportData
from jaxrot.report.inputs import WHOLE, Input
from jaxrot.report.measure.front import beyond_front
from jaxrot.report.measure.peer_comparison import ComparedMethod, PeerComparison
from jaxrot.report.measure.results import Quantiles, Results, Spread, largest_batch
from jaxrot.report.measure.warm_starts import COLD_START, WarmStart
from jaxrot.report.show.findings import faster_outside, findings

DEFAULT = jaxrot.DEFAULT_METHOD


def accuracy(method, outside=0, broken=0, set_name=WHOLE, group="input"):
    errors = [1e-7] * 8
    return Accuracy._make([method, "float32", group, set_name, 10, 0, 10, *errors, outside, 10, broken])


def timing(method, median, *, spread=0.1, batch=100, dtype="float32"):
    return Timing(method, dtype, batch, median, median * (1 - spread), median * (1 + spread), median / 2, 9, 1, 0.5)


def said(accuracies, timings, **parts):
    given = Input("mine", {"own": np.ones((10, 3, 3))})
    dtypes = tuple(dict.fromkeys(entry.dtype for entry in timings))
    return "\n".join(findings(ReportData(given, dtypes, Results(accuracies, timings, ()), **parts)))


def contender(name, time, error, *, is_own=False, spread=0.1, gradient=None):
    around = Spread(time, time * (1 - spread), time * (1 + spread))
    quantiles = Quantiles(error / 2, error, 2 * error)
    errors, times = (Quantiles(*[gradient] * 3), Spread(*(2 * value for value in around))) if gradient else (None, None)
    return ComparedMethod(
        name=name,
        description="",
        is_own=is_own,
        dtype="float32",
        computes_in="float32",
        threads=1,
        batch=100,
        no_result=0,
        outside=0,
        error=quantiles,
        time=around,
        gradient_error=errors,
        gradient_time=times,
    )


def test_the_fastest_within_the_contract_is_named_and_compared():
    times = [timing("svd", 1000), timing(DEFAULT, 100), timing("foam", 20)]
    accuracies = [accuracy("svd"), accuracy(DEFAULT), accuracy("foam", outside=3)]
    text = said(accuracies, times)
    assert f": **{DEFAULT}** in float32, 100 ns per matrix at batch 100, 10 times faster than svd." in text
    assert "foam (20 ns, outside on 3)" in faster_outside(Results(accuracies, times, ()), "float32")


def test_a_difference_within_the_spread_and_nobody_within_the_contract_are_said():
    text = said([accuracy("svd"), accuracy(DEFAULT)], [timing("svd", 110), timing(DEFAULT, 100)])
    assert "within the spread of svd" in text
    assert "faster than" not in text
    text = said([accuracy("svd", 4), accuracy(DEFAULT, 2, 2)], [timing("svd", 110), timing(DEFAULT, 100)])
    assert f"mine (10): none in float32 ({DEFAULT} comes closest, outside on 2)" in text


def test_a_report_opens_with_three_sentences():
    peers = PeerComparison([contender(DEFAULT, 100, 1e-7, is_own=True), contender("other", 500, 1e-6)], [])
    text = said([accuracy(DEFAULT)], [timing(DEFAULT, 100)], peers=peers)
    assert text.count("\n") == 2
    assert "none beyond jaxrot's front for values" in text
    assert f"fastest: other in float32, 5 times the time of {DEFAULT}" in text
    assert "gradients" not in text, "there was none"


@pytest.mark.parametrize(
    ("time", "error", "is_beyond"),
    [(500, 1e-8, True), (50, 1e-6, True), (95, 1e-6, False), (500, 1e-6, False), (100, 1e-7, False)],
)
def test_a_peer_is_beyond_the_front_where_no_method_is_as_accurate_and_as_fast(time, error, is_beyond):
    contenders = [contender(DEFAULT, 100, 1e-7, is_own=True), contender("peer", time, error)]
    assert [entry.name for entry in beyond_front(contenders, of_gradients=False)] == ["peer"] * is_beyond
    text = said([accuracy(DEFAULT)], [timing(DEFAULT, 100)], peers=PeerComparison(contenders, []))
    assert ("beyond jaxrot's front for values: **peer in float32**" in text) == is_beyond


def test_gradients_have_a_front_of_their_own():
    own = contender(DEFAULT, 100, 1e-7, is_own=True, gradient=1e-3)
    contenders = [own, contender("peer", 500, 1e-6, gradient=1e-6)]
    assert beyond_front(contenders, of_gradients=False) == []
    assert [entry.name for entry in beyond_front(contenders, of_gradients=True)] == ["peer"]


@pytest.mark.parametrize(
    ("time", "words"), [(50, "newton with iterations=1 in float32, 0.5 times"), (95, "by the spread")]
)
def test_a_warm_start_is_called_faster_only_beyond_the_spread(time, words):
    def warm(step, iterations, time, error):
        around = Spread(time, time * 0.9, time * 1.1)
        return WarmStart(step, "float32", iterations, 100, Quantiles(error, error, error), around)

    entries = (warm(COLD_START, 0, 100, 1e-7), warm("torque", 1, 10, 1e-2), warm("newton", 1, time, 1.5e-7))
    assert words in said([accuracy(DEFAULT)], [timing(DEFAULT, 100)], warm_starts=entries)


@pytest.mark.parametrize("group", ["input", "families"])
def test_a_broken_promise_is_said_once(group):
    whole = accuracy(DEFAULT, outside=2, broken=2 if group == "input" else 0)
    part = accuracy(DEFAULT, outside=2, broken=2, set_name="part", group=group)
    text = said([whole, part], [timing(DEFAULT, 100)])
    assert f"broken by {DEFAULT} on 2 matrices" in text


def test_dtypes_are_compared_at_the_largest_batch_they_share():
    entries = [timing("svd", 1, batch=batch, dtype=dtype) for dtype, batch in
               [("float32", 10), ("float32", 100), ("float32", 1000), ("float64", 10), ("float64", 100)]]  # fmt: skip
    assert largest_batch(entries) == 100

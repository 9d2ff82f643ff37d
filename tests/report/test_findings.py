import pytest

import jaxrot
from jaxrot.measuring.accuracy import Accuracy
from jaxrot.measuring.timing import Timing
from jaxrot.report.findings import findings, largest_batch
from jaxrot.report.measurement import WHOLE, Results

DEFAULT = jaxrot.DEFAULT_METHOD


def accuracy(method, outside=0, broken=0, set_name=WHOLE, group="input"):
    errors = [1e-7] * 8
    return Accuracy._make([method, "float32", group, set_name, 10, 0, 10, *errors, outside, 10, broken])


def timing(method, median, *, spread=0.1, batch=100, dtype="float32"):
    return Timing(method, dtype, batch, median, median * (1 - spread), median * (1 + spread), median / 2, 9, 1, 0.5)


def said(accuracies, timings):
    return "\n".join(findings(Results(accuracies, timings, ()), ["float32"], "mine"))


def test_the_fastest_within_the_contract_is_named_and_compared():
    text = said(
        [accuracy("svd"), accuracy(DEFAULT), accuracy("foam", outside=3)],
        [timing("svd", 1000), timing(DEFAULT, 100), timing("foam", 20)],
    )
    assert f"**{DEFAULT}**: 100 ns a matrix at batch 100, 10 times faster than svd" in text
    assert "foam (20 ns, outside on 3)" in text


def test_a_difference_within_the_spread_is_none():
    text = said([accuracy("svd"), accuracy(DEFAULT)], [timing("svd", 110), timing(DEFAULT, 100)])
    assert "within the spread of svd" in text
    assert "faster than" not in text


def test_nobody_within_the_contract_is_said():
    text = said([accuracy("svd", 4), accuracy(DEFAULT, 2, 2)], [timing("svd", 110), timing(DEFAULT, 100)])
    assert f"no method measured keeps the contract on all 10 matrices of mine; {DEFAULT} comes closest" in text


@pytest.mark.parametrize("group", ["input", "families"])
def test_a_broken_promise_is_said_once(group):
    whole = accuracy(DEFAULT, outside=2, broken=2 if group == "input" else 0)
    part = accuracy(DEFAULT, outside=2, broken=2, set_name="part", group=group)
    text = said([whole, part], [timing(DEFAULT, 100)])
    assert f"broken inside the declared domain: {DEFAULT} on 2" in text


def test_dtypes_are_compared_at_the_largest_batch_they_share():
    entries = [timing("svd", 1, batch=batch, dtype=dtype) for dtype, batch in
               [("float32", 10), ("float32", 100), ("float32", 1000), ("float64", 10), ("float64", 100)]]  # fmt: skip
    assert largest_batch(entries) == 100

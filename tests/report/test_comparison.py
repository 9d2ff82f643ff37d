import json

import numpy as np
import pytest

from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.timing import Timing
from jaxrot.report.comparison import compare, read_report
from jaxrot.report.data import ReportData
from jaxrot.report.inputs import WHOLE, Input
from jaxrot.report.measure.results import Results
from jaxrot.report.show.comparison_tables import compared_sentence, errors_compared_table, times_compared_table
from jaxrot.report.show.records import as_json

GIVEN = Input("mine", {"own": np.ones((10, 3, 3))})
SETS = {"own": 10}


def timing(method, median, spread=0.05):
    return Timing(method, "float32", 100, median, median * (1 - spread), median * (1 + spread), median, 9, 1, 0.5)


def accuracy(method, error, outside=0, set_name=WHOLE, group="input"):
    return Accuracy._make([method, "float32", group, set_name, 10, 0, 10, *[error] * 8, outside, 10, 0])


def results(times, errors):
    return Results([accuracy(*entry) for entry in errors], [timing(*entry) for entry in times], ())


def written(measured, tmp_path):
    """The report.json of an earlier run, read back."""
    path = tmp_path / "old.json"
    data = ReportData(GIVEN, ("float32",), measured, environment={"date": "then"})
    path.write_text(as_json(data), encoding="utf-8")
    return read_report(path)


def verdicts(changes):
    return {change.method: change.verdict for change in changes}


FOUR = [("foam", 100), ("svd", 1000), ("taylor", 50), ("cayley", 60)]
REST = [(method, 100) for method in ("squaring", "irving", "torque", "davenport", "singular_pair", "horn_quartic")]
RIGHT = [(method, 1e-7) for method, _ in FOUR]


def with_foam(*error):
    return [("foam", *error), *RIGHT[1:]]


def test_only_what_stands_apart_is_called_slower(tmp_path):
    right = [(method, 1e-7) for method, _ in FOUR + REST]
    before = written(results(FOUR + REST, right), tmp_path)
    now = results([("foam", 150), ("svd", 1050), ("taylor", 50), ("cayley", 30), *REST], right)
    comparison = compare("old.json", before, now, SETS)
    said = verdicts(comparison.times)
    expected = {"foam": "slower", "svd": "", "taylor": "", "cayley": "faster"}
    assert {method: said[method] for method, _ in FOUR} == expected
    assert "slower: foam (float32, batch 100: 1.50); faster: 1; less accurate: none" in compared_sentence(comparison)
    first = times_compared_table(comparison).rows[0]
    assert (first[0], first[5], first[-1]) == ("foam", "1.5", "**slower**")


def test_what_differs_as_much_as_all_the_others_do_is_not_called_slower(tmp_path):
    right = [(method, 1e-7) for method, _ in REST]
    before = written(results(REST, right), tmp_path)
    ratios = (0.7, 0.85, 1, 1.1, 1.2, 1.4)
    now = [(method, median * ratio) for (method, median), ratio in zip(REST, ratios, strict=True)]
    comparison = compare("old.json", before, results(now, right), SETS)
    assert set(verdicts(comparison.times).values()) == {""}


def test_a_slower_machine_makes_nobody_slower(tmp_path):
    before = written(results(FOUR, RIGHT), tmp_path)
    now = results([(method, 1.5 * median) for method, median in FOUR], RIGHT)
    comparison = compare("old.json", before, now, SETS)
    assert comparison.machine == pytest.approx(1.5)
    assert set(verdicts(comparison.times).values()) == {""}
    data = ReportData(GIVEN, ("float32",), now, comparison=comparison)
    assert json.loads(as_json(data))["comparison"]["times"][0]["method"] == "foam"


@pytest.mark.parametrize(
    ("then", "now", "verdict"),
    [
        ((1e-7, 0), (2e-7, 0), "worse"),
        ((1e-7, 0), (1e-7, 3), "worse"),
        ((1e-7, 3), (1e-7, 0), "better"),
        ((2e-7, 0), (1e-7, 0), "better"),
        ((1e-7, 0), (1.01e-7, 0), ""),
        ((1e-7, 0), (float("inf"), 0), "worse"),
        ((float("inf"), 0), (float("inf"), 0), ""),
        ((None, 0), (None, 0), ""),
    ],
)
def test_an_error_that_grew_is_worse(then, now, verdict, tmp_path):
    before = written(results(FOUR, with_foam(*then)), tmp_path)
    comparison = compare("old.json", before, results(FOUR, with_foam(*now)), SETS)
    assert verdicts(comparison.errors) == dict.fromkeys(("svd", "taylor", "cayley"), "") | {"foam": verdict}
    assert ("**worse**" in errors_compared_table(comparison).rows[0]) == (verdict == "worse")


def test_matrices_of_the_families_count_where_both_runs_drew_as_many(tmp_path):
    before = written(results(FOUR, [*RIGHT, ("foam", 1e-7, 1, "rank_1", "families")]), tmp_path)
    now = results(FOUR, [*RIGHT, ("foam", 1e-7, 3, "rank_1", "families")])
    (change,) = [change for change in compare("old.json", before, now, SETS).errors if change.method == "foam"]
    assert (change.outside_before, change.outside_now, change.verdict) == (1, 3, "worse")
    others = [entry._replace(matrices=10 if entry.group == "input" else 99) for entry in now.accuracy]
    larger = now._replace(accuracy=others)
    (change,) = [change for change in compare("old.json", before, larger, SETS).errors if change.method == "foam"]
    assert (change.outside_before, change.outside_now, change.verdict) == (0, 0, "")


def test_one_method_alone_is_compared_without_the_machines_share(tmp_path):
    before = written(results(FOUR, RIGHT), tmp_path)
    comparison = compare("old.json", before, results([("foam", 200)], RIGHT[:1]), SETS)
    assert comparison.machine == 1
    assert verdicts(comparison.times) == {"foam": "slower"}
    assert "Too few times" in compared_sentence(comparison)


def test_nothing_in_common_is_said_and_not_praised_and_errors_on_another_input_are_not_compared(tmp_path):
    before, now = written(results([("foam", 100)], RIGHT[:1]), tmp_path), results([("svd", 100)], [("svd", 1e-7)])
    comparison = compare("old.json", before, now, SETS)
    assert "No method was timed in both runs" in comparison.remarks[0]
    assert comparison.times == comparison.errors == ()
    words = compared_sentence(compare("old.json", before, now, {"own": 11}))
    assert "nothing to compare" in words
    assert "none" not in words
    before = written(results(FOUR, RIGHT), tmp_path)
    comparison = compare("old.json", before, results(FOUR, RIGHT), {"own": 11})
    assert comparison.errors == ()
    assert "another input" in comparison.remarks[0]

"""`report --bench`, on tiny batches, with few methods and with one that compiles fast in the place of the default."""

import functools
import json

import numpy as np
import pytest

import jaxrot
from jaxrot.__main__ import main
from jaxrot.report.measure import bench
from jaxrot.report.measure.bench import Goal
from jaxrot.report.show.tables import goals_table

FEW = ("higham_newton", "svd", "foam", "quaternion_average")


@pytest.fixture(scope="module")
def measured():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jaxrot, "METHODS", {name: jaxrot.METHODS[name] for name in FEW})
        patch.setattr(jaxrot, "DEFAULT_METHOD", "foam")
        patch.setattr(jaxrot, "nearest_rotation", functools.partial(jaxrot.nearest_rotation, method="foam"))
        # Few shapes: compiling is what costs, and the same program at the same shape is compiled once.
        size = bench.Size(2, 32, 32, (32, 48), budget_s=0.0)
        return bench.run_bench(size)


@pytest.mark.exhaustive
def test_every_goal_is_measured_at_its_batch(measured):
    batches = {goal.what: goal.batch for goal in measured.goals}
    assert batches["svd over default"] == batches["value and VJP over value"] == 32
    assert batches["svd over default in blocks"] == batches["MiB of temporary arrays, in blocks"] == 32
    assert batches["slowest over fastest batch, a matrix"] == 48
    assert {goal.batch for goal in measured.goals if "fastest other" in goal.what} == {1, 2}
    assert all(0 < goal.quartile_1 <= goal.median <= goal.quartile_3 for goal in measured.goals)


def test_a_ratio_is_that_of_the_times_it_names_and_times_are_medians_a_matrix(monkeypatch):
    functions = {"one": (lambda a: a + 1, (np.zeros((8, 3, 3), np.float32),))}
    result = bench.Bench([], {})
    seconds = bench._time(result, functions, bench.Size(budget_s=0.0))
    assert result.nanoseconds == {"one, batch 8": pytest.approx(np.median(seconds["one"]) / 8 * 1e9)}
    seconds = {"default": 2.0, "svd": 60.0, "newton step": 1.0, "quaternion_average": 0.5, "value and VJP": 3.0}
    times = {name: np.array([value]) for name, value in {**seconds, "default, float64": 5.0}.items()}
    monkeypatch.setattr(bench, "_time", lambda *_: times)
    result = bench.Bench([], {})
    bench._middle(result, bench.Size(middle=4))
    ratios = {goal.what: goal.median for goal in result.goals}
    assert ratios == {
        "svd over default": 30,
        "svd over one newton step": 60,
        "svd over quaternion_average": 120,
        "value and VJP over value": 1.5,
        "float64 over float32": 2.5,
    }


@pytest.mark.parametrize(("median", "at_least", "met"), [(3, True, "yes"), (3, False, "no"), (1, False, "yes")])
def test_a_goal_is_met_on_its_own_side(median, at_least, met):
    (row,) = goals_table([Goal("what", 10, median, median, median, 2, at_least)]).rows
    assert row[-1] == met


@pytest.mark.exhaustive
def test_the_command_writes_and_prints_the_table(measured, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(bench, "run_bench", lambda size: measured)
    assert main(["report", "--bench", "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    text = (tmp_path / "out" / "bench.md").read_text(encoding="utf-8")
    for words in (shown, text):
        assert "svd over default in blocks" in words
    content = json.loads((tmp_path / "out" / "bench.json").read_text(encoding="utf-8"))
    assert len(content["goals"]) == len(measured.goals)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"bench.md", "bench.json"}


def test_options_that_the_bench_does_not_take_are_refused(tmp_path, capsys):
    assert main(["report", "--bench", "--methods", "svd", "--out", str(tmp_path / "out")]) == 2
    assert "--bench measures a fixed list" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()

import csv
import io
import itertools
import json

import jax
import numpy as np
import pytest
from matplotlib.image import imread

import jaxrot
from jaxrot.__main__ import main
from jaxrot.console.environment import measuring_configuration
from jaxrot.report import command
from jaxrot.report.inputs import WHOLE, Input, read_input, thinned

FILES = {"report.md", "report.html", "report.csv", "report.json", "pareto.png", "survival.png"}


@pytest.fixture(scope="module")
def own_matrices():
    matrices = np.random.default_rng(0).standard_normal((5, 8, 3, 3))
    matrices[2, 3, 1, 1] = np.nan
    return matrices


@pytest.fixture(scope="module")
def report(tmp_path_factory, own_matrices):
    folder = tmp_path_factory.mktemp("report")
    np.save(folder / "own.npy", own_matrices)
    out = folder / "new" / "report"
    words = ["report", "--quick", "--input", folder / "own.npy", "--out", out, "--methods", "svd,foam"]
    assert main([str(word) for word in [*words, "--dtype", "both", "--batch", "7,64"]]) == 0
    return out


def test_the_dragon_is_the_default_input(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(command, "QUICK", command.QUICK._replace(clusters=5, timing_budget_s=0.0))
    assert main(["report", "--quick", "--methods", "foam", "--batch", "64", "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr()
    assert "Stanford dragon: 75 matrices, float32" in shown.out
    assert shown.err == "", "a progress bar where nobody is looking"
    text = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert "Stanford University Computer Graphics Laboratory" in text
    assert "| scrambled | 5 |" in text
    assert "`minus_identity`" in text


def test_all_files_are_written_and_the_page_needs_no_other(report):
    assert {path.name for path in report.iterdir()} == FILES
    assert {path.name for path in report.parent.iterdir()} == {report.name}
    assert imread(report / "pareto.png").ndim == 3
    page = (report / "report.html").read_text(encoding="utf-8")
    assert "keeps the contract on all" in page
    assert page.count("data:image/png;base64,") == 2
    assert "pareto.png" not in page


def test_markdown_opens_with_findings_then_pictures_then_tables(report):
    text = (report / "report.md").read_text(encoding="utf-8")
    words = ("# Error against", "cores usable", "keeps the contract on all", "](pareto.png)", "| svd |", "- device: ")
    positions = [text.index(word) for word in words]
    assert positions == sorted(positions)
    for word in (jaxrot.__version__, jax.__version__, np.__version__, "float32, float64", "cores usable", "commit"):
        assert word in text[text.index("## Where this was measured") :]
    assert "1 of the 40 matrices of own.npy hold a NaN" in text


def test_a_report_is_compared_with_an_earlier_one(report, own_matrices, tmp_path, capsys):
    np.save(tmp_path / "own.npy", own_matrices)
    words = ["report", "--quick", "--input", tmp_path / "own.npy", "--out", tmp_path / "out", "--methods", "foam"]
    words += ["--batch", "7", "--compare", report / "report.json"]
    assert main([str(word) for word in words]) == 0
    assert "Against report.json" in capsys.readouterr().out
    comparison = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))["comparison"]
    assert [(entry["method"], entry["batch"]) for entry in comparison["times"]] == [("foam", 7)]
    assert [entry["verdict"] for entry in comparison["errors"]] == [""]
    assert "## Against an earlier run" in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")


def test_csv_and_json_agree_and_own_matrices_are_counted_without_their_nan(report, own_matrices):
    content = json.loads((report / "report.json").read_text(encoding="utf-8"))
    rows = list(csv.DictReader(io.StringIO((report / "report.csv").read_text(encoding="utf-8"))))
    assert len(rows) == len(content["accuracy"]) == 2 * 2 * (2 + len(jaxrot.families.FAMILIES))
    for row, entry in zip(rows, content["accuracy"], strict=True):
        for name, value in entry.items():
            assert row[name] == ("" if value is None else str(value))
    timed = [row for row in rows if row["median_ns_batch_64"]]
    assert {(row["group"], row["set_name"]) for row in timed} == {("input", WHOLE)}
    for entry in content["timing"]:
        (row,) = [row for row in timed if (row["method"], row["dtype"]) == (entry["method"], entry["dtype"])]
        assert float(row[f"median_ns_batch_{entry['batch']}"]) == entry["median_ns"] > 0
    timed = {(entry["dtype"], entry["batch"]) for entry in content["timing"]}
    assert timed == set(itertools.product(("float32", "float64"), (7, 64)))
    content = json.loads((report / "report.json").read_text(encoding="utf-8"))
    entries = {(entry["method"], entry["dtype"]): entry for entry in content["accuracy"] if entry["set_name"] == "own"}
    assert content["input"] == {"name": "own.npy", "sets": {"own": 40}}
    for (_, dtype), entry in entries.items():
        assert (entry["matrices"], entry["not_finite"], entry["judged"]) == (40, 1, 39)
        assert 0 < entry["forward_max"] < 1e4 * np.finfo(dtype).eps
    assert np.isnan(own_matrices).any()


def test_an_existing_folder_keeps_its_other_files(report, tmp_path, capsys):
    out = tmp_path / "kept"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    (out / "report.md").write_text("old")
    np.save(tmp_path / "own.npy", np.eye(3, dtype=np.int8))
    words = ["report", "--quick", "--input", tmp_path / "own.npy", "--out", out, "--methods", "svd", "--batch", "7"]
    assert main([str(word) for word in words]) == 0
    assert {path.name for path in out.iterdir()} == FILES | {"notes.txt"}
    assert (out / "report.md").read_text(encoding="utf-8") != "old"
    capsys.readouterr()


def test_the_configuration_is_left_as_it_was():
    names = ("jax_enable_x64", "jax_enable_compilation_cache")
    before = [getattr(jax.config, name) for name in names]
    with measuring_configuration():
        assert [getattr(jax.config, name) for name in names] == [True, False]
    assert [getattr(jax.config, name) for name in names] == before


def test_every_fitting_array_of_an_archive_is_a_set_and_a_large_file_is_sampled_from_all(tmp_path):
    np.savez(tmp_path / "own.npz", a=np.ones((2, 3, 3), np.float16), b=np.zeros((3, 3), int), other=np.ones(4))
    given = read_input(tmp_path / "own.npz")
    assert {name: part.shape for name, part in given.sets.items()} == {"a": (2, 3, 3), "b": (1, 3, 3)}
    assert "other (shape (4,))" in given.remarks[0]
    sets = {"large": np.arange(900.0)[:, None, None] * np.ones((3, 3)), "small": np.ones((100, 3, 3))}
    sample = thinned(Input("own", sets), 50)
    assert {name: len(part) for name, part in sample.sets.items()} == {"large": 45, "small": 5}
    assert len(np.unique(sample.sets["large"])) == 45
    assert "50 of the 1,000" in sample.remarks[0]
    given = Input("own", sets)
    assert thinned(given, 1000) is given

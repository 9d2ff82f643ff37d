"""The measured regions of the README pages: written from a report, and nothing else touched."""

import json
import pathlib
import re

import pytest

from jaxrot import DEFAULT_METHOD, METHODS
from jaxrot.evaluation.timing import Timing
from jaxrot.report import readme

ROOT = pathlib.Path(__file__).parent.parent.parent
ENVIRONMENT = {
    "date": "2026-01-02 03:04:05+00:00",
    "device": "cpu: Some processor",
    "threads": "2 cores usable",
    "jax, jaxlib, numpy": "0.10.1, 0.10.1, 2.4.6",
}


def accuracy(method, dtype):
    return {
        "method": method, "dtype": dtype, "set_name": "whole input", "matrices": 6000, "outside": 7,
        "forward_median": 1e-7, "forward_99th": "inf",
    }  # fmt: skip


def timing(method, dtype):
    median = 10 + list(METHODS).index(method)
    return Timing(method, dtype, 1000, median, 9.0, 99.0, 8.0, 5, 1, 0.5)._asdict()


def contender(name, dtype="float32", *, gradient=True):
    error = {"median": 1e-7, "percentile_99": 2e-7, "largest": "inf"}
    time = {"median": 123.0, "quartile_1": 100.0, "quartile_3": 200.0}
    return {
        "name": name, "is_own": name == DEFAULT_METHOD, "dtype": dtype, "threads": 2, "batch": 1000,
        "error": error, "outside": 3,
        "time": time, "gradient_error": error if gradient else None, "families_no_number": ["zero"],
        "gradient_time": time if gradient else None,
    }  # fmt: skip


def price(guard, dtype):
    is_apart = guard == "inversion"
    return {
        "of": DEFAULT_METHOD, "guard": guard, "dtype": dtype, "judged": 100,
        "time": {"nanoseconds": 40.0, "nanoseconds_with": 50.0, "ratio": 0.8, "quartile_1": 0.7,
                 "quartile_3": 0.9 if is_apart else 1.1},
        "broken": [{"family": "minus_identity", "matrices": 5, "not_finite": 0, "worst": "inf", "promise": "torque"}]
        if is_apart else [],
        "gained": 0,
    }  # fmt: skip


@pytest.fixture
def report():
    pairs = [(method, dtype) for method in METHODS for dtype in ("float32", "float64")]
    contenders = [contender(DEFAULT_METHOD), contender("Peer"), contender("Wide", "float64")]
    contenders.append(contender("Plain", gradient=False))
    return {
        "environment": ENVIRONMENT,
        "accuracy": [accuracy(*pair) for pair in pairs],
        "timing": [timing(*pair) for pair in pairs],
        "findings": ["First.", "Peers: none beyond.", "Third."],
        "peers": {"contenders": contenders, "skipped": []},
        "guards": {"default": [price(g, d) for g in ("", "inversion", "polish") for d in ("float32", "float64")]},
    }


@pytest.fixture
def bench():
    goal = {"median": 30.0, "quartile_1": 20.0, "quartile_3": 40.0, "batch": 100_000, "at_least": True}
    goals = [
        goal | {"what": "svd over default", "bound": 25.0, "is_met": True},
        goal | {"what": "svd over one newton step", "bound": 100.0, "is_met": False},
    ]
    return {"environment": ENVIRONMENT, "goals": goals}


def test_every_region_is_filled_and_the_rest_is_left(report, bench):
    regions = (f"<!-- measured: {name} -->\nold\n<!-- /measured -->\nkept\n" for name in readme.REGIONS)
    text = "before\n" + "".join(regions)
    filled = readme.filled(text, report, bench)
    assert "old" not in filled
    assert filled.startswith("before\n")
    assert filled.count("kept\n") == len(readme.REGIONS)
    assert readme.filled(filled, report, bench) == filled
    with pytest.raises(KeyError, match="other"):
        readme.filled("<!-- measured: other -->\n<!-- /measured -->", report, bench)


def test_methods_stand_in_the_order_of_their_times_and_the_summary_compares_with_lapack(report, bench):
    region = readme.methods_region(report, bench)
    assert re.findall(r"^\| `(\w+)`", region, re.MULTILINE) == list(METHODS)
    assert f"| `{DEFAULT_METHOD}` (default) |" in region
    assert "1.0e-7 / ∞ | 7 / 7 | 10 / 10 |" in region
    assert "Measured on 2026-01-02" in region
    assert "Some processor, 2 cores, jax 0.10.1, batches of 1,000" in region
    region = readme.summary_region(report, bench)
    svd = 10 + list(METHODS).index("svd")
    assert f"`{DEFAULT_METHOD}`, takes 10 ns a matrix in float32 and 10 ns a matrix in float64" in region
    assert f"`svd`, takes {svd} ns a matrix in float32" in region


def test_peers_are_those_of_float32(report, bench):
    region = readme.peers_region(report, bench)
    assert "Peers: none beyond." in region
    assert f"| **{DEFAULT_METHOD}** |" in region
    assert "| Plain | 2 | 1,000 | 1.0e-7 / 2.0e-7 | 3 | 123 | - | - | - |" in region
    assert "Wide" not in region


def test_a_guard_costs_something_only_beyond_the_spread_and_a_missed_goal_is_marked(report, bench):
    region = readme.guards_region(report, bench)
    assert "| inversion | 0.8 (0.7-0.9) / 0.8 (0.7-0.9) | 5 / 5 | `minus_identity` |" in region
    assert "| polish | within the spread (0.7-1.1) / within the spread (0.7-1.1) | 0 / 0 | none |" in region
    region = readme.speed_region(report, bench)
    assert "| `svd` over default | 100,000 | 30 (20-40) | ≥ 25 |" in region
    assert "| `svd` over one `newton` step | 100,000 | 30 (20-40) | ≥ 100, missed |" in region


def test_the_command_writes_every_page_and_the_pictures(report, bench, tmp_path):
    folder, root = tmp_path / "report", tmp_path / "clone"
    for path in (folder, root / "notebooks", root / "jaxrot" / "room"):
        path.mkdir(parents=True)
    (folder / "report.json").write_text(json.dumps(report))
    (folder / "bench.json").write_text(json.dumps(bench))
    for name in readme.PICTURES:
        (folder / name).write_bytes(name.encode())
    written = [root / "README.md", root / "jaxrot" / "room" / "README.md"]
    for page in written:
        page.write_text("<!-- measured: speed -->\n<!-- /measured -->\n")
    readme.main([str(folder), "--root", str(root)])
    assert all("svd" in page.read_text() for page in written)
    assert {path.name for path in (root / "notebooks").iterdir()} == set(readme.PICTURES)


def test_the_pages_of_this_project_hold_every_region_once_and_filled():
    text = "".join(page.read_text(encoding="utf-8") for page in readme.pages(ROOT))
    regions = re.findall(r"<!-- measured: (\w+) -->\n(.*?)<!-- /measured -->", text, re.DOTALL)
    assert sorted(name for name, _ in regions) == sorted(readme.REGIONS)
    assert all("Measured on" in content or "measured on" in content for _, content in regions)

"""A standard output that is full, closed, or a pipe that nobody reads: one line at most, and no traceback."""

import os
import pathlib
import subprocess
import sys

import jax.numpy as jnp
import numpy as np
import pytest

import jaxrot
from jaxrot.__main__ import main
from jaxrot.recommending import command as recommending
from jaxrot.report import command as report
from jaxrot.report.data import ReportData
from jaxrot.report.inputs import Input
from jaxrot.report.measure.results import Results
from jaxrot.report.show import document, records
from jaxrot.scenes.scene import Scene
from jaxrot.simulate import command as simulate
from jaxrot.simulate.catalogue import Entry

COMMANDS = {
    "help": "--help",
    "help of a command": "report --help",
    "recommend": "recommend own.npy --tolerance 1",
    "report": "report --methods svd --out out",
    "bench": "report --bench --out out",
    "simulate": "simulate still --out out",
}


@pytest.fixture(autouse=True)
def nothing_measured(tmp_path, monkeypatch):
    """Every command comes to its end at once."""
    monkeypatch.chdir(tmp_path)
    np.save("own.npy", np.ones((2, 3, 3)))
    monkeypatch.setattr(recommending, "recommend_step_by_step", lambda *arguments: None)
    monkeypatch.setattr(recommending, "_as_text", lambda *arguments: "text")
    nothing = ReportData(given=Input("none", {}), dtypes=(), results=Results([], [], ()))
    monkeypatch.setattr(report, "measure", lambda *arguments: nothing)
    monkeypatch.setattr(report, "draw_pictures", lambda content: {"pareto.png": b"picture"})
    monkeypatch.setattr(report.bench, "run_bench", lambda *arguments: ())
    for module, name in (
        (document, "as_report_markdown"),
        (document, "as_terminal_text"),
        (records, "as_json"),
        (records, "as_bench_json"),
        (document, "as_bench_markdown"),
        (document, "as_bench_text"),
    ):
        monkeypatch.setattr(module, name, lambda *arguments: "text")
    monkeypatch.setattr(simulate, "_PICTURES", {})
    monkeypatch.setattr(simulate, "SCENES", {"still": Entry(_still, None, "")})


def _still():
    """A point that does not move."""
    return Scene(
        title="A point",
        state=jnp.zeros((1, 3)),
        step=lambda state: state,
        health=lambda state: {"height (m)": state[0, 2]},
        points=lambda state: state,
        lines=np.empty((0, 2), dtype=np.intp),
        step_seconds=0.1,
        steps=1,
    )


@pytest.fixture
def full():
    if not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full here")
    # With a buffer: what it holds fails when it is flushed.
    with open("/dev/full", "w", encoding="utf-8") as stream:
        yield stream


@pytest.fixture
def unread():
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "w", encoding="utf-8") as stream:
        yield stream


def _run(name):
    try:
        return main(COMMANDS[name].split())
    except SystemExit as error:
        return error.code


@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_disk_is_said_in_one_line(name, full, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", full)
    assert _run(name) == 2
    text = capsys.readouterr().err
    assert "standard output cannot be written to (no space left on device)" in text
    assert text.count("\n") == 1
    assert ("the results are in out" in text) == os.path.exists("out") == ("--out" in COMMANDS[name])


@pytest.mark.parametrize("name", COMMANDS)
def test_a_pipe_that_nobody_reads_ends_the_command_quietly(name, unread, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", unread)
    assert _run(name) == 141
    assert capsys.readouterr().err == ""
    assert os.path.exists("out") == ("--out" in COMMANDS[name])


@pytest.mark.parametrize("name", COMMANDS)
def test_a_closed_standard_output_is_said_in_one_line(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", None)
    assert _run(name) == 2
    text = capsys.readouterr().err
    assert "standard output is closed" in text
    assert text.count("\n") == 1


@pytest.mark.parametrize("words", ["recommend own.npy", "recommend none.npy --tolerance 1", "simulate nowhere"])
def test_without_standard_error_the_status_is_what_is_left(words, full, monkeypatch, capsys):
    monkeypatch.setitem(COMMANDS, "wrong", words)
    for stream in (None, full):
        monkeypatch.setattr(sys, "stderr", stream)
        assert _run("wrong") == 2
        assert capsys.readouterr().out == ""


@pytest.mark.parametrize("name", ["recommend", "report", "simulate"])
def test_a_command_does_not_need_standard_error(name, monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    assert _run(name) == 0


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
@pytest.mark.parametrize("flag", ["-B", "-u"], ids=["buffered", "unbuffered"])
def test_the_end_of_the_process_adds_nothing(flag, full):
    command = [sys.executable, flag, "-m", "jaxrot", "--help"]
    root = pathlib.Path(jaxrot.__file__).parents[1]
    done = subprocess.run(command, cwd=root, stdout=full, stderr=subprocess.PIPE, text=True, timeout=100, check=False)
    expected = "python -m jaxrot: standard output cannot be written to (no space left on device)\n"
    assert (done.returncode, done.stderr) == (2, expected)


def test_the_end_of_the_process_adds_nothing_to_a_pipe_that_nobody_reads(unread):
    command = [sys.executable, "-m", "jaxrot", "--help"]
    root = pathlib.Path(jaxrot.__file__).parents[1]
    done = subprocess.run(command, cwd=root, stdout=unread, stderr=subprocess.PIPE, text=True, timeout=100, check=False)
    assert (done.returncode, done.stderr) == (141, "")

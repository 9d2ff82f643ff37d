"""A standard output that is full, closed, or a pipe that nobody reads: one line at most, and no traceback."""

import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from commands import falling_point, measure_nothing, status

import jaxrot
from jaxrot.recommending import command as recommending
from jaxrot.report import command as report
from jaxrot.simulate import command as simulate
from jaxrot.simulate.catalogue import Entry

COMMANDS = {
    "help": "--help",
    "help of a command": "report --help",
    "recommend": "recommend own.npy --tolerance 1",
    "report": "report --methods svd --out out",
    "bench": "report --bench --out out",
    "simulate": "simulate falling --out out",
}
FULL = "python -m jaxrot: standard output cannot be written to (no space left on device)\n"


@pytest.fixture(autouse=True)
def nothing_measured(tmp_path, monkeypatch):
    """Every command comes to its end at once."""
    monkeypatch.chdir(tmp_path)
    np.save("own.npy", np.ones((2, 3, 3)))
    monkeypatch.setattr(recommending, "recommend_step_by_step", lambda *arguments: None)
    monkeypatch.setattr(recommending, "_as_text", lambda *arguments: "text")
    measure_nothing(monkeypatch)
    monkeypatch.setattr(report.bench, "run_bench", lambda *arguments: ())
    monkeypatch.setattr(simulate, "_PICTURES", {})
    monkeypatch.setattr(simulate, "SCENES", {"falling": Entry(falling_point, None, "")})


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


@pytest.mark.parametrize("name", COMMANDS)
def test_a_closed_standard_output_and_a_full_disk_are_said_in_one_line(name, full, monkeypatch, capsys):
    for stream, words in ((None, "is closed"), (full, "cannot be written to (no space left on device)")):
        monkeypatch.setattr(sys, "stdout", stream)
        assert status(COMMANDS[name].split()) == 2
        text = capsys.readouterr().err
        assert f"standard output {words}" in text
        assert text.count("\n") == 1
    assert ("the results are in out" in text) == os.path.exists("out") == ("--out" in COMMANDS[name])


@pytest.mark.parametrize("name", COMMANDS)
def test_a_pipe_that_nobody_reads_ends_the_command_quietly(name, unread, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", unread)
    assert status(COMMANDS[name].split()) == 141
    assert capsys.readouterr().err == ""
    assert os.path.exists("out") == ("--out" in COMMANDS[name])


@pytest.mark.parametrize("words", ["recommend own.npy", "recommend none.npy --tolerance 1", "simulate nowhere"])
def test_without_standard_error_the_status_is_what_is_left(words, full, monkeypatch, capsys):
    for stream in (None, full):
        monkeypatch.setattr(sys, "stderr", stream)
        assert status(words.split()) == 2
        assert capsys.readouterr().out == ""


@pytest.mark.parametrize("name", ["recommend", "report", "simulate"])
def test_a_command_does_not_need_standard_error(name, monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    assert status(COMMANDS[name].split()) == 0


@pytest.mark.parametrize("flag", ["-B", "-u"], ids=["buffered", "unbuffered"])
@pytest.mark.parametrize(("stream", "status", "text"), [("full", 2, FULL), ("unread", 141, "")], ids=["full", "unread"])
def test_the_end_of_the_process_adds_nothing(flag, stream, status, text, request):
    command = [sys.executable, flag, "-m", "jaxrot", "--help"]
    root = pathlib.Path(jaxrot.__file__).parents[1]
    given = {"stdout": request.getfixturevalue(stream), "stderr": subprocess.PIPE, "text": True, "timeout": 100}
    done = subprocess.run(command, cwd=root, check=False, **given)
    assert (done.returncode, done.stderr) == (status, text)

"""Ctrl-C: one line and status 130 at any moment, and nothing lost that is finished."""

import contextlib
import json
import os
import pathlib
import signal
import threading
import time

import numpy as np
import pytest
from commands import falling_point, measure_nothing

from jaxrot.__main__ import main
from jaxrot._recommend import candidates
from jaxrot.console.interrupts import Interrupts, watched
from jaxrot.report import command as report
from jaxrot.simulate import animation, recording
from jaxrot.simulate import command as simulate
from jaxrot.simulate.catalogue import Entry

NOTHING = "interrupted, nothing written\n"
FILES = ["animation.gif", "health.csv", "health.png", "run.json"]


def _interrupted(*arguments, **options):
    signal.raise_signal(signal.SIGINT)
    pytest.fail("not interrupted")


def _wrapped(*arguments, **options):
    try:
        _interrupted()
    except KeyboardInterrupt:
        raise ImportError("numpy.core failed to import") from None


class _Finalizer:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)


def _swallowed(*arguments, **options):
    _Finalizer()  # Python ignores exceptions in finalizers
    end = time.monotonic() + 10
    while time.monotonic() < end:
        time.sleep(0.001)
    pytest.fail("not interrupted")


@pytest.mark.parametrize("interrupt", [_interrupted, _wrapped, _swallowed])
@pytest.mark.parametrize("command", ["recommend", "report", "report --bench", "simulate"])
def test_measuring_is_interrupted_in_one_line(command, interrupt, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("own.npy", np.ones((4, 3, 3), np.float32))
    monkeypatch.setattr(candidates, "compile_method", interrupt)
    monkeypatch.setattr(report, "measure", interrupt)
    monkeypatch.setattr(report.bench, "run_bench", interrupt)
    monkeypatch.setattr(simulate, "SCENES", {"falling": Entry(interrupt, None, "")})
    rest = {"recommend": "own.npy --tolerance 1", "simulate": "falling --out out"}.get(command, "--out out")
    assert main([*command.split(), *rest.split()]) == 130
    shown = capsys.readouterr()
    assert (shown.out, shown.err) == ("", f"python -m jaxrot {command.split()[0]}: {NOTHING}")
    assert os.listdir() == ["own.npy"]


@pytest.fixture
def falling(tmp_path, monkeypatch):
    """Runs the command on that scene: status, and files in the folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(simulate, "SCENES", {"falling": Entry(falling_point, None, "")})

    def run(*words):
        status = main(["simulate", "falling", "--out", "out", *words])
        return status, sorted(os.listdir("out")) if os.path.exists("out") else None

    return run


def test_before_the_first_step_nothing_is_finished(falling, monkeypatch, capsys):
    monkeypatch.setattr(simulate, "SCENES", {"falling": Entry(lambda: falling_point(_interrupted), None, "")})
    assert falling() == (130, None)
    assert capsys.readouterr().err == f"python -m jaxrot simulate: {NOTHING}"


def test_the_steps_before_an_interruption_are_drawn_and_written(falling, monkeypatch, capsys):
    @contextlib.contextmanager
    def progress(interrupts):
        yield lambda step: signal.raise_signal(signal.SIGINT) if step == "step 2 of 3" else None

    monkeypatch.setattr(simulate, "progress", progress)
    assert falling() == (130, FILES)
    assert "Interrupted after 2 of 3 steps" in capsys.readouterr().out
    assert json.loads(pathlib.Path("out/run.json").read_text())["steps"] == 2


@pytest.mark.parametrize(
    ("picture", "finished"), [("health.png", []), ("animation.gif", ["health.png"])], ids=["health", "animation"]
)
def test_an_interruption_while_drawing_costs_no_result(picture, finished, falling, monkeypatch, capsys):
    monkeypatch.setitem(simulate._PICTURES, picture, _interrupted)
    assert falling() == (130, ["health.csv", *finished, "run.json"])
    out = capsys.readouterr().out
    assert "3 steps in" in out
    assert f"Interrupted while drawing, without {'health.png and ' if not finished else ''}animation.gif." in out
    assert len(pathlib.Path("out/health.csv").read_text().splitlines()) == 5
    assert json.loads(pathlib.Path("out/run.json").read_text())["steps"] == 3


def test_the_first_frame_may_be_interrupted(falling, monkeypatch):
    # The writer of the animation then raises an error of its own: it has no frame to write.
    monkeypatch.setattr(animation, "_points", lambda axes, count: _interrupted)
    assert falling() == (130, ["health.csv", "health.png", "run.json"])


@pytest.mark.parametrize("presses", [1, 2])
def test_writing_is_not_interrupted_until_a_second_ctrl_c(presses, falling, monkeypatch, capsys):
    def write(folder, files):
        signal.raise_signal(signal.SIGINT)
        (write_files if presses == 1 else _interrupted)(folder, files)

    write_files = simulate.write_files
    monkeypatch.setattr(simulate, "write_files", write)
    assert falling() == ((0, FILES) if presses == 1 else (130, None))
    assert capsys.readouterr().err == ("" if presses == 1 else f"python -m jaxrot simulate: {NOTHING}")


def test_a_long_stretch_between_two_frames_is_interrupted(monkeypatch):
    monkeypatch.setattr(recording, "_CALL_S", 1e-9)
    interrupts = Interrupts()

    def run(state, count):
        interrupts.pending = state == 4
        return state + count

    state, made, _ = recording._Calls(run, interrupts).make(0, 10**6)
    assert (state, made) == (5, 5)


def test_a_report_is_written_without_pictures_where_the_drawing_is_interrupted(tmp_path, monkeypatch, capsys):
    measure_nothing(monkeypatch)
    monkeypatch.setattr(report, "draw_pictures", _interrupted)
    assert main(["report", "--methods", "svd", "--out", str(tmp_path / "out")]) == 130
    assert "Interrupted while drawing, without pictures." in capsys.readouterr().out
    assert sorted(os.listdir(tmp_path / "out")) == ["report.csv", "report.html", "report.json", "report.md"]


def test_a_background_job_is_not_interrupted_and_another_thread_may_run_a_command(capsys):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with watched():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    statuses = []
    thread = threading.Thread(target=lambda: statuses.append(main(["simulate", "nowhere"])))
    thread.start()
    thread.join()
    assert statuses == [2]

"""Commands that measure nothing, and what they say when they refuse."""

import os
import pathlib

import jax.numpy as jnp
import numpy as np

from jaxrot.__main__ import main
from jaxrot.report import command as report
from jaxrot.report.data import ReportData
from jaxrot.report.inputs import Input
from jaxrot.report.measure.results import Results
from jaxrot.report.show import document, records
from jaxrot.scenes.scene import Scene

# Compiled programs are kept; this suite's other settings are not those of who pastes an example.
CACHED = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(pathlib.Path(__file__).parent.parent / ".jax_cache")}
CACHED |= {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.1"}


def status(words):
    """What the process would exit with."""
    try:
        return main([str(word) for word in words])
    except SystemExit as error:
        return error.code


def refused(words, capsys):
    """The one line on stderr of a command that exits with status 2 and prints nothing else."""
    found = status(words)
    shown = capsys.readouterr()
    assert (found, shown.out) == (2, "")
    assert shown.err.endswith("\n")
    assert shown.err[:-1].isprintable(), shown.err
    assert shown.err.startswith("python -m jaxrot")
    return shown.err


def measure_nothing(monkeypatch):
    """`report` comes to its end at once, with one picture."""
    nothing = ReportData(given=Input("none", {}), dtypes=(), results=Results([], [], ()))
    monkeypatch.setattr(report, "measure", lambda *arguments: nothing)
    monkeypatch.setattr(report, "draw_pictures", lambda content: {"pareto.png": b"picture"})
    for name in ("as_report_markdown", "as_terminal_text", "as_bench_markdown", "as_bench_text"):
        monkeypatch.setattr(document, name, lambda *arguments: "text")
    for name in ("as_json", "as_bench_json"):
        monkeypatch.setattr(records, name, lambda *arguments: "text")


def falling_point(points=lambda state: jnp.broadcast_to(state, (1, 3)), steps=3):
    """A scene that costs nothing."""
    return Scene(
        title="A point that falls",
        state=jnp.float32(0.0),
        step=lambda state: state - 1,
        health=lambda state: {"height (m)": state},
        points=points,
        lines=np.empty((0, 2), dtype=np.intp),
        step_seconds=0.1,
        steps=steps,
    )

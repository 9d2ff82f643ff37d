"""Ctrl-C where only a process of its own shows what happens: while modules are imported, and inside XLA."""

import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import jaxrot

NOTHING = "interrupted, nothing written\n"

# Python runs a module of this name before anything else. This one sends SIGINT when a module is imported, or when all
# of some functions are running.
HOOK = """
import os, signal, sys, threading, time
module, functions = os.environ.pop("AT_MODULE", ""), set(filter(None, os.environ.pop("IN_FUNCTIONS", "").split()))
interrupt = lambda: os.kill(os.getpid(), signal.SIGINT)
def audit(event, arguments):
    global module
    if event == "import" and arguments[0] == module:
        module = ""
        interrupt()
def names(frame):
    while frame is not None:
        yield frame.f_code.co_name
        frame = frame.f_back
def watch(main):
    while not functions <= set(names(sys._current_frames()[main])):
        time.sleep(0.001)
    interrupt()
if module:
    sys.addaudithook(audit)
if functions:
    threading.Thread(target=watch, args=[threading.main_thread().ident], daemon=True).start()
"""


def _in_a_process(folder, words, **where):
    (folder / "sitecustomize.py").write_text(HOOK)
    environment = {**os.environ, "PYTHONPATH": str(folder), **where}
    command = [sys.executable, *map(str, words)]
    root = pathlib.Path(jaxrot.__file__).parents[1]
    return subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, timeout=100, check=False)


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("numpy", ["report", "--quick"]),
        ("numpy.linalg._umath_linalg", ["simulate", "drift"]),
        ("jax._src.core", ["recommend", "none.npy", "--tolerance", "1"]),
        ("jaxlib.mlir.ir", ["report", "--quick"]),
        ("jaxrot._algebra.mat3", ["--help"]),
        ("jaxrot.report.peers.warp_svd", ["simulate", "drift"]),
        ("jaxrot.simulate.command", ["recommend", "none.npy", "--tolerance", "1"]),
    ],
)
def test_an_import_is_interrupted_in_one_line(module, words, tmp_path):
    done = _in_a_process(tmp_path, ["-m", "jaxrot", *words], AT_MODULE=module)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", f"python -m jaxrot: {NOTHING}")


def test_importing_jaxrot_elsewhere_leaves_ctrl_c_alone(tmp_path):
    program = "import jaxrot, signal; print(signal.getsignal(2) is signal.default_int_handler)"
    (tmp_path / "other.py").write_text(program)
    for words in (["-m", "other", "jaxrot"], ["-c", program, "-m", "jaxrot"]):
        assert _in_a_process(tmp_path, words).stdout == "True\n"


def test_a_compilation_is_interrupted_in_one_line(tmp_path):
    np.save(tmp_path / "own.npy", np.ones((100, 3, 3), np.float32))
    words = ["-m", "jaxrot", "recommend", tmp_path / "own.npy", "--tolerance", "1e-3"]
    done = _in_a_process(tmp_path, words, IN_FUNCTIONS="measure_method backend_compile_and_load")
    # Or -11: XLA may crash when Python shuts down after this.
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.startswith("python -m jaxrot")
    assert done.stderr.endswith(NOTHING)
    assert done.stderr.count("\n") == 1


def test_a_call_that_does_not_return_is_interrupted(tmp_path):
    code = """
import hashlib
from jaxrot.console.interrupts import watched
def never_returns():
    hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)
with watched(owns_process=True):
    never_returns()
"""
    done = _in_a_process(tmp_path, ["-c", code], IN_FUNCTIONS="never_returns")
    assert (done.returncode, done.stderr) == (130, f"python -m jaxrot: {NOTHING}")

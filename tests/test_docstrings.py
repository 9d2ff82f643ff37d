"""Public docstrings have the same sections in one order, are short, and their examples run."""

import inspect
import pathlib
import re
import subprocess
import sys

import pytest
from commands import CACHED

import jaxrot
from jaxrot import families
from jaxrot.scenes import corotational, drift, shape_matching, tetrahedron

ROOT = pathlib.Path(__file__).parent.parent
SECTIONS = ("Args", "Returns", "Raises", "Uniqueness", "Derivative", "Accuracy", "Cost", "Example", "Source")
MOST_WORDS = 230
RUN_EXAMPLES = """
import doctest, importlib, sys
results = [doctest.testmod(importlib.import_module(name)) for name in sys.argv[1:]]
print(sum(result.attempted for result in results), "examples")
sys.exit(any(result.failed for result in results))
"""


def public_objects() -> dict[str, type]:
    """The public functions and classes by name."""
    found = {name: getattr(jaxrot, name) for name in jaxrot.__all__}
    found |= {
        f"families.{name}": value
        for name, value in vars(families).items()
        if not name.startswith("_") and getattr(value, "__module__", None) == families.__name__
    }
    found |= {scene.__name__: scene.step for scene in (corotational, drift, shape_matching, tetrahedron)}
    return {name: value for name, value in found.items() if inspect.isfunction(value) or inspect.isclass(value)}


def sections(docstring: str) -> list[str]:
    return re.findall(r"\n\n([A-Z][a-z]+(?: [a-z]+)*):\s", docstring)


def words(docstring: str) -> int:
    """The number of words: formulas and the code of the example do not count."""
    prose = re.sub(r"(?m)^Example:\n(?: .*\n?)*", "", docstring)
    return sum(re.search(r"[A-Za-z]", word) is not None for word in prose.split())


def problems(docstring: str, *, is_function: bool) -> list[str]:
    """What a reader would miss in a docstring, or find too long."""
    allowed = SECTIONS if is_function else ("Attributes", *SECTIONS)
    found = sections(docstring)
    wrong = [f"the section {name} is not in the list" for name in found if name not in allowed]
    if not wrong and found != sorted(set(found), key=allowed.index):
        wrong.append(f"the order of the sections is {', '.join(found)}")
    if is_function and ("Example" not in found or ">>> " not in docstring):
        wrong.append("no example")
    if is_function and words(docstring) > MOST_WORDS:
        wrong.append(f"{words(docstring)} words")
    return wrong


def run_examples(modules: set[str], directory: pathlib.Path) -> subprocess.CompletedProcess:
    """Runs the examples in an interpreter of their own."""
    command = [sys.executable, "-c", RUN_EXAMPLES, *sorted(modules)]
    return subprocess.run(command, cwd=directory, env=CACHED, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(("name", "value"), public_objects().items(), ids=public_objects())
def test_a_public_docstring_is_short_and_in_order(name, value):
    assert problems(inspect.getdoc(value) or "", is_function=inspect.isfunction(value)) == []


def test_the_examples_run():
    modules = {value.__module__ for value in public_objects().values()}
    run = run_examples(modules, ROOT)
    assert run.returncode == 0, run.stdout + run.stderr
    functions = sum(inspect.isfunction(value) for value in public_objects().values())
    assert int(run.stdout.split()[-2]) >= functions


def test_a_wrong_example_is_found(tmp_path):
    (tmp_path / "wrong.py").write_text('"""Twice two.\n\n>>> 2 * 2\n5\n"""\n')
    run = run_examples({"wrong"}, tmp_path)
    assert run.returncode == 1
    assert "Expected:\n    5\nGot:\n    4" in run.stdout


@pytest.mark.parametrize(
    ("docstring", "problem"),
    [
        ("Returns R.\n\nExample:\n    >>> 1\n    1\n\nArgs:\n    A.\n", "order"),
        ("Returns R.\n\nSharded batches: each device.\n\nExample:\n    >>> 1\n    1\n", "Sharded batches is not in"),
        ("Returns R.\n\nArgs:\n    A.\n", "no example"),
        ("Returns R.\n\nExample:\n    >>> 1\n    1\n" + "word " * 300, "words"),
    ],
)
def test_a_poor_docstring_is_found(docstring, problem):
    assert problem in " ".join(problems(docstring, is_function=True))

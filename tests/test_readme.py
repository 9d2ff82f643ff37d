"""The README's code runs, its commands are the ones CI runs, and its tables know every method and step."""

import doctest
import pathlib
import re

import numpy as np

from jaxrot import METHODS, STEPS

README = (pathlib.Path(__file__).parent.parent / "README.md").read_text()


def test_the_code_in_the_readme_does_what_it_says():
    # The README is written for a fresh interpreter; under the suite's x64 its float32 is asked for by name.
    with np.printoptions(precision=3, suppress=True):
        test = doctest.DocTestParser().get_doctest(README, {}, "README.md", "README.md", 0)
        runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
        runner.run(test)
    assert runner.failures == 0
    assert len(test.examples) >= 10


def test_the_readme_has_one_command_for_the_report_and_one_for_the_tests():
    commands = [line for line in README.splitlines() if "pip install" in line]
    assert len(commands) == 2
    assert sum("python -m jaxrot report" in line for line in commands) == 1
    assert sum("python -m pytest" in line for line in commands) == 1


def test_the_tables_name_every_method_and_step():
    rows = set(re.findall(r"^\| `(\w+)`", README, re.MULTILINE))
    assert set(METHODS) | set(STEPS) <= rows


def test_its_pictures_exist():
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README):
        assert (pathlib.Path(__file__).parent.parent / picture).exists()

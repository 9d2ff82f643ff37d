"""The README's code runs, its commands are the ones CI runs, and its tables know every method and step."""

import doctest
import pathlib
import re
import subprocess
import sys

import pytest

from jaxrot import METHODS, STEPS
from jaxrot.simulate.catalogue import SCENES

ROOT = pathlib.Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


@pytest.mark.parametrize(("page", "examples"), [("README.md", 12), ("jaxrot/RECIPES.md", 20)])
def test_the_code_of_a_page_does_what_it_says(page, examples):
    assert len(doctest.DocTestParser().get_examples((ROOT / page).read_text())) >= examples
    # In an interpreter of its own: as a newcomer pastes it, without this suite's settings.
    run = subprocess.run([sys.executable, "-m", "doctest", page], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout


def test_the_readme_has_one_command_for_the_report_and_one_for_the_tests():
    commands = [line for line in README.splitlines() if line.startswith("python3 -m venv")]
    assert len(commands) == 2
    assert sum("python -m jaxrot report" in line for line in commands) == 1
    assert sum("python -m pytest" in line for line in commands) == 1


def test_the_tables_name_every_method_and_step():
    rows = set(re.findall(r"^\| `(\w+)`", README, re.MULTILINE))
    assert set(METHODS) | set(STEPS) <= rows


def test_every_scene_is_in_the_table():
    table = " ".join(line for line in README.splitlines() if line.startswith("| `"))
    assert all(f"`{name}`" in table for name in SCENES)


def test_its_pictures_exist():
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README):
        assert (ROOT / picture).exists()

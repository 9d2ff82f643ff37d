"""The code of the pages runs, the README's commands are the ones CI runs, and the tables know every name."""

import doctest
import pathlib
import re
import subprocess
import sys

import pytest
from commands import CACHED

from jaxrot import METHODS, STEPS
from jaxrot.simulate.catalogue import SCENES

ROOT = pathlib.Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
# Each page and the fewest examples on it. Without that number a page whose code is not found would pass.
PAGES = {
    "README.md": 12,
    "jaxrot/RECIPES.md": 30,
    "jaxrot/solvers/README.md": 5,
    "jaxrot/steps/README.md": 6,
    "jaxrot/scenes/README.md": 8,
    "jaxrot/report/README.md": 0,
}


@pytest.mark.parametrize(("page", "examples"), [item for item in PAGES.items() if item[1]])
def test_the_code_of_a_page_does_what_it_says(page, examples):
    assert len(doctest.DocTestParser().get_examples((ROOT / page).read_text())) >= examples
    # In an interpreter of its own: as a newcomer pastes it, without this suite's settings.
    command = [sys.executable, "-m", "doctest", page]
    run = subprocess.run(command, cwd=ROOT, env=CACHED, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout


@pytest.mark.parametrize(("room", "registry"), [("solvers", METHODS), ("steps", STEPS)])
def test_the_table_of_a_room_names_every_entry_and_its_source(room, registry):
    lines = (ROOT / "jaxrot" / room / "README.md").read_text().splitlines()
    for name, entry in registry.items():
        assert any(line.startswith(f"| `{name}`") and entry.source in line for line in lines), name


def test_every_scene_has_a_row_and_the_readme_one_command_for_the_report_and_one_for_the_tests():
    rows = re.findall(r"^\| `(\w+)`", (ROOT / "jaxrot/scenes/README.md").read_text(), re.MULTILINE)
    assert rows == list(SCENES)
    commands = [line for line in README.splitlines() if line.startswith("python3 -m venv")]
    assert len(commands) == 2
    assert sum("python -m jaxrot report" in line for line in commands) == 1
    assert sum("python -m pytest" in line for line in commands) == 1


@pytest.mark.parametrize("page", PAGES)
def test_the_pictures_notebooks_and_pages_that_a_page_links_to_exist(page):
    links = re.findall(r"\]\(([^()]*(?:\.png|\.ipynb|README\.md|RECIPES\.md))", (ROOT / page).read_text())
    assert [link for link in links if not ((ROOT / page).parent / link).exists()] == []

"""What is written in two places agrees: versions, and the names on the page for contributors."""

import pathlib
import re
import tomllib

import pytest

import jaxrot

ROOT = pathlib.Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_newest_entry_of_the_changelog_is_this_version():
    changelog = (ROOT / "jaxrot" / "CHANGELOG.md").read_text()
    version, date = re.findall(r"^## (\S+) \((\d{4}-\d\d-\d\d)\)$", changelog, re.MULTILINE)[0]
    assert version == jaxrot.__version__
    citation = (ROOT / ".github" / "CITATION.cff").read_text()
    assert f"\nversion: {version}\ndate-released: {date}\n" in citation


@pytest.mark.parametrize("linter", ["ruff", "pyright"])
def test_the_hooks_run_the_linters_of_the_extra(linter):
    hooks = (ROOT / ".pre-commit-config.yaml").read_text()
    (pinned,) = [need for need in PROJECT["optional-dependencies"]["dev"] if need.startswith(linter)]
    assert set(re.findall(rf"{linter}==[\d.]+", hooks)) == {pinned}


def test_the_page_for_contributors_names_files_and_what_they_hold():
    page = (ROOT / ".github" / "CONTRIBUTING.md").read_text()
    paths = [path for path in re.findall(r"`((?:jaxrot|tests|notebooks)/[\w./]*)`", page) if "NAME" not in path]
    assert len(paths) > 20
    assert [path for path in paths if not (ROOT / path).exists()] == []
    held = re.findall(r"`(\w+)`,? (?:in|to|of)\s+`([\w./]+\.py)`", page)
    assert len(held) > 8
    assert [(name, path) for name, path in held if name not in (ROOT / path).read_text()] == []

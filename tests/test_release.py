"""The version is the same wherever it is written."""

import pathlib
import re

import jaxrot

ROOT = pathlib.Path(__file__).parent.parent


def test_the_newest_entry_of_the_changelog_is_this_version():
    changelog = (ROOT / "jaxrot" / "CHANGELOG.md").read_text()
    version, date = re.findall(r"^## (\S+) \((\d{4}-\d\d-\d\d)\)$", changelog, re.MULTILINE)[0]
    assert version == jaxrot.__version__
    citation = (ROOT / ".github" / "CITATION.cff").read_text()
    assert f"\nversion: {version}\ndate-released: {date}\n" in citation

"""Checks what a wheel and a source distribution hold: `python .ci/check_distributions.py FOLDER`, in the clone."""

import sys
import tarfile
import zipfile
from pathlib import Path


def main(folder: Path) -> None:
    """Raises AssertionError with the names of the files that are missing, or too many."""
    package = files("jaxrot")
    assert {"jaxrot/py.typed", "jaxrot/CHANGELOG.md", "jaxrot/RECIPES.md"} <= package
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        installed = {name for name in archive.namelist() if ".dist-info/" not in name}
    # No tests and no notebooks: the wheel would install them as top-level packages.
    assert installed == package, f"the wheel differs from jaxrot/ in {sorted(installed ^ package)}"
    (source,) = folder.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        contents = {name.partition("/")[2] for name in archive.getnames()}
    missing = (package | files("tests") | files("notebooks") | {"README.md", "LICENSE", "pyproject.toml"}) - contents
    assert not missing, f"the source distribution lacks {sorted(missing)}"


def files(folder: str) -> set[str]:
    """The files below a folder of the clone, without what running them leaves behind."""
    left_behind = {"__pycache__", ".ipynb_checkpoints"}
    return {str(path) for path in Path(folder).rglob("*") if path.is_file() and not left_behind & set(path.parts)}


main(Path(sys.argv[1]))

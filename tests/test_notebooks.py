"""Every notebook runs from top to bottom, at a size that keeps the suite short, and is committed with its figures."""

import os
import pathlib
import sys

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((pathlib.Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))
PICTURE = "image/png"

# The kernel opens sockets that Python's garbage collector reports when it ends them.
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")


@pytest.mark.exhaustive
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, monkeypatch):
    monkeypatch.setenv("JAXROT_NOTEBOOK_SAMPLES", "20000")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(path.parent.parent), *sys.path]))
    notebook = nbformat.read(path, as_version=4)
    # A failing assertion of the notebook is raised here, with its cell.
    NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": path.parent}}
    ).execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_with_its_figures_and_without_errors(path):
    cells = nbformat.read(path, as_version=4).cells
    outputs = [output for cell in cells if cell.cell_type == "code" for output in cell.outputs]
    assert any(PICTURE in output.get("data", {}) for output in outputs)
    assert all(output.output_type != "error" for output in outputs)
    assert all(cell.execution_count for cell in cells if cell.cell_type == "code")

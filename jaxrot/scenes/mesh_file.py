"""Mesh files of the user, in any format that meshio reads."""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from jaxrot.scenes.checks import checked_vertices


def read(path: Path) -> Any:
    """Returns the content of the file, a `meshio.Mesh`.

    Raises:
        ValueError: meshio is not installed, the file is missing or cannot be read.
    """
    try:
        import meshio
    except ImportError:
        raise ValueError("meshio is not installed; expected: pip install 'jaxrot[scenes]'") from None
    # meshio prints its errors and ends the process: capture both.
    messages = io.StringIO()
    try:
        with contextlib.redirect_stdout(messages), contextlib.redirect_stderr(messages):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        known = isinstance(error, meshio.ReadError | OSError) and str(error)
        reason = " ".join(str(error).split()).removesuffix(".") if known else "not a mesh file"
        raise ValueError(f"the mesh cannot be read ({reason})") from None


def vertices(path: Path) -> np.ndarray:
    """Returns the vertices in the file, or raises a ValueError."""
    return checked_vertices(read(path).points)

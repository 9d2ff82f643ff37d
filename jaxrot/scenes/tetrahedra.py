"""Meshes of tetrahedra: boxes, files in any format that meshio reads, validation, quantities for finite elements."""

import contextlib
import io
import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxrot.scenes.checks import checked_vertices

_CORNERS = 4


class Mesh(NamedTuple):
    """A mesh of tetrahedra."""

    vertices: np.ndarray  # At rest, float64 of shape (n, 3), m
    tetrahedra: np.ndarray  # Vertex indices, shape (m, 4); the volume of each is positive once `checked`


def box(cells: tuple[int, int, int], size: tuple[float, float, float]) -> Mesh:
    """Returns a box from the origin, `size` long (m); each cell is divided into six tetrahedra around its diagonal.

    The tetrahedra of neighbouring cells match without alternating patterns (Kuhn 1960).
    """
    if min(cells) < 1 or not all(np.isfinite(size)) or min(size) <= 0:
        raise ValueError(f"a box needs at least one cell and a positive length along each axis; got {cells} and {size}")
    counts = np.array(cells) + 1
    grid = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1)
    strides = np.array([counts[1] * counts[2], counts[2], 1])
    first = (grid[:-1, :-1, :-1] @ strides).reshape(-1, 1)
    # Each tetrahedron is a path from one end of the diagonal to the other, along the three axes in one of six orders.
    paths = [np.cumsum([0, *strides[list(order)]]) for order in itertools.permutations(range(3))]
    vertices = grid.reshape(-1, 3) * (np.array(size) / np.array(cells))
    return checked(vertices, np.concatenate([first + path for path in paths]))


def read(path: Path) -> Mesh:
    """Returns the tetrahedra in a mesh file, or raises a ValueError. Vertices of no tetrahedron are left out."""
    content = _read(path)
    # Take the first four: quadratic tetrahedra list their corners first.
    cells = [block.data[:, :_CORNERS] for block in content.cells if block.type in ("tetra", "tetra10")]
    if not cells:
        kinds = ", ".join(sorted({block.type for block in content.cells})) or "none"
        raise ValueError(f"the mesh has no tetrahedra; its cells: {kinds}")
    used, indices = np.unique(np.concatenate(cells), return_inverse=True)
    return checked(np.asarray(content.points)[used], indices.reshape(-1, _CORNERS))


def read_vertices(path: Path) -> np.ndarray:
    """Returns the vertices in a file of a mesh of any kind, or raises a ValueError."""
    return checked_vertices(_read(path).points)


def _read(path: Path) -> Any:
    """Returns the `meshio.Mesh` in the file. It raises a ValueError without meshio, or if the file cannot be read."""
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


def checked(vertices: np.ndarray, tetrahedra: np.ndarray) -> Mesh:
    """Returns the mesh with every tetrahedron oriented so that its volume is positive, or raises a ValueError."""
    tetrahedra = np.asarray(tetrahedra)
    if tetrahedra.size == 0:
        raise ValueError("the mesh has no tetrahedra")
    if tetrahedra.ndim != 2 or tetrahedra.shape[1] != _CORNERS or not np.issubdtype(tetrahedra.dtype, np.integer):
        raise ValueError(
            f"tetrahedra must be integers of shape (m, 4); got {tetrahedra.dtype} of shape {tetrahedra.shape}"
        )
    vertices = checked_vertices(vertices)
    if tetrahedra.min() < 0 or tetrahedra.max() >= len(vertices):
        raise ValueError(f"a tetrahedron names a vertex outside 0 to {len(vertices) - 1}")
    alone = np.setdiff1d(np.arange(len(vertices)), tetrahedra)
    if len(alone):
        raise ValueError(f"vertex {alone[0]} belongs to no tetrahedron, it would have no mass")
    mesh = Mesh(vertices, tetrahedra.astype(np.int32))
    is_negative = np.linalg.det(edge_matrices(mesh)) < 0
    mesh = mesh._replace(tetrahedra=np.where(is_negative[:, None], mesh.tetrahedra[:, [0, 1, 3, 2]], mesh.tetrahedra))
    edges = edge_matrices(mesh)
    # Compare with the longest edge, so that the limit does not depend on the unit of length.
    flat = np.linalg.det(edges) <= 1e-9 * np.linalg.norm(edges, axis=-2).max(axis=-1) ** 3
    if flat.any():
        raise ValueError(f"tetrahedron {int(np.argmax(flat))} is flat, {int(flat.sum())} of {len(flat)} are")
    return mesh


def edge_matrices(mesh: Mesh) -> np.ndarray:
    """The edges from the first corner to the others, as columns: shape (m, 3, 3)."""
    corners = mesh.vertices[mesh.tetrahedra]
    return np.swapaxes(corners[:, 1:] - corners[:, :1], -1, -2)


def volumes(mesh: Mesh) -> np.ndarray:
    """The volumes of the tetrahedra, shape (m,)."""
    return np.linalg.det(edge_matrices(mesh)) / 6


def lumped_masses(mesh: Mesh, density: np.ndarray | float) -> np.ndarray:
    """Returns the mass of each vertex, a quarter of each of its tetrahedra, shape (n,), kg."""
    quarter = np.broadcast_to(density * volumes(mesh) / _CORNERS, (_CORNERS, len(mesh.tetrahedra)))
    return np.bincount(mesh.tetrahedra.T.ravel(), weights=quarter.ravel(), minlength=len(mesh.vertices))


def surface_edges(mesh: Mesh) -> np.ndarray:
    """Returns the edges of the triangles that belong to one tetrahedron only: pairs of vertices, shape (k, 2)."""
    faces = np.concatenate([mesh.tetrahedra[:, list(face)] for face in itertools.combinations(range(_CORNERS), 3)])
    triangles, count = np.unique(np.sort(faces, axis=1), axis=0, return_counts=True)
    outer = triangles[count == 1]
    return np.unique(np.concatenate([outer[:, [0, 1]], outer[:, [0, 2]], outer[:, [1, 2]]]), axis=0)

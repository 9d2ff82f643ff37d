"""Imports point one way, and the core imports jax and numpy alone."""

import ast
import pathlib

import pytest

PACKAGE = pathlib.Path(__file__).parent.parent / "jaxrot"

# Each room may import from the rows above its own, and from its own row.
LAYERS = [
    {
        "_choice",
        "_complex",
        "_frozen",
        "_inputs",
        "_mat3",
        "_platform",
        "_quaternion",
        "_scaling",
        "_startup",
        "families",
    },
    {"_blocks", "_compiled", "_definite", "_jacobi", "_saturation", "_symmetric"},
    {"_derivative"},
    {"steps"},
    {"solvers"},
    {"_nearest", "_refine", "_svd"},
    {"_conditioning", "_dense", "_divided_differences", "_polar"},
    {"_isotropic"},
    {"measuring"},
    {"_sample"},
    {"_candidates"},
    {"_recommend", "_recommendation"},
    {"__init__"},
    {"console"},
    {"scenes"},
    {"recommending", "report", "simulate"},
    {"__main__"},
]
CORE = {name for layer in LAYERS[:13] for name in layer}
LEVEL = {name: level for level, layer in enumerate(LAYERS) for name in layer}
FILES = sorted(PACKAGE.rglob("*.py"))


def room(path: pathlib.Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: pathlib.Path) -> set[str]:
    """The modules that a file imports, as dotted names."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name} uses a relative import"
            # `from jaxrot import _mat3` imports a room, `from jaxrot._mat3 import Mat3` a name in one.
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def imported_rooms(path: pathlib.Path) -> set[str]:
    rooms = {name.split(".")[1] for name in imports(path) if name.startswith("jaxrot.")}
    return {name if name in LEVEL else "__init__" for name in rooms} - {room(path)}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_one_way(path):
    below = {name for name in imported_rooms(path) if LEVEL[name] <= LEVEL[room(path)]}
    assert imported_rooms(path) == below


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_the_core_imports_jax_and_numpy_alone(path):
    if room(path) in CORE:
        allowed = {
            "jax",
            "jaxlib",
            "numpy",
            "jaxrot",
            "collections",
            "dataclasses",
            "functools",
            "inspect",
            "math",
            "random",
            "time",
            "types",
            "warnings",
            "typing",
            "zlib",
        }
        if room(path) == "_startup":
            allowed |= {"contextlib", "os", "signal", "sys"}
        assert {name.split(".")[0] for name in imports(path)} <= allowed


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_files_stay_under_250_lines(path):
    assert len(path.read_text().splitlines()) < 250

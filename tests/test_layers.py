"""Imports point one way, the core imports jax and numpy alone, and files stay short."""

import ast
import pathlib
import re
import subprocess
import sys

PACKAGE = pathlib.Path(__file__).parent.parent / "jaxrot"

# Each room may import from the rows above its own, and from its own row.
LAYERS = [
    {"_algebra", "_compiled", "_frozen", "_inputs", "_startup", "families"},
    {"_blocks", "_derivative"},
    {"steps"},
    {"solvers"},
    {"_nearest", "_refine", "_svd"},
    {"_gap", "_jacobian", "_polar"},
    {"_isotropic"},
    {"evaluation"},
    {"_recommend"},
    {"__init__"},
    {"console"},
    {"scenes"},
    {"recommending", "report", "simulate"},
    {"__main__"},
]
CORE = {name for layer in LAYERS[:10] for name in layer}
LEVEL = {name: level for level, layer in enumerate(LAYERS) for name in layer}
FILES = sorted(PACKAGE.rglob("*.py"))

# The core imports jax, jaxlib, numpy, itself, and these modules of Python, which load fast.
STANDARD = {"collections", "dataclasses", "functools", "inspect", "math", "random", "time", "types", "typing"}
STANDARD |= {"importlib", "warnings", "zlib"}
OF_STARTUP = {"contextlib", "os", "signal", "sys"}


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
            # `from jaxrot import _polar` imports a room, `from jaxrot._polar import polar_decomposition` a name in one.
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def imported_rooms(path: pathlib.Path) -> set[str]:
    rooms = {name.split(".")[1] for name in imports(path) if name.startswith("jaxrot.")}
    return {name if name in LEVEL else "__init__" for name in rooms} - {room(path)}


def test_imports_point_one_way_and_files_stay_under_250_lines():
    upwards = {
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in FILES
        for name in imported_rooms(path)
        if LEVEL[name] > LEVEL[room(path)]
    }
    assert not upwards
    assert not {str(path.relative_to(PACKAGE)) for path in FILES if len(path.read_text().splitlines()) >= 250}


def test_the_core_imports_jax_and_numpy_alone_and_nothing_that_measures():
    allowed = {"jax", "jaxlib", "numpy", "jaxrot"} | STANDARD
    foreign = {
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in FILES
        if room(path) in CORE
        for name in imports(path)
        if name.split(".")[0] not in allowed | (OF_STARTUP if room(path) == "_startup" else set())
    }
    assert not foreign
    program = "import sys, jaxrot; print([name for name in sys.modules if name.startswith('jaxrot.')])"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "jaxrot._nearest" in run.stdout
    assert not re.search(r"evaluation|_recommend|report|scenes", run.stdout)

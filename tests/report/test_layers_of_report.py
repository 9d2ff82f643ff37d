"""Inside the report imports point one way: inputs and plan, measurements, what shows them, the command."""

import ast
import graphlib
import pathlib

import jaxrot.report

FOLDER = pathlib.Path(jaxrot.report.__file__).parent
PREFIX = "jaxrot.report."

# A room may import from the rows above its own, and from itself.
ROWS = [
    {"deformed_dragon", "plan"},
    {"inputs"},
    {"peers"},
    {"measure"},
    {"comparison"},
    {"data"},
    {"run", "show"},
    {"command", "readme"},
]
LEVEL = {room: level for level, rooms in enumerate(ROWS) for room in rooms}


def modules():
    """The modules of the report, and those that each imports, without the prefix."""
    paths = [path for path in FOLDER.rglob("*.py") if path != FOLDER / "__init__.py"]
    names = {".".join(path.relative_to(FOLDER).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}
    imported = {}
    for name, path in names.items():
        found = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                # `from jaxrot.report.show import pictures` imports a module, `from ...pictures import METHODS` a name.
                found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        known = {each.removeprefix(PREFIX) for each in found if each.startswith(PREFIX)} & set(names)
        imported[name] = {each for each in known if not any(other.startswith(f"{each}.") for other in known)}
    return imported


def room(module):
    return module.partition(".")[0]


def test_every_room_has_a_row():
    assert {room(module) for module in modules()} == set(LEVEL)


def test_imports_point_one_way():
    against = [
        (module, other)
        for module, others in modules().items()
        for other in others
        if room(other) != room(module) and LEVEL[room(other)] >= LEVEL[room(module)]
    ]
    assert against == []


def test_no_modules_import_each_other():
    order = list(graphlib.TopologicalSorter(modules()).static_order())
    assert order.index("measure.results") < order.index("show.tables") < order.index("command")

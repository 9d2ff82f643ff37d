"""The scenes by name."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from jaxrot.scenes import tetrahedra
from jaxrot.scenes.dragon import dragon, dragon_fine
from jaxrot.scenes.drift import drift
from jaxrot.scenes.drop import drop
from jaxrot.scenes.finite_elements import cantilever, recovery
from jaxrot.scenes.scene import Scene
from jaxrot.scenes.tetrahedron import tetrahedron


class Entry(NamedTuple):
    """A scene that can be run by name."""

    build: Callable[..., Scene]  # Returns the scene, of the mesh if there is one
    read_mesh: Callable[[Path], Any] | None  # Returns what it takes of a user's mesh file; None if it takes none
    summary: str  # One line


SCENES: Mapping[str, Entry] = MappingProxyType(
    {
        "dragon": Entry(dragon, tetrahedra.read_vertices, "clustered shape matching: random vertices find their shape"),
        "dragon_fine": Entry(dragon_fine, None, "the same with 22,998 vertices"),
        "drop": Entry(drop, tetrahedra.read_vertices, "clustered shape matching: a soft body falls onto a block"),
        "cantilever": Entry(cantilever, tetrahedra.read, "co-rotational finite elements: a beam under its weight"),
        "recovery": Entry(recovery, tetrahedra.read, "co-rotational finite elements: an exploded block recovers"),
        "drift": Entry(drift, None, "a million products of rotations, repaired and not"),
        "tetrahedron": Entry(tetrahedron, None, "a tetrahedron pressed through its base, Müller et al. 2016, Fig. 3"),
    }
)

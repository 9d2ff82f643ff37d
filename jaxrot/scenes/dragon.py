"""The Stanford dragon, which recovers its shape: Müller et al. 2016, Fig. 7; see `dragon.txt`."""

from importlib import resources

import numpy as np
from jax.typing import ArrayLike

from jaxrot.scenes.body import build_two_scale_body
from jaxrot.scenes.checks import checked_vertices
from jaxrot.scenes.scene import Scene, body_scene
from jaxrot.scenes.shape_health import health
from jaxrot.scenes.shape_matching import build_parameters, build_state, step


def rest_vertices(*, fine: bool = False) -> np.ndarray:
    """The 5,205 or, if fine, 22,998 vertices at rest, centred and one unit high, the second axis up: shape (n, 3)."""
    file_name = "dragon_fine.npz" if fine else "dragon.npz"
    with resources.files("jaxrot.scenes").joinpath(file_name).open("rb") as file, np.load(file) as archive:
        vertices = archive["vertices"].astype(np.float64)
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    return (vertices - (lower + upper) / 2) / (upper[1] - lower[1])


def standing_vertices(*, fine: bool = False) -> np.ndarray:
    """`rest_vertices` with the third axis up, as scenes are drawn."""
    x, y, z = rest_vertices(fine=fine).T
    return np.stack([x, -z, y], axis=1)


def dragon(mesh_vertices: ArrayLike | None = None) -> Scene:
    """Returns the scene of the dragon, or a body of these vertices, that recovers its shape from random vertices."""
    if mesh_vertices is not None:
        return _recovery("Body", checked_vertices(mesh_vertices), seed=0)
    # Scrambled vertices leave the final orientation to chance. With this seed the dragon ends on its feet, 20° off.
    return _recovery("Stanford dragon", standing_vertices(), seed=23)


def dragon_fine() -> Scene:
    """Returns the scene of the dragon with 22,998 vertices."""
    return _recovery("Stanford dragon", standing_vertices(fine=True), seed=34)


def _recovery(name: str, vertices: np.ndarray, seed: int) -> Scene:
    body = build_two_scale_body(vertices)
    # A low stiffness, so that the recovery is visible: at stiffness 1 it takes only 50 steps.
    parameters = build_parameters(body, stiffness=0.05, damping=0.2)
    scrambled = np.random.default_rng(seed).uniform(vertices.min(axis=0), vertices.max(axis=0), vertices.shape)
    title = f"{name}: {len(vertices):,} scrambled vertices recover their shape"
    return body_scene(title, build_state(body, scrambled), parameters, step, health, steps=240)

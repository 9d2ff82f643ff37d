"""A soft body that falls onto a block and rolls off it: Müller et al. 2016, Fig. 6."""

import functools

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxrot.scenes.body import build_two_scale_body
from jaxrot.scenes.checks import checked_vertices
from jaxrot.scenes.contact import build_contact
from jaxrot.scenes.dragon import standing_vertices
from jaxrot.scenes.scene import Scene, body_scene
from jaxrot.scenes.shape_health import health
from jaxrot.scenes.shape_matching import build_parameters, build_state, step

# In metres, for a body with a diagonal of one metre.
ROOM = ((-1.0, -1.0, 0.0), (1.0, 1.0, 3.0))
BLOCK = ((-0.8, -0.4, -0.1), (-0.1, 0.4, 0.25))


def drop(mesh_vertices: ArrayLike | None = None) -> Scene:
    """Returns the scene of the dragon, or a body of these vertices, dropped onto a block on the ground in a room.

    The body is scaled to a diagonal of 1 m. The third axis of its vertices is up.
    """
    body = build_two_scale_body(_one_metre(standing_vertices() if mesh_vertices is None else mesh_vertices))
    contact = build_contact(ground_height=0.0, box=ROOM, obstacle=BLOCK, restitution=0.1, friction=0.4)
    choices = {"time_step": 1 / 120, "stiffness": 0.3, "damping": 0.05, "gravity": (0.0, 0.0, -9.81)}
    parameters = build_parameters(body, contact=contact, **choices)
    lowest = float(jnp.min(body.rest_positions[:, 2]))
    start = body.rest_positions + jnp.asarray([0.0, 0.0, 0.75 - lowest], body.rest_positions.dtype)[None]
    title = f"A soft {'dragon' if mesh_vertices is None else 'body'} dropped onto a block"
    falling = functools.partial(step, ground=True, box=True, obstacle=True)
    return body_scene(title, build_state(body, start), parameters, falling, health, steps=240)


def _one_metre(vertices: ArrayLike) -> np.ndarray:
    checked = checked_vertices(vertices)
    lower, upper = checked.min(axis=0), checked.max(axis=0)
    diagonal = float(np.linalg.norm(upper - lower))
    if not diagonal:
        raise ValueError(f"vertices must not all be in one place; got {len(checked)} at {lower.tolist()}")
    return (checked - (lower + upper) / 2) / diagonal

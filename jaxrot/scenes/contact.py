"""Contact of points with a ground plane and axis-aligned boxes, by corrections of positions and velocities."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxrot._algebra.scaling import safe_divide, safe_sqrt
from jaxrot._compiled import exportable
from jaxrot.scenes.checks import check

# Lower and upper corner, each of three numbers.
Corners = Sequence[Sequence[float]] | np.ndarray


@exportable
class Contact(NamedTuple):
    """The obstacles, and how points respond to them."""

    ground_height: jax.Array  # Of the ground, whose normal is the third axis, shape (), m
    box: jax.Array  # Lower and upper corner of a box around the points, shape (2, 3), m
    obstacle: jax.Array  # Lower and upper corner of a box that the points must not enter, shape (2, 3), m
    restitution: jax.Array  # The fraction of the normal velocity after an impact, 0 to 1, shape ()
    friction: jax.Array  # Coulomb's coefficient, ≥ 0, shape ()


@exportable
class Motion(NamedTuple):
    """The motion of points."""

    positions: jax.Array  # Shape (n, 3), m
    velocities: jax.Array  # Shape (n, 3), m/s


def build_contact(
    *,
    ground_height: float = -np.inf,
    box: Corners = ((-np.inf,) * 3, (np.inf,) * 3),
    obstacle: Corners = ((np.inf,) * 3, (-np.inf,) * 3),
    restitution: float = 0.0,
    friction: float = 0.5,
    dtype: type = np.float32,
) -> Contact:
    """Returns the obstacles. Those not given are infinitely far away.

    Raises:
        ValueError: An empty box, restitution outside 0 to 1, negative friction, or a NaN.
    """
    corners = np.asarray(box, dtype=np.float64)
    if corners.shape != (2, 3) or not (corners[0] < corners[1]).all():
        raise ValueError(f"box must be a lower and an upper corner, shape (2, 3); got {corners.tolist()}")
    solid = np.asarray(obstacle, dtype=np.float64)
    if solid.shape != (2, 3) or np.isnan(solid).any():
        raise ValueError(f"obstacle must be a lower and an upper corner, shape (2, 3); got {solid.tolist()}")
    if np.isnan(ground_height):
        raise ValueError("ground_height must be a number; got nan")
    check("from 0 to 1", restitution=restitution)
    check("finite and >= 0", friction=friction)
    return Contact(*(jnp.asarray(value, dtype) for value in (ground_height, corners, solid, restitution, friction)))


def stand_on_ground(motion: Motion, contact: Contact) -> Motion:
    """Moves points under the ground onto it."""
    depth = jnp.maximum(contact.ground_height - motion.positions[:, 2], 0)
    zero = jnp.zeros_like(depth)
    return pushed_out(motion, jnp.stack([zero, zero, depth], axis=-1), contact)


def stay_in_box(motion: Motion, contact: Contact) -> Motion:
    """Moves points outside the box to its nearest point."""
    inside = jnp.clip(motion.positions, contact.box[:1], contact.box[1:])
    return pushed_out(motion, inside - motion.positions, contact)


def stay_out_of_obstacle(motion: Motion, contact: Contact) -> Motion:
    """Moves points inside the obstacle to its nearest face."""
    to_lower, to_upper = motion.positions - contact.obstacle[:1], contact.obstacle[1:] - motion.positions
    depth = jnp.minimum(to_lower, to_upper)
    inside = (depth > 0).all(axis=-1, keepdims=True)
    face = jnp.arange(3)[None] == jnp.argmin(depth, axis=-1, keepdims=True)
    out = jnp.where(to_lower < to_upper, -depth, depth)
    return pushed_out(motion, jnp.where(inside & face, out, jnp.zeros_like(out)), contact)


def pushed_out(motion: Motion, displacements: jax.Array, contact: Contact) -> Motion:
    """Moves points by the shortest way out of an obstacle, shape (n, 3), m; 0 for points without contact.

    An inward normal velocity is reversed and multiplied by the restitution. The tangential velocity decreases by the
    friction coefficient times the change of the normal one, at most to 0.
    """
    normals = safe_divide(displacements, jnp.broadcast_to(_lengths(displacements), displacements.shape))
    normal_speeds = jnp.sum(motion.velocities * normals, axis=-1, keepdims=True)
    changes = -(1 + contact.restitution) * jnp.minimum(normal_speeds, 0)
    tangential = motion.velocities - normal_speeds * normals
    speeds = _lengths(tangential)
    lost = safe_divide(jnp.minimum(contact.friction * changes, speeds), speeds)
    return Motion(motion.positions + displacements, motion.velocities + changes * normals - lost * tangential)


def _lengths(vectors: jax.Array) -> jax.Array:
    return safe_sqrt(jnp.sum(vectors**2, axis=-1, keepdims=True))

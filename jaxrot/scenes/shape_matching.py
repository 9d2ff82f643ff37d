"""Clustered shape matching: every cluster draws its vertices to its rest shape, moved and turned to fit them.

Source: Müller et al. 2005, "Meshless deformations based on shape matching"; Müller et al. 2016, sections 1 and 4.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxrot import nearest_rotation, refine_rotation
from jaxrot._compiled import exportable
from jaxrot.scenes.balance import without_momentum
from jaxrot.scenes.body import Body, checked_vertices
from jaxrot.scenes.contact import Contact, Motion, build_contact, stand_on_ground, stay_in_box, stay_out_of_obstacle


@exportable
class State(NamedTuple):
    """What moves.

    Attributes:
        positions: Of the vertices, m, shape (n, 3).
        velocities: Of the vertices, m/s, shape (n, 3).
        rotations: Of the clusters, from rest, shape (c, 3, 3): where the next step starts from.
    """

    positions: jax.Array
    velocities: jax.Array
    rotations: jax.Array


@exportable
class Parameters(NamedTuple):
    """What does not.

    Attributes:
        body: Its shape at rest, its masses, its clusters.
        time_step: s, shape ().
        stiffness: Part of the way to its goal that a vertex goes in a step, 0 to 1, shape ().
        damping: Part of the velocity beside the clusters' rigid motions that a step takes away, 0 to 1, shape ().
        gravity: m/s², shape (3,).
        contact: What the vertices may touch.
    """

    body: Body
    time_step: jax.Array
    stiffness: jax.Array
    damping: jax.Array
    gravity: jax.Array
    contact: Contact


@exportable
class ClusterFit(NamedTuple):
    """How the clusters lie.

    Attributes:
        arms: Places from their cluster's centre of mass, m, shape (c, s, 3).
        matrices: A_pq over the cluster's mass, m², shape (c, 3, 3).
    """

    arms: jax.Array
    matrices: jax.Array


def build_parameters(
    body: Body,
    *,
    time_step: float = 1 / 60,
    stiffness: float = 1.0,
    damping: float = 0.5,
    gravity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    contact: Contact | None = None,
) -> Parameters:
    """Parameters in the dtype of the body.

    Raises:
        ValueError: A time step that is not positive, a stiffness or damping outside 0 to 1, a gravity that is no finite
            vector.
    """
    if not (np.isfinite(time_step) and time_step > 0):
        raise ValueError(f"time_step must be positive and finite; got {time_step}")
    for name, value in (("stiffness", stiffness), ("damping", damping)):
        if not 0 <= value <= 1:
            raise ValueError(f"{name} must be from 0 to 1; got {value}")
    if np.shape(gravity) != (3,) or not np.isfinite(np.asarray(gravity)).all():
        raise ValueError(f"gravity must be three finite numbers; got {gravity}")
    dtype = body.masses.dtype
    h, alpha, c, g = (jnp.asarray(value, dtype) for value in (time_step, stiffness, damping, gravity))
    return Parameters(body, h, alpha, c, g, build_contact(dtype=dtype.type) if contact is None else contact)


def build_state(body: Body, positions: ArrayLike | None = None, velocities: ArrayLike | None = None) -> State:
    """A first state, every rotation the identity.

    Args:
        body: What moves.
        positions: m, shape (n, 3); those at rest if not given.
        velocities: m/s, shape (n, 3); 0 if not given.

    Raises:
        ValueError: Wrong shape, or not finite.
    """
    rest = body.rest_positions
    arrays = [rest if positions is None else positions, jnp.zeros_like(rest) if velocities is None else velocities]
    for name, array in zip(("positions", "velocities"), arrays, strict=True):
        if checked_vertices(array, name).shape != rest.shape:
            raise ValueError(f"{name} must have shape {rest.shape}; got {np.shape(array)}")
    x, v = (jnp.asarray(array, rest.dtype) for array in arrays)
    return State(x, v, jnp.broadcast_to(jnp.eye(3, dtype=rest.dtype), (len(body.members), 3, 3)))


def step(
    state: State,
    parameters: Parameters,
    *,
    rotation_step: str = "torque",
    iterations: int = 3,
    method: str | None = None,
    derivative: str = "implicit",
    damping: bool = True,
    conserve_angular_momentum: bool = True,
    ground: bool = False,
    box: bool = False,
    obstacle: bool = False,
) -> State:
    """The state one time step later; what a static choice switches off is not in the compiled program.

    Velocities change by α (g − x)/h towards the goals g, then positions by the new velocities (2005, eqs. 9 and 10). A
    vertex in several clusters takes the mean of what they want of it.

    Args:
        state: Now.
        parameters: Of the same dtype.
        rotation_step: A name in `jaxrot.STEPS`, for the warm start. Static.
        iterations: How many of them. Static.
        method: A name in `jaxrot.METHODS`: the rotations are computed anew in every step. Static.
        derivative: That of the warm-started rotation, see `refine_rotation`. Static.
        damping: Whether velocities beside each cluster's rigid motion are damped. Static.
        conserve_angular_momentum: Take the torque out of what a cluster wants of its vertices. It has none where its
            rotation has converged; one `torque` iteration lags behind a body that turns, and brakes it. Static.
        ground: Contact with the ground. Static.
        box: Contact with the walls of the box, from inside. Static.
        obstacle: Contact with the obstacle, from outside. Static.

    Returns:
        The next state, dtypes and shapes of `state`: a carry of `lax.scan`.

    Raises:
        ValueError: Unknown step, method or derivative, negative iterations.

    Conservation:
        Of linear momentum always, of angular momentum with `conserve_angular_momentum`: both to 1e-6 in 1,000 free
        steps in float32. Without it to 2e-5 where the rotations converge. Not of energy: damping takes it; undamped
        its mean stays where the rotations converge, and a rotation that lags may pump.

    Limits:
        A `method` that is not for singular matrices gives NaN for a cluster of one vertex, on a line or in a plane.

    Derivative:
        Forward and reverse, with respect to the state and the parameters. That of the rotation is right where it has
        converged; where not, `derivative="unrolled"`.
    """
    body, h = parameters.body, parameters.time_step
    shares = body.shares[..., None]
    fit = fit_clusters(state.positions, body)
    if method is None:
        rotations = refine_rotation(
            fit.matrices, state.rotations, step=rotation_step, iterations=iterations, derivative=derivative
        )
    else:
        rotations = nearest_rotation(fit.matrices, method=method)
    # Divided last: a quotient XLA:CPU computes once, a product anew for every sum that it goes into.
    changes = parameters.stiffness * (turned_offsets(rotations, body) - fit.arms) / h
    drag = -parameters.damping * state.velocities[body.members] if damping else None
    if conserve_angular_momentum:
        changes = without_momentum(changes if drag is None else changes + drag, fit.arms, shares)
    else:
        # The centre of mass is rounded to eps of its distance from the origin, and divided by h that is a push.
        changes = changes - jnp.sum(shares * changes, axis=1, keepdims=True)
        changes = changes if drag is None else changes + without_momentum(drag, fit.arms, shares)
    velocities = state.velocities + mean_over_clusters(changes, body) + (h * parameters.gravity)[None]
    motion = Motion(state.positions + h * velocities, velocities)
    for switched_on, answer in ((ground, stand_on_ground), (box, stay_in_box), (obstacle, stay_out_of_obstacle)):
        if switched_on:
            motion = answer(motion, parameters.contact)
    return State(motion.positions, motion.velocities, rotations)


def fit_clusters(positions: jax.Array, body: Body) -> ClusterFit:
    """A_pq = Σ w (x − x̄) qᵀ of every cluster, over its mass (2005, eq. 7)."""
    shares = body.shares[..., None]
    places = positions[body.members]
    arms = places - jnp.sum(shares * places, axis=1, keepdims=True)
    return ClusterFit(arms, jnp.sum((shares * arms)[..., :, None] * body.offsets[..., None, :], axis=1))


def turned_offsets(rotations: jax.Array, body: Body) -> jax.Array:
    """The places at rest, turned as their clusters are: shape (c, s, 3)."""
    return jnp.sum(rotations[:, None] * body.offsets[..., None, :], axis=-1)


def mean_over_clusters(changes: jax.Array, body: Body) -> jax.Array:
    """What the clusters of every vertex want of it, on average: (c, s, 3) to (n, 3)."""
    # A gather through the table of places: a scatter takes XLA:CPU several times as long, and its sums have no order.
    rows = changes.reshape(-1, 3)
    nowhere = jnp.zeros((1, 3), changes.dtype)
    gathered = jnp.concatenate([rows, nowhere])[body.places]
    return jnp.sum(gathered, axis=1) / body.cluster_counts[:, None]

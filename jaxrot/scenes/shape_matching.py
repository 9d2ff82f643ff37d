"""Clustered shape matching: every cluster moves its vertices towards its rest shape, fitted to them.

A step changes velocities by α (g − x)/h for goals g, then positions by the new velocities (2005, eqs. 9 and 10). A
vertex takes the mean change of its clusters.

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
from jaxrot.scenes.body import Body
from jaxrot.scenes.checks import check, check_gravity, checked_vertices
from jaxrot.scenes.contact import Contact, Motion, build_contact, stand_on_ground, stay_in_box, stay_out_of_obstacle
from jaxrot.scenes.incidence import sum_at_vertices
from jaxrot.scenes.scene import BodyState as State


@exportable
class Parameters(NamedTuple):
    """The parameters, which a step does not change."""

    body: Body  # The shape at rest, the masses and the clusters
    time_step: jax.Array  # Shape (), s
    stiffness: jax.Array  # The fraction of the way to its goal that a vertex moves in a step, 0 to 1, shape ()
    damping: jax.Array  # The fraction a step removes of velocities relative to the clusters' rigid motions, 0 to 1
    gravity: jax.Array  # Shape (3,), m/s²
    contact: Contact  # The obstacles, and how vertices respond to them


@exportable
class ClusterFit(NamedTuple):
    """The positions of the vertices relative to their clusters, and the matrices whose rotations are extracted."""

    arms: jax.Array  # Places from their cluster's centre of mass, shape (c, s, 3), m
    matrices: jax.Array  # A_pq over the cluster's mass, shape (c, 3, 3), m²


def build_parameters(
    body: Body,
    *,
    time_step: float = 1 / 60,
    stiffness: float = 1.0,
    damping: float = 0.5,
    gravity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    contact: Contact | None = None,
) -> Parameters:
    """Returns parameters in the dtype of the body.

    Raises:
        ValueError: A time step that is not positive, a stiffness or damping outside 0 to 1, a gravity that is no finite
            vector.
    """
    check("finite and > 0", time_step=time_step)
    check("from 0 to 1", stiffness=stiffness, damping=damping)
    check_gravity(gravity)
    dtype = body.masses.dtype
    h, alpha, c, g = (jnp.asarray(value, dtype) for value in (time_step, stiffness, damping, gravity))
    return Parameters(body, h, alpha, c, g, build_contact(dtype=dtype.type) if contact is None else contact)


def build_state(body: Body, positions: ArrayLike | None = None, velocities: ArrayLike | None = None) -> State:
    """Returns the first state, with identity rotations; at rest if positions and velocities are not given.

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
    """Returns the state one time step later, by shape matching of clusters.

    All options are static; the program leaves out what is off.

    Args:
        state: The state now.
        parameters: Of the same dtype.
        rotation_step: A name in `jaxrot.STEPS`, for the warm start.
        iterations: The number of these steps.
        method: A name in `jaxrot.METHODS`, from a cold start instead.
        derivative: See `refine_rotation`.
        damping: Damp velocities relative to each cluster's rigid motion.
        conserve_angular_momentum: Remove the torque from each cluster's changes. It is 0 for a converged rotation; one
            `torque` iteration lags behind a body that turns, and brakes it.
        ground: Contact with the ground.
        box: Contact with the walls of the box, from inside.
        obstacle: Contact with the obstacle, from outside.

    Returns:
        The next state, a carry of `lax.scan`. A `method` that is not for singular matrices gives NaN for a cluster in a
        plane, on a line or in one point.

    Raises:
        ValueError: Unknown step, method or derivative, negative iterations.

    Derivative:
        Forward and reverse, with respect to state and parameters. Right if the rotations have converged, otherwise with
        `derivative="unrolled"`.

    Accuracy:
        Linear momentum is conserved, angular momentum with `conserve_angular_momentum`: to 1e-6 in 1,000 free float32
        steps. Otherwise angular momentum is conserved to 2e-5 if the rotations converge. Damping removes energy.
        Undamped, the mean energy is constant if the rotations converge; a rotation that lags may add energy.

    Example:
        >>> import jax.numpy as jnp, numpy as np
        >>> from jaxrot.scenes import body, shape_matching
        >>> cube = body.build_body(np.array(list(np.ndindex(2, 2, 2))), [range(8)])
        >>> stretched = shape_matching.build_state(cube, cube.rest_positions * jnp.array([[1.2, 1.0, 1.0]]))
        >>> after = shape_matching.step(stretched, shape_matching.build_parameters(cube))
        >>> [round(x, 3) for x in jnp.ptp(after.positions, axis=0).tolist()]
        [1.0, 1.0, 1.0]
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
    # The division comes last: XLA:CPU computes a quotient once, but recomputes a product for every sum that uses it.
    changes = parameters.stiffness * (turned_offsets(rotations, body) - fit.arms) / h
    drag = -parameters.damping * state.velocities[body.members] if damping else None
    if conserve_angular_momentum:
        changes = without_momentum(changes if drag is None else changes + drag, fit.arms, shares)
    else:
        # Remove the mean. The centre of mass is rounded to eps of its distance from the origin; divided by h, that
        # error would push the whole cluster.
        changes = changes - jnp.sum(shares * changes, axis=1, keepdims=True)
        changes = changes if drag is None else changes + without_momentum(drag, fit.arms, shares)
    velocities = state.velocities + mean_over_clusters(changes, body) + (h * parameters.gravity)[None]
    motion = Motion(state.positions + h * velocities, velocities)
    for switched_on, answer in ((ground, stand_on_ground), (box, stay_in_box), (obstacle, stay_out_of_obstacle)):
        if switched_on:
            motion = answer(motion, parameters.contact)
    return State(motion.positions, motion.velocities, rotations)


def fit_clusters(positions: jax.Array, body: Body) -> ClusterFit:
    """Returns A_pq = Σ w (x − x̄) qᵀ of every cluster, divided by its mass (2005, eq. 7)."""
    shares = body.shares[..., None]
    places = positions[body.members]
    arms = places - jnp.sum(shares * places, axis=1, keepdims=True)
    return ClusterFit(arms, jnp.sum((shares * arms)[..., :, None] * body.offsets[..., None, :], axis=1))


def turned_offsets(rotations: jax.Array, body: Body) -> jax.Array:
    """Returns the offsets at rest, rotated with their clusters, shape (c, s, 3)."""
    return jnp.sum(rotations[:, None] * body.offsets[..., None, :], axis=-1)


def mean_over_clusters(changes: jax.Array, body: Body) -> jax.Array:
    """Returns for every vertex the mean of the changes in its clusters: (c, s, 3) to (n, 3)."""
    return sum_at_vertices(changes, body.places) / body.cluster_counts[:, None]

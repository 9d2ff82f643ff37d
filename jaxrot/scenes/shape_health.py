"""Monitored scalars of a body of clusters: energies, momenta, rotations and shape."""

import jax
import jax.numpy as jnp

from jaxrot import nearest_rotation, rotation_gap
from jaxrot._algebra.scaling import safe_divide
from jaxrot.scenes.balance import cross
from jaxrot.scenes.rotations import orthonormality_error
from jaxrot.scenes.shape_matching import Parameters, State, fit_clusters, turned_offsets


def health(state: State, parameters: Parameters) -> dict[str, jax.Array]:
    """Returns energies, momenta, the smallest gap and worst defect of the rotations, and the error of the shape.

    The elastic energy is α/(2h²) Σ m |g − x|²; its gradient is the force towards the goals. The angular momentum is
    about the centre of mass.
    """
    body = parameters.body
    masses = body.masses[:, None]
    total = jnp.sum(masses)
    momentum = jnp.sum(masses * state.velocities, axis=0)
    centre = jnp.sum(masses * state.positions, axis=0) / total
    arms, relative = state.positions - centre[None], state.velocities - (momentum / total)[None]
    fit = fit_clusters(state.positions, body)
    away = jnp.sum((turned_offsets(state.rotations, body) - fit.arms) ** 2, axis=-1)
    part = body.masses / body.cluster_counts
    elastic = jnp.sum(jnp.where(body.shares > 0, part[body.members], jnp.zeros_like(body.shares)) * away)
    return {
        "kinetic energy (J)": 0.5 * jnp.sum(masses * state.velocities**2),
        "elastic energy (J)": 0.5 * parameters.stiffness / parameters.time_step**2 * elastic,
        "linear momentum (kg m/s)": _length(momentum),
        "angular momentum (kg m²/s)": _length(jnp.sum(masses * cross(arms, relative), axis=0)),
        "smallest rotation gap": jnp.min(rotation_gap(fit.matrices)),
        "worst orthogonality": jnp.max(orthonormality_error(state.rotations)),
        "shape error (of the diagonal)": shape_error(state.positions, body.rest_positions),
    }


def shape_error(positions: jax.Array, rest_positions: jax.Array) -> jax.Array:
    """The RMS distance from the best fit of the shape at rest, divided by the diagonal of its bounding box."""
    x = positions - jnp.mean(positions, axis=0, keepdims=True)
    q = rest_positions - jnp.mean(rest_positions, axis=0, keepdims=True)
    rotation = nearest_rotation(jnp.sum(x[:, :, None] * q[:, None, :], axis=0))
    turned = jnp.sum(rotation[None] * q[:, None, :], axis=-1)
    diagonal = jnp.sqrt(jnp.sum((jnp.max(q, axis=0) - jnp.min(q, axis=0)) ** 2))
    return jnp.sqrt(jnp.mean(jnp.sum((x - turned) ** 2, axis=-1))) / diagonal


def _length(vector: jax.Array) -> jax.Array:
    # Divide by the largest component first: the square of a momentum overflows long before the momentum does.
    largest = jnp.max(jnp.abs(vector))
    return largest * jnp.sqrt(jnp.sum(safe_divide(vector, jnp.broadcast_to(largest, vector.shape)) ** 2))

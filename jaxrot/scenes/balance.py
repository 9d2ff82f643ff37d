"""Changes of velocity inside a cluster that conserve its linear and angular momentum."""

import jax
import jax.numpy as jnp

from jaxrot._algebra import ldl, mat3
from jaxrot._algebra.scaling import safe_divide

# A cluster on a line has no inertia about that line, and its matrix is singular. This many eps of the trace are added.
_SHIFT = 8

# One pass leaves 4e-8 of the linear and 4e-7 of the angular momentum, the same in every step. In 1,000 steps that adds
# up to 1e-4. The second pass removes the rest.
_PASSES = 2


def without_momentum(changes: jax.Array, arms: jax.Array, shares: jax.Array) -> jax.Array:
    """Returns changes u of velocity without their rigid part, u − ū − ω×r with ω = I⁻¹ Σ w r×u, shape (c, s, 3).

    They change no momentum of their cluster: Σ w u = 0 and Σ w r×u = 0, to rounding. The arms r lead from the centre of
    mass, shape (c, s, 3). The shares w are the fractions of the cluster's mass, shape (c, s, 1).

    Source: Müller et al. 2007, "Position based dynamics", section 3.5, for velocities.
    """
    second_moment = jnp.sum((shares * arms)[..., :, None] * arms[..., None, :], axis=1)
    for _ in range(_PASSES):
        changes = changes - jnp.sum(shares * changes, axis=1, keepdims=True)
        spin = _angular_velocity(second_moment, jnp.sum(shares * cross(arms, changes), axis=1))
        changes = changes - cross(spin[:, None], arms)
    return changes


def cross(u: jax.Array, v: jax.Array) -> jax.Array:
    """The vector product u × v along the last axis."""
    (ux, uy, uz), (vx, vy, vz) = (jnp.moveaxis(x, -1, 0) for x in (u, v))
    return jnp.stack(mat3.cross((ux, uy, uz), (vx, vy, vz)), axis=-1)


def _angular_velocity(second_moment: jax.Array, angular_momentum: jax.Array) -> jax.Array:
    """I⁻¹ L with the inertia I = tr(M)·1 − M of the second moment M = Σ w r rᵀ; 0 for points that coincide."""
    m = mat3.components(second_moment)
    trace = mat3.trace(m)
    # Divide the inertia by the trace: the result has no unit, and is 0 if all points coincide.
    inertia = jax.tree.map(lambda entry: safe_divide(entry, trace), mat3.gap_matrix(m))
    shift = jnp.full_like(trace, _SHIFT * float(jnp.finfo(trace.dtype).eps))
    x, y, z = (safe_divide(angular_momentum[..., i], trace) for i in range(3))
    return jnp.stack(ldl.solve(mat3.add_to_diagonal(inertia, shift), (x, y, z)), axis=-1)

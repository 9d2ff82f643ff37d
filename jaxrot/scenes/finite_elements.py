"""The scenes of co-rotational finite elements, and their monitored scalars."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from jaxrot import signed_singular_values
from jaxrot._algebra.scaling import safe_divide
from jaxrot.scenes import corotational, tetrahedra
from jaxrot.scenes.corotational import Parameters, State
from jaxrot.scenes.elasticity import deformation_gradients
from jaxrot.scenes.rotations import orthonormality_error
from jaxrot.scenes.scene import Scene, body_scene

_DENSITY = 1000.0
_GRAVITY = 9.81


def health(state: State, parameters: Parameters, *, is_clamped: bool = False) -> dict[str, jax.Array]:
    """Returns energies, the linear momentum if it is conserved, and the worst gap and orthogonality of the elements."""
    elements = parameters.elements
    s = signed_singular_values(deformation_gradients(state.positions, elements))
    shear = elements.shear_modulus * jnp.sum((s - 1) ** 2, axis=-1)
    density = shear + 0.5 * elements.lame_first * (jnp.sum(s, axis=-1) - 3) ** 2
    squares = jnp.sum(state.velocities**2, axis=-1)
    momentum = jnp.sum(parameters.masses[:, None] * state.velocities, axis=0)
    # A clamp takes up momentum.
    conserved = {} if is_clamped else {"linear momentum (kg m/s)": jnp.sqrt(jnp.sum(momentum**2))}
    return {
        "kinetic energy (J)": 0.5 * jnp.sum(parameters.masses * squares),
        "elastic energy (J)": jnp.sum(elements.volumes * density),
        **conserved,
        # The gap of an element with all vertices at one point is 0: it determines no rotation.
        "smallest rotation gap (1)": jnp.min(safe_divide(s[:, 1] + s[:, 2], s[:, 0])),
        "worst orthogonality of R (1)": jnp.max(orthonormality_error(state.rotations)),
        "inverted elements (1)": jnp.sum(s[:, 2] <= 0).astype(s.dtype),
    }


def cantilever(mesh: tuple[np.ndarray, np.ndarray] | None = None) -> Scene:
    """Returns the scene of a beam that is clamped at its lower end along the first axis, and bends by its own weight.

    `mesh` is another body in metres. Its stiffness is such that a beam of these lengths sags by about its length. The
    time step fits its size.
    """
    body = tetrahedra.box((20, 3, 3), (2.0, 0.3, 0.3)) if mesh is None else tetrahedra.checked(*mesh)
    lower, size = body.vertices.min(axis=0), np.ptp(body.vertices, axis=0)
    length, height = size[0], size[2]
    fixed = body.vertices[:, 0] <= lower[0] + 0.02 * length
    time_step = 0.037 * (length / _GRAVITY) ** 0.5
    state, parameters = corotational.build(
        *body,
        # By Euler and Bernoulli the deflection would be 1.5 times the length.
        young=_DENSITY * _GRAVITY * length**3 / height**2,
        density=_DENSITY,
        time_step=time_step,
        damping=0.02 / time_step,
        fixed=fixed,
    )
    title = "Cantilever of co-rotational finite elements"
    step = functools.partial(corotational.step, rotation="newton", iterations=1, tolerance=1e-3)
    clamped_health = functools.partial(health, is_clamped=True)
    return body_scene(title, state, parameters, step, clamped_health, 150, lines=tetrahedra.surface_edges(body))


def recovery(mesh: tuple[np.ndarray, np.ndarray] | None = None) -> Scene:
    """Returns the scene of a free block that recovers its shape from random vertices, half of the elements inverted.

    `mesh` is another body in metres, instead of a cube of 1 m.
    """
    body = tetrahedra.box((6, 6, 6), (1.0, 1.0, 1.0)) if mesh is None else tetrahedra.checked(*mesh)
    lower, size = body.vertices.min(axis=0), np.ptp(body.vertices, axis=0)
    young, time_step = 1e5, 1 / 60
    state, parameters = corotational.build(
        *body,
        young=young,
        # A sound wave crosses the body in some 10 steps, whatever its size.
        density=young * (10 * time_step / size.max()) ** 2,
        time_step=time_step,
        damping=2.0,
    )
    scattered = lower + size * np.random.default_rng(0).uniform(-0.5, 1.5, body.vertices.shape)
    state = state._replace(positions=jnp.asarray(scattered, state.positions.dtype))
    title = "A scattered block recovers its shape"
    step = functools.partial(corotational.step, conjugate_gradients=30, tolerance=1e-3, gravity=False)
    return body_scene(title, state, parameters, step, health, 160, lines=tetrahedra.surface_edges(body))

"""Co-rotational linear finite elements in time: implicit Euler and implicit midpoint.

Each step minimises (1 + α h)/(2 h²) ‖u‖²_M − uᵀM(v/h + g) + E(x + u) over the displacement u, by Newton's method.

Sources: Müller and Gross 2004; Chao et al. 2010; Gast et al. 2015 (the step as a minimum).
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxrot import METHODS, STEPS
from jaxrot._compiled import exportable
from jaxrot.scenes import elasticity
from jaxrot.scenes import tetrahedra as meshes
from jaxrot.scenes.checks import check, check_gravity
from jaxrot.scenes.elasticity import Elements
from jaxrot.scenes.incidence import incidence
from jaxrot.scenes.newton import Choices, Problem, minimise
from jaxrot.scenes.scene import BodyState as State

INTEGRATORS = ("euler", "midpoint")
TANGENTS = ("exact", "held", "projected")


@exportable
class Parameters(NamedTuple):
    """The parameters, which a step does not change."""

    elements: Elements  # The elements and their stiffness
    masses: jax.Array  # Shape (n,), kg
    free: jax.Array  # 1 for a vertex that moves, 0 for a fixed one, shape (n,)
    gravity: jax.Array  # Shape (3,), m/s²
    damping: jax.Array  # α of a drag −α M v, shape (), 1/s
    time_step: jax.Array  # h, shape (), s


def build(
    vertices: np.ndarray,
    tetrahedra: np.ndarray,
    *,
    young: float | np.ndarray,
    poisson: float = 0.3,
    density: float = 1000.0,
    time_step: float = 1 / 60,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
    damping: float = 0.0,
    fixed: np.ndarray | None = None,
    dtype: str = "float32",
) -> tuple[State, Parameters]:
    """Returns the state at rest, and the parameters.

    Args:
        vertices: At rest, shape (n, 3), m.
        tetrahedra: Vertex indices, shape (m, 4), of either orientation.
        young: Young's modulus, a number or shape (m,), Pa.
        poisson: Poisson's ratio, above -1 and below 1/2.
        density: kg/m³.
        time_step: s.
        gravity: m/s².
        damping: 1/s, of a drag proportional to mass.
        fixed: Which vertices do not move, bool of shape (n,); none if not given.
        dtype: "float32" or "float64".

    Raises:
        ValueError: An unusable mesh, a parameter that is not finite or has the wrong sign.
    """
    mesh = meshes.checked(vertices, tetrahedra)
    check("finite and > 0", young=young, density=density, time_step=time_step)
    check("finite and >= 0", damping=damping)
    check_gravity(gravity)
    if not -1 < poisson < 0.5:
        raise ValueError(f"poisson must be above -1 and below 1/2; got {poisson}")
    held = np.zeros(len(mesh.vertices), dtype=bool) if fixed is None else np.asarray(fixed)
    if held.shape != (len(mesh.vertices),) or held.dtype != np.bool_:
        raise ValueError(f"fixed must be bool of shape ({len(mesh.vertices)},); got {held.dtype} of {held.shape}")
    count = len(mesh.tetrahedra)
    array = functools.partial(jnp.asarray, dtype=dtype)
    shear_modulus, lame_first = elasticity.lame_parameters(np.broadcast_to(young, (count,)), poisson)
    elements = Elements(
        corners=jnp.asarray(mesh.tetrahedra),
        incidence=jnp.asarray(incidence(mesh.tetrahedra, len(mesh.vertices))[0]),
        rest_inverses=array(np.linalg.inv(meshes.edge_matrices(mesh))),
        volumes=array(meshes.volumes(mesh)),
        shear_modulus=array(shear_modulus),
        lame_first=array(lame_first),
    )
    parameters = Parameters(
        elements=elements,
        masses=array(meshes.lumped_masses(mesh, density)),
        free=array(~held),
        gravity=array(np.asarray(gravity)),
        damping=array(damping),
        time_step=array(time_step),
    )
    positions = array(mesh.vertices)
    identity = jnp.broadcast_to(jnp.eye(3, dtype=dtype), (count, 3, 3))
    return State(positions, jnp.zeros_like(positions), identity), parameters


def step(
    state: State,
    parameters: Parameters,
    *,
    integrator: str = "euler",
    rotation: str = "torque",
    iterations: int | None = 3,
    tangent: str = "held",
    newton_iterations: int = 1,
    line_search: int = 0,
    conjugate_gradients: int = 100,
    tolerance: float = 1e-5,
    gravity: bool = True,
) -> State:
    """Returns the state one time step later, by co-rotational finite elements.

    All options are static. The compiled program leaves out what they turn off.

    Args:
        state: The state.
        parameters: The parameters.
        integrator: "euler" loses energy, more with a larger time step; "midpoint" does not.
        rotation: A name in `jaxrot.STEPS`, or, if `iterations` is None, in `jaxrot.METHODS`.
        iterations: Steps of `rotation` from the rotation in the state, at every evaluation of the force. 0 keeps the
            state's rotations, which from the identity is linear elasticity. None: a cold start.
        tangent: "held" treats the rotations as constant. "exact" includes their derivative: Newton's method converges
            quadratically near a stable equilibrium. "projected" is "exact" made positive semidefinite, for large
            deformations.
        newton_iterations: At least 1.
        line_search: How many times the Newton step may be halved until the potential does not increase.
        conjugate_gradients: The largest number of iterations of a linear solve.
        tolerance: Of a linear solve, relative to the right-hand side.
        gravity: Whether there is gravity.

    Raises:
        ValueError: An unknown option.

    Derivative:
        Forward and reverse, with respect to the state and the parameters.

    Example:
        >>> from jaxrot.scenes import corotational, tetrahedra
        >>> cube = tetrahedra.box((1, 1, 1), (1.0, 1.0, 1.0))
        >>> state, parameters = corotational.build(*cube, young=1e5, time_step=0.1)
        >>> round(corotational.step(state, parameters).velocities[:, 2].mean().item(), 2)
        -0.98
    """
    choices = Choices(rotation, iterations, tangent, newton_iterations, line_search, conjugate_gradients, tolerance)
    _check_choices(integrator, choices)
    # The midpoint rule is a step of implicit Euler to the middle of the time step; the second half mirrors the first.
    midpoint = integrator == "midpoint"
    seconds = 0.5 * parameters.time_step if midpoint else parameters.time_step
    problem = euler_problem(state, parameters, seconds, gravity=gravity)
    displacement, rotations = minimise(problem, state.rotations, choices)
    velocities = displacement / seconds
    if midpoint:
        displacement, velocities = 2 * displacement, 2 * velocities - state.velocities
    return State(state.positions + displacement, velocities, rotations)


def euler_problem(state: State, parameters: Parameters, seconds: jax.Array, *, gravity: bool = True) -> Problem:
    """Returns the potential whose minimum is a step of implicit Euler, for `newton.minimise` and `newton.residuals`.

    Source: Gast et al. 2015.
    """
    push = state.velocities / seconds
    if gravity:
        push = push + jnp.broadcast_to(parameters.gravity, push.shape)
    return Problem(
        elements=parameters.elements,
        start=state.positions,
        inertia=parameters.masses * ((1 + parameters.damping * seconds) / seconds**2),
        load=parameters.masses[:, None] * push,
        free=parameters.free,
    )


def _check_choices(integrator: str, choices: Choices) -> None:
    if integrator not in INTEGRATORS:
        raise ValueError(f"integrator must be one of {', '.join(INTEGRATORS)}; got {integrator!r}")
    if choices.tangent not in TANGENTS:
        raise ValueError(f"tangent must be one of {', '.join(TANGENTS)}; got {choices.tangent!r}")
    registry = METHODS if choices.iterations is None else STEPS
    if choices.rotation not in registry:
        kind = "method" if choices.iterations is None else "step"
        raise ValueError(f"rotation must be a {kind}, one of {', '.join(sorted(registry))}; got {choices.rotation!r}")
    if choices.iterations == 0 and choices.tangent != "held":
        raise ValueError("tangent must be 'held' where iterations is 0: such rotations have no derivative")
    if choices.newton_iterations < 1 or choices.conjugate_gradients < 1 or choices.line_search < 0:
        raise ValueError("newton_iterations and conjugate_gradients must be >= 1, line_search >= 0")

"""Minimisation of inertia and elastic energy by Newton's method with matrix-free conjugate gradients."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jax.scipy.sparse.linalg import cg

from jaxrot._compiled import exportable
from jaxrot.scenes import elasticity
from jaxrot.scenes.elasticity import Elements


class Choices(NamedTuple):
    """The static options of the solver, see `corotational.step`."""

    rotation: str = "torque"
    iterations: int | None = 3
    tangent: str = "held"
    newton_iterations: int = 1
    line_search: int = 0
    conjugate_gradients: int = 100
    tolerance: float = 1e-5


@exportable
class Problem(NamedTuple):
    """The potential ½ Σ c |u|² − uᵀf + E(x + u) of a displacement u."""

    elements: Elements  # The elements, with the energy E
    start: jax.Array  # x, shape (n, 3), m
    inertia: jax.Array  # c, shape (n,), kg/s²
    load: jax.Array  # f, shape (n, 3), N
    free: jax.Array  # 1 for a vertex that moves, 0 for a fixed one, shape (n,)


def minimise(problem: Problem, rotations: jax.Array, choices: Choices) -> tuple[jax.Array, jax.Array]:
    """Returns the displacement after a fixed number of Newton iterations from 0, and the rotations at the last one."""
    if choices.newton_iterations == 1:
        return _newton_iteration(problem, jnp.zeros_like(problem.start), rotations, choices)[:2]
    return _iterate(problem, rotations, choices)[0]


def residuals(problem: Problem, rotations: jax.Array, choices: Choices) -> jax.Array:
    """Returns the norm of the potential's gradient before each iteration, shape (newton_iterations,), N."""
    return _iterate(problem, rotations, choices)[1]


def _iterate(problem: Problem, rotations: jax.Array, choices: Choices) -> tuple[tuple[jax.Array, jax.Array], jax.Array]:
    def iteration(carry: tuple[jax.Array, jax.Array], _: None) -> tuple[tuple[jax.Array, jax.Array], jax.Array]:
        displacement, rotations, force = _newton_iteration(problem, *carry, choices)
        return (displacement, rotations), jnp.sqrt(jnp.sum(force**2))

    return lax.scan(iteration, (jnp.zeros_like(problem.start), rotations), length=choices.newton_iterations)


def _newton_iteration(
    problem: Problem, displacement: jax.Array, rotations: jax.Array, choices: Choices
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Returns the next displacement, and the rotations and the force at the present one."""
    elements = problem.elements
    gradients = elasticity.deformation_gradients(problem.start + displacement, elements)
    rotations = _rotations(gradients, rotations, choices)
    if choices.tangent == "held":
        tangent = elasticity.held_tangent(rotations, elements)
    elif choices.tangent == "exact":
        tangent = elasticity.exact_tangent(gradients, rotations, elements)
    else:
        tangent = elasticity.projected_tangent(gradients, rotations, elements)

    def stiffness(direction: jax.Array) -> jax.Array:
        stress_dot = tangent(elasticity.deformation_gradients(direction, elements))
        return problem.inertia[:, None] * direction + elasticity.nodal_gradient(stress_dot, elements)

    internal = elasticity.nodal_gradient(elasticity.stress(gradients, rotations, elements), elements)
    force = problem.free[:, None] * (problem.load - problem.inertia[:, None] * displacement - internal)
    change = _solve(stiffness, force, problem, choices)
    if choices.line_search:
        change = change * _step_length(problem, displacement, change, rotations, choices)
    return displacement + change, rotations, force


def _rotations(gradients: jax.Array, rotations: jax.Array, choices: Choices) -> jax.Array:
    return elasticity.element_rotations(gradients, rotations, rotation=choices.rotation, iterations=choices.iterations)


def _solve(
    stiffness: Callable[[jax.Array], jax.Array], force: jax.Array, problem: Problem, choices: Choices
) -> jax.Array:
    """Returns the displacement by conjugate gradients, preconditioned with the square root of the diagonal.

    The unknowns and the right-hand side are scaled to the size 1. The squares of forces of 1e11 N, or of lengths in
    nanometres, are outside the range of float32. The scales cancel, so they are not differentiated.
    """
    diagonal = problem.inertia + elasticity.stiffness_diagonal(problem.elements)
    scale = lax.stop_gradient(problem.free / jnp.sqrt(diagonal))[:, None]
    fixed = 1 - problem.free[:, None]
    right = scale * force
    largest = lax.stop_gradient(jnp.max(jnp.abs(right)))
    size = jnp.where(largest > 0, largest, jnp.ones_like(largest))

    def product(scaled: jax.Array) -> jax.Array:
        return scale * stiffness(scale * scaled) + fixed * scaled

    solution, _ = cg(product, right / size, tol=choices.tolerance, maxiter=choices.conjugate_gradients)
    return scale * (solution * size)


def _step_length(
    problem: Problem, displacement: jax.Array, change: jax.Array, rotations: jax.Array, choices: Choices
) -> jax.Array:
    """Returns the largest of 1, ½, ¼, … at which the potential does not increase, or the smallest if it always does."""

    def potential(length: jax.Array) -> tuple[jax.Array, jax.Array]:
        total = displacement + length * change
        gradients = elasticity.deformation_gradients(problem.start + total, problem.elements)
        elastic = elasticity.energy(gradients, _rotations(gradients, rotations, choices), problem.elements)
        inertia = 0.5 * jnp.sum(problem.inertia[:, None] * total**2)
        load = jnp.sum(total * problem.load)
        return inertia - load + elastic, inertia + jnp.abs(load) + elastic

    lengths = 0.5 ** jnp.arange(choices.line_search + 1).astype(change.dtype)
    before, magnitude = potential(jnp.zeros_like(lengths[0]))
    after, _ = lax.map(potential, lengths)
    # Allow an increase within rounding: near the minimum the potential changes by less, and the full step is right.
    allowed = before + 32 * jnp.finfo(change.dtype).eps * magnitude
    accepted = after <= allowed
    return jnp.where(jnp.any(accepted), lengths[jnp.argmax(accepted)], lengths[-1])

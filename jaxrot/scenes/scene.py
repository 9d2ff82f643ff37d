"""The interface of a scene, for the command, the notebooks and the tests."""

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxrot._compiled import exportable

State = Any  # a NamedTuple of arrays, the scene's own


class Scene(NamedTuple):
    """A scene ready to run: its first state, and pure functions of a state."""

    title: str  # One line, the title of its pictures
    state: State  # The first state
    step: Callable[[State], State]  # With parameters and static options bound: a valid body for `lax.scan`
    health: Callable[[State], Mapping[str, jax.Array]]  # The monitored scalars by name: "kinetic energy (J)"
    points: Callable[[State], jax.Array]  # The points to draw, shape (n, 3), the third axis up
    step_seconds: float  # Simulated seconds a step
    steps: int  # The number of steps that shows the effect of the scene
    # Pairs of point indices to draw as lines, shape (m, 2). If there are none, the points are drawn.
    lines: np.ndarray = np.empty((0, 2), dtype=np.intp)


@exportable
class BodyState(NamedTuple):
    """The state of a deformable body of n vertices and c clusters or elements."""

    positions: jax.Array  # Of the vertices, shape (n, 3), m
    velocities: jax.Array  # Of the vertices, shape (n, 3), m/s
    rotations: jax.Array  # Of the clusters or elements, from rest, shape (c, 3, 3): the warm start of the next step


def body_scene(
    title: str, state: BodyState, parameters: Any, step: Callable, health: Callable, steps: int, **drawn: np.ndarray
) -> Scene:
    """Returns the scene of a body, drawn at its vertices. `step` and `health` take the state and the parameters."""
    bound = {"parameters": parameters}
    return Scene(
        title=title,
        state=state,
        step=functools.partial(step, **bound),
        health=functools.partial(health, **bound),
        points=lambda state: state.positions,
        step_seconds=float(parameters.time_step),
        steps=steps,
        **drawn,
    )


def flops(function: Callable[..., Any], *arguments: Any) -> float:
    """Returns the number of floating-point operations that XLA counts in the compiled function.

    It shows what a static option leaves out. A loop counts once, whatever its number of iterations.
    """
    cost = jax.jit(function).lower(*arguments).compile().cost_analysis() or {}
    return float(cost["flops"])

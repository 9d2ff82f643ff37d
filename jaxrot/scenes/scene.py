"""The interface of a scene, for the command, the notebooks and the tests."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

# The limit for a vertex, in any unit. Volumes of larger bodies overflow in float64, and LAPACK may hang on an infinity.
LARGEST_COORDINATE = 1e100

State = Any  # a NamedTuple of arrays, the scene's own


class Scene(NamedTuple):
    """A scene ready to run: its first state, and pure functions of a state.

    Attributes:
        title: One line, the title of its pictures.
        state: The first state.
        step: State to state: pure, with parameters and static options bound. A valid body for `lax.scan`.
        health: State to the scalars that are monitored, by name. Each name ends with the unit: "kinetic energy (J)".
        points: State to the points to draw, shape (n, 3), the third axis up.
        lines: Pairs of point indices to draw as lines, shape (m, 2); if empty, the points are drawn.
        step_seconds: Simulated seconds a step.
        steps: The number of steps that shows the effect of the scene.
    """

    title: str
    state: State
    step: Callable[[State], State]
    health: Callable[[State], Mapping[str, jax.Array]]
    points: Callable[[State], jax.Array]
    lines: np.ndarray
    step_seconds: float
    steps: int


def flops(function: Callable[..., Any], *arguments: Any) -> float:
    """Returns the number of floating-point operations that XLA counts in the compiled function.

    It shows what a static option leaves out. A loop counts once, whatever its number of iterations.
    """
    cost = jax.jit(function).lower(*arguments).compile().cost_analysis() or {}
    return float(cost["flops"])

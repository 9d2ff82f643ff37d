"""What a scene gives to whoever runs it: the command, a notebook, a test."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

# Of a vertex, in any unit: volumes of larger bodies would overflow in float64, and LAPACK may hang on an infinity.
LARGEST_COORDINATE = 1e100

State = Any  # a NamedTuple of arrays, the scene's own


class Scene(NamedTuple):
    """A scene ready to run: its first state, and pure functions of a state.

    Attributes:
        title: One line, for the head of its pictures.
        state: The first state.
        step: State to state: pure, with parameters and static choices bound. A valid body for `lax.scan`.
        health: State to named scalars that are watched, each with its unit in the name: "kinetic energy (J)".
        points: State to the points to draw, shape (n, 3), the third axis up.
        lines: Pairs of point indices to draw as lines, shape (m, 2); empty: the points are drawn.
        step_seconds: Simulated seconds a step.
        steps: How many steps make the scene worth looking at.
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
    """The floating-point operations that XLA counts in the compiled function: what a static choice leaves out.

    Loops count once, whatever their number of iterations.
    """
    cost = jax.jit(function).lower(*arguments).compile().cost_analysis() or {}
    return float(cost["flops"])

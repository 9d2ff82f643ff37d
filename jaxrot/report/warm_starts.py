"""Warm starts: error after k iterations against time, for every step, beside the default method's cold start."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxrot
from jaxrot.evaluation.accuracy import measure_errors
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.evaluation.timing import fill_batch, interleave
from jaxrot.report.contenders import Quantiles, Spread, quantiles, spread
from jaxrot.report.peers import paper_code
from jaxrot.report.peers.peer import UnavailableError

COLD_START = f"cold start, {jaxrot.DEFAULT_METHOD}"
PAPER = "C++ torque (paper)"
ANGLE_DEGREES = 10.0

_ITERATIONS = {
    "torque": (1, 2, 3, 5, 10, 20),
    "torque_exact_angle": (1, 2, 3, 5, 10),
    "newton": (1, 2, 3, 4),
    "cayley": (1, 2, 3, 4),
    "quest": (1, 2),
    PAPER: (1, 2, 3, 5, 10, 20),
}


class WarmStart(NamedTuple):
    """One step, run for a number of iterations.

    Attributes:
        step: A name in `jaxrot.STEPS`, or `COLD_START`, or `PAPER`.
        dtype: "float32" or "float64".
        iterations: How many; 0 for the cold start.
        batch: Matrices in a call.
        error: ‖R − R*‖_F, where R* is determined.
        time: A matrix, all iterations together.
    """

    step: str
    dtype: str
    iterations: int
    batch: int
    error: Quantiles
    time: Spread


def steps_to_measure(with_peers: bool) -> dict[str, tuple[int, ...]]:
    """Numbers of iterations, by step."""
    return {step: counts for step, counts in _ITERATIONS.items() if with_peers or step != PAPER}


def measure_warm_starts(
    judged: Judged, *, batch: int, budget_s: float, with_peers: bool, advance: Callable[[str], object]
) -> list[WarmStart]:
    """Every step from starts `ANGLE_DEGREES` off, for several numbers of iterations, in the same rounds.

    Args:
        judged: The matrices, in one dtype, where R* is unique.
        batch: Matrices in a call.
        budget_s: Seconds for the rounds.
        with_peers: The paper's own code too, where it compiles.
        advance: Called once a step, before the cold start, and before the rounds: `number_of_steps` times.
    """
    dtype = judged.matrices.dtype.name
    starts = _turned(judged)
    filled = [fill_batch(array, batch) for array in (judged.matrices, starts)]
    on_device = [jnp.asarray(array) for array in filled]
    errors: dict[tuple[str, int], Quantiles] = {}
    calls: dict[tuple[str, int], Callable[[], object]] = {}
    for step, counts in ({COLD_START: (0,)} | steps_to_measure(with_peers)).items():
        advance(f"{dtype}: {step}")
        for iterations in counts:
            refine = _refine(step, iterations, dtype)
            if refine is None:
                continue
            found = quantiles(measure_errors(_run(refine, judged.matrices, starts, batch), judged).forward)
            if found is not None:
                errors[step, iterations] = found
                calls[step, iterations] = functools.partial(refine, *(filled if step == PAPER else on_device))
    advance(f"{dtype}: timing warm starts")
    samples, _ = interleave(calls, budget_s=budget_s)
    return [
        WarmStart(step, dtype, iterations, batch, errors[step, iterations], spread(seconds, batch))
        for (step, iterations), seconds in samples.items()
    ]


def number_of_steps(with_peers: bool) -> int:
    """How often `measure_warm_starts` calls `advance`."""
    return len(steps_to_measure(with_peers)) + 2


def _refine(step: str, iterations: int, dtype: str) -> Callable | None:
    """From matrices and starts to rotations, waited for; None for the paper's code where it does not compile."""
    if step == PAPER:
        try:
            refine, _ = paper_code.refine(dtype)
        except UnavailableError:
            return None
        return lambda matrices, starts: refine(matrices, starts, iterations)
    if step == COLD_START:
        compiled = jax.jit(lambda a, _: jaxrot.nearest_rotation(a))
    else:
        compiled = jax.jit(lambda a, r: jaxrot.refine_rotation(a, r, step=step, iterations=iterations))
    return lambda matrices, starts: jax.block_until_ready(compiled(matrices, starts))


def _run(refine: Callable, matrices: np.ndarray, starts: np.ndarray, batch: int) -> np.ndarray:
    """All rotations, in calls of the batch that is timed: another shape would be compiled anew."""
    count = len(matrices)
    places = (np.arange(-(-count // batch) * batch) % count).reshape(-1, batch)
    return np.concatenate([np.asarray(refine(matrices[place], starts[place])) for place in places])[:count]


def _turned(judged: Judged) -> np.ndarray:
    """The nearest rotations, each turned by the angle about an axis of its own."""
    axis = np.random.default_rng(0).standard_normal((len(judged.matrices), 3))
    x, y, z = (axis / np.linalg.norm(axis, axis=1, keepdims=True)).T
    zero = np.zeros_like(x)
    cross = np.stack([np.stack(row, -1) for row in ([zero, -z, y], [z, zero, -x], [-y, x, zero])], -2)
    angle = np.deg2rad(ANGLE_DEGREES)
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return (judged.solution.rotation.astype(np.float64) @ turn).astype(judged.matrices.dtype)

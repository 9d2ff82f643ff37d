"""Warm starts: error after k iterations against time, for every step and for a cold start."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxrot
from jaxrot.evaluation.accuracy import measure_errors, run_in_chunks
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.evaluation.timing import fill_batch, interleave
from jaxrot.report.measure.results import Quantiles, Spread, quantiles, spread
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
    """One step, run for a number of iterations."""

    step: str  # A name in `jaxrot.STEPS`, or `COLD_START`, or `PAPER`
    dtype: str  # "float32" or "float64"
    iterations: int  # How many; 0 for the cold start
    batch: int  # Matrices in a call
    error: Quantiles  # ‖R − R*‖_F, where R* is unique
    time: Spread  # Of all iterations together


def steps_to_measure(with_peers: bool) -> dict[str, tuple[int, ...]]:
    """The numbers of iterations to measure, by step."""
    return {step: counts for step, counts in _ITERATIONS.items() if with_peers or step != PAPER}


def measure_warm_starts(judged: Judged, *, batch: int, budget_s: float, with_peers: bool) -> list[WarmStart]:
    """Error and time of every step from starts `ANGLE_DEGREES` off, for several numbers of iterations.

    Args:
        judged: The matrices, in one dtype, where R* is unique.
        batch: Matrices in a call.
        budget_s: Seconds for the rounds.
        with_peers: Also measure the paper's own code, if it compiles.
    """
    dtype = judged.matrices.dtype.name
    starts = _turned(judged)
    filled = [fill_batch(array, batch) for array in (judged.matrices, starts)]
    on_device = [jnp.asarray(array) for array in filled]
    errors: dict[tuple[str, int], Quantiles] = {}
    calls: dict[tuple[str, int], Callable[[], object]] = {}
    for step, counts in ({COLD_START: (0,)} | steps_to_measure(with_peers)).items():
        for iterations in counts:
            refine = _refine(step, iterations, dtype)
            if refine is None:
                continue
            rotations = run_in_chunks(refine, judged.matrices, batch, starts)
            found = quantiles(measure_errors(rotations, judged).forward)
            if found is not None:
                errors[step, iterations] = found
                calls[step, iterations] = functools.partial(refine, *(filled if step == PAPER else on_device))
    samples, _ = interleave(calls, budget_s=budget_s)
    return [
        WarmStart(
            step=step,
            dtype=dtype,
            iterations=iterations,
            batch=batch,
            error=errors[step, iterations],
            time=spread(seconds, batch),
        )
        for (step, iterations), seconds in samples.items()
    ]


def _refine(step: str, iterations: int, dtype: str) -> Callable | None:
    """A blocking function from matrices and starts to rotations; None if the paper's code does not compile."""
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


def _turned(judged: Judged) -> np.ndarray:
    """The nearest rotations, each turned by the angle about a random axis."""
    axis = np.random.default_rng(0).standard_normal((len(judged.matrices), 3))
    x, y, z = (axis / np.linalg.norm(axis, axis=1, keepdims=True)).T
    zero = np.zeros_like(x)
    cross = np.stack([np.stack(row, -1) for row in ([zero, -z, y], [z, zero, -x], [-y, x, zero])], -2)
    angle = np.deg2rad(ANGLE_DEGREES)
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return (judged.solution.rotation.astype(np.float64) @ turn).astype(judged.matrices.dtype)

"""The candidates of `recommend`: methods whose domain holds the matrices, and steps, with their error and time."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxrot._inputs import check_matrix, check_start
from jaxrot._nearest import nearest_rotation
from jaxrot._recommend.sample import Sample
from jaxrot._refine import refine_rotation
from jaxrot.evaluation import domain, reference
from jaxrot.evaluation.accuracy import measure_errors, run_in_chunks
from jaxrot.evaluation.formatting import number
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.evaluation.timing import Compiled, compile_method, time_methods
from jaxrot.solvers import Method

# The largest angle from the start to R*, in degrees, for steps that have a limit. The error of one float32 `quest` step
# was 3e-5 from 170° off and 3e-2 from 179° off.
FARTHEST_START = {"cayley": 90.0, "quest": 170.0}
MOST_ITERATIONS = 8
TIMING_BUDGET_S = 1.0


class Candidate(NamedTuple):
    """A method, or a step and its number of iterations, with its measurements; see `Recommendation`."""

    name: str
    method: str | None
    step: str | None
    iterations: int | None
    error: float = np.inf
    # NaN if it was not timed because the error is too large
    time_ns: float = np.nan
    time_quartiles_ns: tuple[float, float] = (np.nan, np.nan)


class Measured(NamedTuple):
    """A candidate and its compiled program."""

    candidate: Candidate
    compiled: Compiled


class Apply(functools.partial):
    """A function with its options, printed as the call that it makes."""

    def __repr__(self) -> str:
        options = ", ".join(f"{name}={value!r}" for name, value in self.keywords.items())
        return f"<{self.func.__name__}(..., {options})>"


def apply_of(candidate: Candidate, *, takes_previous: bool) -> Apply:
    """Returns the function to call: of a matrix, or of a matrix and the previous rotation."""
    if candidate.method is None:
        return Apply(refine_rotation, step=candidate.step, iterations=candidate.iterations)
    return Apply(nearest_rotation_from_cold if takes_previous else nearest_rotation, method=candidate.method)


def nearest_rotation_from_cold(matrix: ArrayLike, rotation: ArrayLike, *, method: str) -> jax.Array:
    """`nearest_rotation` with the arguments and the result's shape of `refine_rotation`: the start is not used."""
    checked = check_matrix(matrix)
    start = check_start(rotation, "rotation", (3, 3), checked)
    batch = jnp.broadcast_shapes(checked.shape, start.shape)
    return nearest_rotation(jnp.broadcast_to(checked, batch), method=method)


def outside_domain(method: Method, sample: Sample) -> str | None:
    """Returns why the domain of a method does not hold all finite matrices, in words, or None if it does.

    The check uses all finite matrices in float64, not only the sample. A method is excluded, however small its error,
    if a κ is larger than `domain.condition_limit`, or if some det A ≤ 0 up to rounding and it is for det A > 0.
    """
    if not method.handles_inversion and sample.n_inverted:
        return f"for det A > 0, and {sample.n_inverted:,} of {sample.finite:,} have det A < 0, or 0 to rounding"
    limit = domain.condition_limit(method, sample.dtype)
    if limit == 0:
        return "exact, but for no κ does it declare an error of a few eps"
    if domain.is_within(sample.largest_condition, limit, sample.dtype):
        return None
    kind = "declared" if method.exact else "an approximation"
    return f"{kind} for κ ≤ {number(limit)}, and κ is up to {_larger(sample.largest_condition, limit)}"


def start_outside_domain(step: str, sample: Sample) -> str | None:
    """Returns why a step cannot start from the starts of the sample, in words, or None if it can.

    See `FARTHEST_START`. Steps declare no κ.
    """
    farthest = FARTHEST_START.get(step)
    if sample.starts is None or farthest is None:
        return None
    angle = _largest_angle(sample.starts, sample.judged)
    if angle <= farthest:
        return None
    return f"from within {farthest:.0f}°, and a start is {angle:.0f}° off"


def measure_method(name: str, sample: Sample) -> Measured:
    """Compiles a method and finds its error on the sample."""
    return _measure(Candidate(name, name, None, None), sample)


def measure_step(step: str, sample: Sample, largest_error: float) -> Measured:
    """Finds the smallest number of iterations whose error is small enough, else the number with the smallest error."""
    once = _measure(_step(step, 1), sample)
    errors = [once.candidate.error]
    # Apply one program repeatedly to find the number. Compiling a program for each number would take a second each.
    rotation = _run(once.compiled, sample, sample.starts)
    while errors[-1] > largest_error and len(errors) < MOST_ITERATIONS:
        rotation = _run(once.compiled, sample, rotation)
        errors.append(error_on(rotation, sample.judged))
    iterations = len(errors) if errors[-1] <= largest_error else int(np.argmin(errors)) + 1
    found = once if iterations == 1 else _measure(_step(step, iterations), sample)
    # The program for that number rounds differently. With an error close to the limit it may need another iteration.
    while found.candidate.error > largest_error >= errors[-1] and iterations < MOST_ITERATIONS:
        iterations += 1
        found = _measure(_step(step, iterations), sample)
    return found


def time_candidates(measured: list[Measured], sample: Sample) -> list[Candidate]:
    """Returns the candidates with their times, measured interleaved, the fastest first."""
    candidates = {entry.candidate.name: entry.candidate for entry in measured}
    timings = time_methods(
        {entry.candidate.name: entry.compiled for entry in measured},
        sample.judged.matrices,
        sample.batch,
        budget_s=TIMING_BUDGET_S,
        starts=sample.starts,
    )
    return [
        candidates[entry.method]._replace(
            time_ns=entry.median_ns, time_quartiles_ns=(entry.quartile_1_ns, entry.quartile_3_ns)
        )
        for entry in sorted(timings, key=lambda entry: entry.median_ns)
    ]


def undetermined(sample: Sample) -> int:
    """The number of matrices of the sample whose error is not defined."""
    judged = sample.judged
    return int(np.sum(~judged.is_normal | (judged.condition >= domain.largest_condition(sample.dtype))))


def error_on(rotation: np.ndarray, judged: Judged) -> float:
    """Returns the largest error ‖R − R*‖_F.

    Where R* is not determined, κ ≥ 1/(8 eps), the error is the larger of two numbers: the defect ‖RᵀR − 1‖_F, and the
    smallest error that loses as much trace, by lost trace ≤ s1 ‖R − R*‖²/2. Each counts 0 if rounding explains it.
    """
    errors = measure_errors(rotation, judged)
    eps = float(np.finfo(judged.matrices.dtype).eps)
    lost = np.where(errors.lost_trace > domain.LOST_TRACE_BOUND, errors.lost_trace * eps, 0)
    defect = np.where(errors.orthogonality > domain.ORTHOGONALITY_BOUND, errors.orthogonality * eps, 0)
    otherwise = np.maximum(defect, np.sqrt(2 * lost))
    return float(np.where(np.isnan(errors.forward), otherwise, errors.forward).max())


def _step(step: str, iterations: int) -> Candidate:
    name = f"{step} ({iterations} iteration{'' if iterations == 1 else 's'})"
    return Candidate(name, None, step, iterations)


def _measure(candidate: Candidate, sample: Sample) -> Measured:
    function: Callable = apply_of(candidate, takes_previous=sample.starts is not None)
    arguments = 1 if sample.starts is None else 2
    compiled = compile_method(function, sample.batch, sample.dtype, arguments=arguments)
    rotation = _run(compiled, sample, sample.starts)
    return Measured(candidate._replace(error=error_on(rotation, sample.judged)), compiled)


def _run(compiled: Compiled, sample: Sample, starts: np.ndarray | None) -> np.ndarray:
    arrays = () if starts is None else (starts,)
    return run_in_chunks(compiled.call, sample.judged.matrices, sample.batch, *arrays)


def _larger(value: float, limit: float) -> str:
    """The value with enough digits to differ from the limit when printed."""
    return number(value) if number(value) != number(limit) else f"{value:.8g}"


def _largest_angle(starts: np.ndarray, judged: Judged) -> float:
    """The largest angle from a start to R*, in degrees, over the matrices whose R* is determined."""
    where = judged.condition < domain.largest_condition(judged.matrices.dtype.name)
    distance = reference.forward_error(starts, judged.matrices, reference=judged.solution)
    # ‖R − R*‖_F = 2√2 sin(θ/2). For a start that has drifted off the rotations it may be larger, hence the minimum.
    largest = np.max(distance, where=where, initial=0)
    return float(np.degrees(2 * np.arcsin(min(1.0, largest / 8**0.5))))

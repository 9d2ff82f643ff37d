"""The cheapest way to the nearest rotation that is accurate enough, measured on the user's own matrices."""

from collections.abc import Callable

import numpy as np
from jax.typing import ArrayLike, DTypeLike

from jaxrot._frozen import FrozenMapping
from jaxrot._recommend import candidates
from jaxrot._recommend.candidates import Candidate, Measured
from jaxrot._recommend.result import Recommendation
from jaxrot._recommend.sample import Sample, take_sample
from jaxrot.solvers import METHODS
from jaxrot.steps import STEPS

# What is recommended keeps this much of the tolerance free, for the matrices that the sample does not hold.
MARGIN = 2.0


def recommend(
    matrices: ArrayLike, *, tolerance: float, previous: ArrayLike | None = None, dtype: DTypeLike | None = None
) -> Recommendation:
    """Measures what can find the nearest rotations of these matrices, and recommends the cheapest that is good enough.

    It compiles up to twenty programs and runs them: some seconds to half a minute, once, outside `jit`.

    Args:
        matrices: A, real, shape (..., 3, 3), any scale: matrices like those that are to come. Of more than 10,000 a
            random sample is measured, with the 100 largest κ and the 100 smallest s3/s1 in it.
        tolerance: The largest error ‖R − R*‖_F that is good enough, > 0; about √2 times an angle in radians.
        previous: Rotations to start from, shape (..., 3, 3), broadcast against `matrices`: those of the last frame.
            With them the steps of `refine_rotation` are candidates too, with 1 to 8 iterations and without `escape`.
        dtype: float32 or float64, what to compute in; that of `matrices` by default. Half precision is computed and
            judged in float32, and its results are rounded after that.

    Returns:
        The fastest candidate whose largest error on the sample is at most tolerance / 2; of those whose median time is
        within its upper quartile, the one with the smallest error. Where nothing meets that, `meets` is
        False and it is the candidate with the smallest error. Times differ from run to run, and a choice between
        candidates that take about the same time with them.

    Domain:
        Measured errors decide what is accurate enough. What a method declares in `METHODS` decides whether the sample
        is one it is made for; this is asked of *all* finite matrices given, in float64, and a method that one of them
        leaves is not recommended, however small its error:

        - A method with `handles_inversion` False, where det A is negative, or 0 to rounding.
        - An exact method, where κ = s1/(s2+s3) is larger than its `condition_limit`: that is as far as it was found to
          keep its accuracy of a few eps. Those with limit 0 were found to keep it nowhere, and are never recommended.
          A limit of 1/(8 eps) leaves nothing out.
        - An approximation, where κ > 1, that is s2+s3 < s1. It declares no limit in units of eps, since its error is
          none of rounding; it is for matrices near a rotation, κ = ½.
        - The step `cayley` where a start is more than 90° off, `quest` from 170° on; this is asked of the sample. Steps
          declare no κ.

        Where R* is not determined, κ ≥ 1/(8 eps), no error is defined. There R must be a rotation and lose no more
        trace tr(RᵀA) than an error of tolerance / 2 could, rounding apart.

    Raises:
        ValueError: Wrong shape, no matrix, none that is finite, tolerance not positive, `previous` no rotations, dtype
            neither float32 nor float64, or float64 where x64 is off.
        TypeError: Complex, non-numeric or traced arrays, tolerance no number, dtype none at all.
    """
    return recommend_step_by_step(matrices, tolerance, previous, dtype, lambda step: None)


def recommend_step_by_step(
    matrices: ArrayLike,
    tolerance: float,
    previous: ArrayLike | None,
    dtype: DTypeLike | None,
    advance: Callable[[str], object],
) -> Recommendation:
    """`recommend`; `advance` is called before each of at most `number_of_steps` steps, with what it is."""
    tolerance = _check_tolerance(tolerance)
    advance("the reference")
    sample = take_sample(matrices, previous, dtype)
    allowed = tolerance / MARGIN
    measured, excluded = _measure_all(sample, allowed, advance)
    meeting = [entry for entry in measured if entry.candidate.error <= allowed]
    failing = sorted(
        (entry for entry in measured if entry.candidate.error > allowed), key=lambda entry: entry.candidate.error
    )
    advance("timing")
    timed = candidates.time_candidates(meeting or failing[:1], sample)
    chosen = _cheapest(timed)
    errors = [entry.candidate for entry in failing if entry.candidate.name != chosen.name]
    judged = sample.judged
    return Recommendation(
        name=chosen.name,
        method=chosen.method,
        step=chosen.step,
        iterations=chosen.iterations,
        apply=candidates.apply_of(chosen, takes_previous=sample.starts is not None),
        meets=bool(meeting),
        error=chosen.error,
        time_ns=chosen.time_ns,
        time_quartiles_ns=chosen.time_quartiles_ns,
        tolerance=tolerance,
        margin=MARGIN,
        dtype=sample.dtype,
        batch=candidates.batch_size(sample),
        sample=len(judged.matrices),
        given=sample.given,
        not_finite=sample.not_finite,
        undetermined=candidates.undetermined(sample),
        runners_up=tuple(candidate for candidate in timed if candidate.name != chosen.name),
        too_inaccurate=tuple(errors),
        excluded=FrozenMapping(excluded),
    )


def number_of_steps(*, has_previous: bool) -> int:
    """How often `recommend_step_by_step` calls `advance` at most."""
    return 2 + len(METHODS) + has_previous * len(STEPS)


def _measure_all(
    sample: Sample, allowed: float, advance: Callable[[str], object]
) -> tuple[list[Measured], dict[str, str]]:
    measured, excluded = [], {}
    for name, method in METHODS.items():
        if (reason := candidates.outside_domain(method, sample)) is not None:
            excluded[name] = reason
            continue
        advance(f"measuring {name}")
        measured.append(candidates.measure_method(name, sample))
    for name in STEPS if sample.starts is not None else ():
        if (reason := candidates.start_outside_domain(name, sample)) is not None:
            excluded[_step_name(name)] = reason
            continue
        advance(f"measuring {name} steps")
        measured.append(candidates.measure_step(name, sample, allowed))
    return measured, excluded


def _step_name(step: str) -> str:
    # `cayley` and `torque` are methods too.
    return f"{step} steps"


def _cheapest(timed: list[Candidate]) -> Candidate:
    """The most accurate of those whose median is within the spread of the fastest."""
    _, slow_quartile = timed[0].time_quartiles_ns
    return min((each for each in timed if each.time_ns <= slow_quartile), key=lambda each: each.error)


def _check_tolerance(tolerance: float) -> float:
    if isinstance(tolerance, bool) or not isinstance(tolerance, int | float | np.integer | np.floating):
        raise TypeError(f"tolerance must be a Python number; got {type(tolerance).__name__}")
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ValueError(f"tolerance must be finite and > 0; got {tolerance}")
    return float(tolerance)

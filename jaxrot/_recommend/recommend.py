"""`recommend`: the cheapest method that is accurate enough, measured on the user's own matrices."""

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

# A recommended candidate has an error of at most tolerance / MARGIN: matrices outside the sample may have a larger one.
MARGIN = 2.0


def recommend(
    matrices: ArrayLike, *, tolerance: float, previous: ArrayLike | None = None, dtype: DTypeLike | None = None
) -> Recommendation:
    """Returns the fastest method that finds the nearest rotations of these matrices to a tolerance, by measurement.

    Args:
        matrices: A, real, shape (..., 3, 3), any scale: matrices like those to come. If there are more than 10,000, a
            random sample is measured, with the 100 largest κ = s1/(s2+s3) and the 100 smallest s3/s1 in it.
        tolerance: The largest acceptable error ‖R − R*‖_F, > 0, R* the nearest rotation; about √2 times an angle in
            radians.
        previous: Rotations to start from, broadcast against `matrices`. With them the steps of `refine_rotation` are
            candidates too, with 1 to 8 iterations and without `escape`.
        dtype: float32 or float64; by default that of `matrices`. Half precision is measured in float32, unrounded.

    Returns:
        The fastest candidate whose error on the sample is at most tolerance / 2. Of those whose median time is below
        the fastest one's upper quartile, the most accurate is returned. If none is accurate enough, `meets` is False,
        and the most accurate one is returned.

    Raises:
        ValueError: Wrong shape, no finite matrix, tolerance not positive, `previous` not rotations, unusable dtype.
        TypeError: Complex, non-numeric or traced arrays; tolerance or dtype of the wrong type.

    Accuracy:
        A method is excluded if any finite input lies outside the domain it declares in `METHODS`. If κ ≥ 1/(8 eps), the
        lost trace tr(R*ᵀA) − tr(RᵀA) is judged instead of the error.

    Cost:
        Some seconds to half a minute: up to twenty programs are compiled and run. Call it once, outside `jit`.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> found = jaxrot.recommend(jnp.diag(jnp.array([1.0, 1e-3, -1e-4])), tolerance=1e-2)
        >>> found.meets, found.error <= 0.005
        (True, True)
    """
    return recommend_step_by_step(matrices, tolerance, previous, dtype, lambda step: None)


def recommend_step_by_step(
    matrices: ArrayLike,
    tolerance: float,
    previous: ArrayLike | None,
    dtype: DTypeLike | None,
    advance: Callable[[str], object],
) -> Recommendation:
    """`recommend` with progress: calls `advance` with the name of each step before it starts."""
    tolerance = _check_tolerance(tolerance)
    advance("the reference")
    sample = take_sample(matrices, previous, dtype)
    allowed = tolerance / MARGIN
    measured, excluded = _measure_all(sample, allowed, advance)
    measured.sort(key=lambda entry: entry.candidate.error)
    meeting = [entry for entry in measured if entry.candidate.error <= allowed]
    failing = measured[len(meeting) :]
    advance("timing")
    timed = candidates.time_candidates(meeting or failing[:1], sample)
    chosen = _cheapest(timed)
    return Recommendation(
        **chosen._asdict(),
        apply=candidates.apply_of(chosen, takes_previous=sample.starts is not None),
        meets=bool(meeting),
        tolerance=tolerance,
        margin=MARGIN,
        dtype=sample.dtype,
        batch=sample.batch,
        sample=len(sample.judged.matrices),
        given=sample.given,
        not_finite=sample.not_finite,
        undetermined=candidates.undetermined(sample),
        runners_up=tuple(candidate for candidate in timed if candidate.name != chosen.name),
        too_inaccurate=tuple(entry.candidate for entry in failing if entry.candidate.name != chosen.name),
        excluded=FrozenMapping(excluded),
    )


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
            # "steps" tells them from methods: `cayley` and `torque` are names of both.
            excluded[f"{name} steps"] = reason
            continue
        advance(f"measuring {name} steps")
        measured.append(candidates.measure_step(name, sample, allowed))
    return measured, excluded


def _cheapest(timed: list[Candidate]) -> Candidate:
    """The most accurate candidate among those whose median is within the upper quartile of the fastest.

    Medians closer than that change their order from run to run.
    """
    _, slow_quartile = timed[0].time_quartiles_ns
    return min((each for each in timed if each.time_ns <= slow_quartile), key=lambda each: each.error)


def _check_tolerance(tolerance: float) -> float:
    if isinstance(tolerance, bool) or not isinstance(tolerance, int | float | np.integer | np.floating):
        raise TypeError(f"tolerance must be a Python number; got {type(tolerance).__name__}")
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ValueError(f"tolerance must be finite and > 0; got {tolerance}")
    return float(tolerance)

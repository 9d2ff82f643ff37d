"""What every guard costs and prevents: the time without it, and the families that break without it."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.stages import Compiled, Lowered

import jaxrot
from jaxrot import STEPS
from jaxrot.evaluation.ground_truth import Judged, judge
from jaxrot.evaluation.timing import blocking, interleave
from jaxrot.report.measure import ablated_method, ablated_steps
from jaxrot.report.measure.ablation_starts import HALF_TURN, ITERATIONS, Posed, judge_step, pose
from jaxrot.report.measure.verdict import Broken, Verdict, broken_families, judge_contract, sample_families
from jaxrot.report.plan import GuardsPlan

# If two times are equal, three in four of 20 rounds agree by chance in one case of 80; of 12 rounds in one case of 7.
_FEWEST_ROUNDS = 20
_SHORTEST_SAMPLE_S = 5e-3


class Time(NamedTuple):
    """What a guard costs in time."""

    nanoseconds: float  # Per matrix without the guard: median over the rounds
    nanoseconds_with: float  # The same with the guard
    ratio: float  # Time without over time with the guard, in the same round: median
    quartile_1: float  # Lower quartile of this ratio
    quartile_3: float  # Upper quartile of this ratio

    @property
    def is_separated(self) -> bool:
        """Whether the times differ by more than their spread: the same one is faster in three rounds of four."""
        return self.quartile_3 < 1 or self.quartile_1 > 1


class Price(NamedTuple):
    """What one guard costs and prevents, in one dtype."""

    of: str  # The method or step
    # What is left out; "" for nothing. Then `time` is that of the method, and `broken` what it breaks itself.
    guard: str
    dtype: str  # "float32" or "float64"
    time: Time  # What it costs
    judged: int  # Judged matrices or starts
    broken: tuple[Broken, ...]  # Families that break without the guard, the worst first
    # Matrices or starts that keep every promise without the guard and not with it. If as many break, both numbers are
    # rounding.
    gained: int

    @property
    def outside(self) -> int:
        """Matrices or starts that break, of all families."""
        return sum(entry.matrices for entry in self.broken)

    @property
    def not_finite(self) -> int:
        """Of these, results that are not finite."""
        return sum(entry.not_finite for entry in self.broken)


class Guards(NamedTuple):
    """The prices in the default method and in the steps, dtype after dtype."""

    default: list[Price]
    steps: list[Price]


class _Measured(NamedTuple):
    """One program: its seconds per matrix in every round, and its errors."""

    seconds: np.ndarray
    verdict: Verdict


def measure_guards(plan: GuardsPlan, dtypes: Sequence[str]) -> Guards:
    """Returns the price of every guard of the default method and of the steps, inside `measuring_configuration`."""
    guards = Guards([], [])
    for dtype in dtypes:
        guards.default.extend(price_default(plan, dtype))
        posed = pose(sample_families(plan.starts_a_family, dtype), dtype)
        for step in STEPS:
            guards.steps.extend(price_step(step, posed, plan))
    return guards


def price_default(plan: GuardsPlan, dtype: str) -> list[Price]:
    """The default method with each guard left out in turn; nothing left out comes first."""
    judged = judge(sample_families(plan.matrices_a_family, dtype), dtype)
    count = len(judged.matrices)
    given = jnp.asarray(_gaussian(max(plan.batch, count), dtype))

    solve = jax.jit(ablated_method.solve, static_argnames="without")
    programs = _compile({guard: solve.lower(given, without=guard) for guard in ("", *ablated_method.GUARDS)})
    seconds = time_side_by_side(programs, (given,), plan.budget_s)
    filled = jnp.asarray(np.resize(judged.matrices, given.shape))
    measured = {
        guard: _Measured(seconds[guard] / len(given), judge_contract(np.asarray(call(filled))[:count], judged))
        for guard, call in programs.items()
    }
    everything = np.ones(count, bool)
    return [
        _price(jaxrot.DEFAULT_METHOD, guard, measured[""], measured[guard], judged, everything) for guard in programs
    ]


def price_step(step: str, posed: Posed, plan: GuardsPlan) -> list[Price]:
    """A step with each guard left out in turn, from starts off the nearest rotation; nothing left out comes first.

    "Nothing" is the step as it is by default, without `escape`. `escape` is priced in the first step only, and judged
    only on the starts half a turn off. No other guard is judged on these.
    """
    dtype, count = posed.judged.matrices.dtype.name, len(posed.kind)
    matrix = jnp.asarray(_gaussian(max(plan.batch, count), dtype))
    # A step has no branch, so that its time does not depend on the start.
    given = (matrix, jnp.asarray(np.resize(posed.starts, (len(matrix), 4))))
    escape = ablated_steps.ESCAPE
    # What each program leaves out. That of `escape`, which is off by default, is the one that has it.
    left_out = {"": (escape,)} | {guard: (escape, guard) for guard in ablated_steps.GUARDS[step]} | {escape: ()}
    programs = _compile(
        {guard: jax.jit(ablated_steps.one_step(step, names)).lower(*given) for guard, names in left_out.items()}
    )
    seconds = time_side_by_side(programs, given, plan.budget_s)
    measured = {}
    for guard, first in programs.items():
        others = programs["" if guard == escape else guard]
        verdict = judge_step(first, others, iterations=ITERATIONS[step], posed=posed, batch=len(matrix))
        measured[guard] = _Measured(seconds[guard] / len(matrix), verdict)
    is_opposite = posed.kind == HALF_TURN
    # By default `escape` is off: leaving it out of the program that has it gives the default program.
    return [
        _price(step, guard, measured[escape], measured[""], posed.judged, is_opposite)
        if guard == escape
        else _price(step, guard, measured[""], measured[guard], posed.judged, ~is_opposite)
        for guard in ("", *ablated_steps.GUARDS[step])
    ]


def _price(
    of: str, guard: str, with_guard: _Measured, without: _Measured, judged: Judged, counted: np.ndarray
) -> Price:
    is_kept = with_guard.verdict.is_kept if guard else np.ones(len(counted), bool)
    return Price(
        of=of,
        guard=guard,
        dtype=judged.matrices.dtype.name,
        time=compare_times(without.seconds, with_guard.seconds),
        judged=int(counted.sum()),
        broken=broken_families(judged.sets, is_kept, without.verdict, counted),
        gained=int((without.verdict.is_kept & ~is_kept & counted).sum()),
    )


def _compile(lowered: Mapping[str, Lowered]) -> dict[str, Compiled]:
    # Two at a time: compiling takes most of the time here, and nothing is timed meanwhile.
    with ThreadPoolExecutor(2) as pool:
        return dict(zip(lowered, pool.map(lambda program: program.compile(), lowered.values()), strict=True))


def time_side_by_side(
    programs: Mapping[str, Callable], given: tuple[jax.Array, ...], budget_s: float
) -> dict[str, np.ndarray]:
    """The seconds of each round by name. Every program runs once in a round, in random order."""
    samples, _ = interleave(
        {name: blocking(program, *given) for name, program in programs.items()},
        budget_s=budget_s,
        shortest_sample_s=min(_SHORTEST_SAMPLE_S, budget_s),
        fewest_rounds=_FEWEST_ROUNDS,
    )
    return {name: np.asarray(seconds) for name, seconds in samples.items()}


def compare_times(without: np.ndarray, with_guard: np.ndarray) -> Time:
    """Two programs compared, from their seconds per matrix in the same rounds."""
    first, median, third = np.quantile(without / with_guard, [0.25, 0.5, 0.75]).tolist()
    ns_without, ns_with = (float(np.median(seconds)) * 1e9 for seconds in (without, with_guard))
    return Time(nanoseconds=ns_without, nanoseconds_with=ns_with, ratio=median, quartile_1=first, quartile_3=third)


def _gaussian(count: int, dtype: str) -> np.ndarray:
    return np.random.default_rng(0).standard_normal((count, 3, 3)).astype(dtype)

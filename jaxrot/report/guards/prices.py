"""The price of every guard: what leaving it out saves in time, and which families break without it, by how much."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.stages import Compiled, Lowered

import jaxrot
from jaxrot import STEPS
from jaxrot.evaluation.ground_truth import judge
from jaxrot.evaluation.timing import interleave
from jaxrot.report.guards import default_method
from jaxrot.report.guards import steps as step_guards
from jaxrot.report.guards.starts import HALF_TURN, ITERATIONS, Posed, judge_step, pose
from jaxrot.report.guards.verdict import Broken, Verdict, broken_families, judge_contract, sample_families

# Of equal times three in four of that many rounds agree by chance once in 80 times, of 12 rounds once in 7.
_FEWEST_ROUNDS = 20
_SHORTEST_SAMPLE_S = 5e-3


class Size(NamedTuple):
    """How much is measured.

    Attributes:
        batch: Matrices in a call that is timed; as many as are judged where those are more.
        matrices_a_family: Matrices drawn from each family, for the default method.
        starts_a_family: Matrices drawn for the steps, each with four starts.
        budget_s: Seconds to time one method or step, with and without each of its guards, roughly.
        dtypes: "float32", "float64" or both.
    """

    batch: int = 100_000
    matrices_a_family: int = 500
    starts_a_family: int = 60
    budget_s: float = 1.5
    dtypes: tuple[str, ...] = ("float32", "float64")


class Time(NamedTuple):
    """What a guard costs in time.

    Attributes:
        nanoseconds: A matrix, without the guard: median over the rounds.
        nanoseconds_with: The same with the guard.
        ratio: Time without over time with, in the same round: median.
        quartile_1: A quarter of the rounds had less.
        quartile_3: A quarter of the rounds had more.
    """

    nanoseconds: float
    nanoseconds_with: float
    ratio: float
    quartile_1: float
    quartile_3: float

    @property
    def is_separated(self) -> bool:
        """Whether the times differ by more than they spread: in three rounds of four the same one is faster."""
        return self.quartile_3 < 1 or self.quartile_1 > 1


class Price(NamedTuple):
    """What one guard costs and prevents, in one dtype.

    Attributes:
        of: The method or step.
        guard: What is left out; "" for nothing: the time is that of the method, and `broken` what it breaks itself.
        dtype: "float32" or "float64".
        time: What it costs.
        judged: Matrices, or starts, that were judged.
        broken: Families that break, the worst first.
        gained: Matrices, or starts, with which it is the other way round: every promise is kept without the guard and
            not with it. As many as break, and both are rounding.
    """

    of: str
    guard: str
    dtype: str
    time: Time
    judged: int
    broken: tuple[Broken, ...]
    gained: int

    @property
    def outside(self) -> int:
        """How many break, of all families."""
        return sum(entry.matrices for entry in self.broken)

    @property
    def not_finite(self) -> int:
        """How many of them are not finite."""
        return sum(entry.not_finite for entry in self.broken)


class Guards(NamedTuple):
    """The prices in the default method and in the steps, dtype after dtype."""

    default: list[Price]
    steps: list[Price]


def number_of_steps(size: Size) -> int:
    """How often `run_guards` calls `advance`."""
    return len(size.dtypes) * (1 + len(STEPS))


def run_guards(size: Size, advance: Callable[[str], object]) -> Guards:
    """Measures everything, inside `measuring_configuration`; `advance` is called before each method and dtype."""
    guards = Guards([], [])
    for dtype in size.dtypes:
        advance(f"guards: {jaxrot.DEFAULT_METHOD}, {dtype}")
        guards.default.extend(price_default(size, dtype))
        posed = pose(sample_families(size.starts_a_family, dtype), dtype)
        for step in STEPS:
            advance(f"guards: {step}, {dtype}")
            guards.steps.extend(price_step(step, posed, size))
    return guards


def price_default(size: Size, dtype: str) -> list[Price]:
    """Every guard of the default method left out in turn; nothing left out comes first."""
    judged = judge(sample_families(size.matrices_a_family, dtype), dtype)
    count = len(judged.matrices)
    given = jnp.asarray(_gaussian(max(size.batch, count), dtype))

    solve = jax.jit(default_method.solve, static_argnames="without")
    programs = _compile({guard: solve.lower(given, without=guard) for guard in ("", *default_method.GUARDS)})
    seconds = time_side_by_side(programs, (given,), size.budget_s)
    filled = jnp.asarray(np.resize(judged.matrices, given.shape))
    verdicts = {guard: judge_contract(np.asarray(call(filled))[:count], judged) for guard, call in programs.items()}
    everything = np.ones(count, bool)

    def price(guard: str) -> Price:
        time = compare_times(seconds[guard], seconds[""], len(given))
        kept = verdicts[""].is_kept if guard else everything
        broken = broken_families(judged.sets, kept, verdicts[guard], everything)
        gained = int((verdicts[guard].is_kept & ~kept).sum())
        return Price(jaxrot.DEFAULT_METHOD, guard, dtype, time, count, broken, gained)

    return [price(guard) for guard in programs]


def price_step(step: str, posed: Posed, size: Size) -> list[Price]:
    """Every guard of a step left out in turn, from starts off the nearest rotation; nothing left out comes first.

    "Nothing" is the step as it is by default, without `escape`. The price of `escape` is that of a first step with it;
    what it is judged on are the starts half a turn off, on which nothing else is.
    """
    dtype, count = posed.judged.matrices.dtype.name, len(posed.kind)
    matrix = jnp.asarray(_gaussian(max(size.batch, count), dtype))
    # A step has no branch: it takes as long from any start.
    given = (matrix, jnp.asarray(np.resize(posed.starts, (len(matrix), 4))))
    escape = step_guards.ESCAPE
    # By what is left out; of escape, which is off by default, the one that has it.
    without = {"": (escape,), escape: ()} | {
        guard: (escape, guard) for guard in step_guards.GUARDS[step] if guard != escape
    }
    programs = _compile(
        {guard: jax.jit(step_guards.one_step(step, names)).lower(*given) for guard, names in without.items()}
    )
    seconds = time_side_by_side(programs, given, size.budget_s)

    def run(guard: str) -> Verdict:
        others = programs[""] if guard == escape else programs[guard]
        return judge_step(programs[guard], others, ITERATIONS[step], posed, len(matrix))

    verdicts = {guard: run(guard) for guard in programs}
    is_opposite = posed.kind == HALF_TURN

    def price(guard: str) -> Price:
        counted = is_opposite if guard == escape else ~is_opposite
        # Swapped for escape: what is there by default is the program without it.
        kept, reduced = (escape, "") if guard == escape else ("", guard)
        is_kept = verdicts[kept].is_kept if guard else np.ones(count, bool)
        time = compare_times(seconds[reduced], seconds[kept], len(matrix))
        broken = broken_families(posed.judged.sets, is_kept, verdicts[reduced], counted)
        gained = int((verdicts[reduced].is_kept & ~is_kept & counted).sum())
        return Price(step, guard, dtype, time, int(counted.sum()), broken, gained)

    return [price(guard) for guard in ("", *step_guards.GUARDS[step])]


def _compile(lowered: Mapping[str, Lowered]) -> dict[str, Compiled]:
    """Two at a time: compiling is most of what all this takes, and nothing is timed meanwhile."""
    with ThreadPoolExecutor(2) as pool:
        return dict(zip(lowered, pool.map(lambda program: program.compile(), lowered.values()), strict=True))


def time_side_by_side(
    programs: Mapping[str, Callable], given: tuple[jax.Array, ...], budget_s: float
) -> dict[str, np.ndarray]:
    """Seconds of each round by name; every program runs once a round, in random order."""

    def call(name: str) -> Callable[[], object]:
        return lambda: jax.block_until_ready(programs[name](*given))

    samples, _ = interleave(
        {name: call(name) for name in programs},
        budget_s=budget_s,
        shortest_sample_s=min(_SHORTEST_SAMPLE_S, budget_s),
        fewest_rounds=_FEWEST_ROUNDS,
    )
    return {name: np.asarray(seconds) for name, seconds in samples.items()}


def compare_times(without: np.ndarray, with_guard: np.ndarray, batch: int) -> Time:
    """Two programs' seconds a call in the same rounds, for that many matrices a call."""
    first, median, third = np.quantile(without / with_guard, [0.25, 0.5, 0.75]).tolist()
    reduced, whole = (float(np.median(seconds)) / batch * 1e9 for seconds in (without, with_guard))
    return Time(reduced, whole, median, first, third)


def _gaussian(count: int, dtype: str) -> np.ndarray:
    return np.random.default_rng(0).standard_normal((count, 3, 3)).astype(dtype)

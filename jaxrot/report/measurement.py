"""Every method, judged and timed on one input in one dtype."""

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax
import numpy as np

import jaxrot
from jaxrot.evaluation import reference
from jaxrot.evaluation.accuracy import Accuracy, measure_errors, run_in_chunks, summarise
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.evaluation.timing import FEWEST_ROUNDS, Compiled, Timing, compile_method, time_methods
from jaxrot.report.guards.prices import Size as GuardsSize

WHOLE = "whole input"


class Plan(NamedTuple):
    """What to measure.

    Attributes:
        methods: Names from `jaxrot.METHODS`.
        dtypes: "float32", "float64" or both.
        batches: Batch sizes to time, ascending.
        batch_if_time_permits: One more, timed where `timing_budget_s` is not spent by then.
        matrices_a_family: Matrices drawn from each family.
        timing_budget_s: Seconds for all timing of methods together, roughly.
        peers_budget_s: Seconds for the rounds with peers in both dtypes; None leaves peers out.
        warm_starts_budget_s: Seconds for the rounds of warm starts in both dtypes; None leaves them out.
        map_steps: Steps of the stability maps along s2/s1, a power of two; None leaves them out.
        guards_size: How much to measure of the guards, in the plan's dtypes; None leaves them out.
    """

    methods: tuple[str, ...]
    dtypes: tuple[str, ...]
    batches: tuple[int, ...]
    batch_if_time_permits: int | None
    matrices_a_family: int
    timing_budget_s: float
    peers_budget_s: float | None = None
    warm_starts_budget_s: float | None = None
    map_steps: int | None = None
    guards_size: GuardsSize | None = None


class Results(NamedTuple):
    """What came of a plan.

    Attributes:
        accuracy: One entry a method, dtype and set.
        timing: One entry a method, dtype and batch size.
        remarks: What was left out and why, one sentence each.
    """

    accuracy: list[Accuracy]
    timing: list[Timing]
    remarks: tuple[str, ...]


def number_of_steps(plan: Plan) -> int:
    """How often `measure_methods` calls `advance`."""
    batches = len(plan.batches) + (plan.batch_if_time_permits is not None)
    return batches * (len(plan.methods) + 1) + len(plan.methods)


def measure_methods(
    plan: Plan, judged: Mapping[str, Judged], advance: Callable[[str], object]
) -> tuple[Results, Callable[[str, np.ndarray], np.ndarray]]:
    """Judges and times every method of the plan, inside `measuring_configuration`.

    Args:
        plan: What to measure.
        judged: "input" and "families", in one dtype.
        advance: Called before each step with what it is.

    Returns:
        What came of it, and the compiled methods: from a name and matrices (n, 3, 3) to rotations.
    """
    matrices = judged["input"].matrices
    dtype = matrices.dtype.name
    budget = plan.timing_budget_s / len(plan.dtypes)
    compiled: dict[int, dict[str, Compiled]] = {}
    timing: list[Timing] = []
    remarks = []
    if np.finfo(dtype).eps < 64 * reference.EPS:
        remarks.append(
            f"This machine has no arithmetic much wider than {dtype}: errors near eps are the reference's too."
        )
    spent = 0.0
    # The first compilation of a process pays for everybody's; nobody's compile time may hold that.
    compile_method(lambda matrix: matrix + 1, 1, dtype)

    def compile_all(batch: int) -> None:
        compiled[batch] = {}
        for name in plan.methods:
            advance(f"{dtype}: compiling {name} for batch {batch:,}")
            compiled[batch][name] = compile_method(method_function(name), batch, dtype)

    def time_all(batch: int, budget_s: float) -> None:
        advance(f"{dtype}: timing batch {batch:,}")
        timing.extend(time_methods(compiled[batch], matrices, batch, budget_s=budget_s))

    for batch in plan.batches:
        compile_all(batch)

    def run(name: str, some: np.ndarray) -> np.ndarray:
        # A method compiled for timing judges too, in chunks of its batch size: compiling is what costs.
        chunk = min(compiled, key=lambda batch: _cost_of_chunks(len(some), batch))
        return run_in_chunks(compiled[chunk][name].call, some, chunk)

    accuracy = _judge_methods(plan, judged, run, advance)
    for position, batch in enumerate(plan.batches):
        begin = time.perf_counter()
        time_all(batch, (budget - spent) / (len(plan.batches) - position + (plan.batch_if_time_permits is not None)))
        spent += time.perf_counter() - begin
    if (extra := plan.batch_if_time_permits) is not None:
        largest = [entry for entry in timing if entry.batch == plan.batches[-1]]
        needed = sum(entry.median_ns for entry in largest) * 1e-9 * extra * (FEWEST_ROUNDS + 2)
        if spent + needed <= budget:
            compile_all(extra)
            time_all(extra, needed)
        else:
            remarks.append(f"Batch {extra:,} in {dtype} was left out to save {needed:.0f} s; --batch {extra} times it.")
    return Results(accuracy, timing, tuple(remarks)), run


def _judge_methods(
    plan: Plan,
    judged: Mapping[str, Judged],
    run: Callable[[str, np.ndarray], np.ndarray],
    advance: Callable[[str], object],
) -> list[Accuracy]:
    accuracy = []
    for name in plan.methods:
        advance(f"judging {name}")
        for group, part in judged.items():
            errors = measure_errors(run(name, part.matrices), part)
            accuracy.extend(summarise(name, jaxrot.METHODS[name], errors, part, group))
    return accuracy


def _cost_of_chunks(total: int, batch: int) -> int:
    """Matrices computed, a call counted as a thousand of them."""
    return -(-total // batch) * (batch + 1000)


def method_function(name: str) -> Callable[[jax.Array], jax.Array]:
    """`nearest_rotation` by a method."""
    return lambda matrix: jaxrot.nearest_rotation(matrix, method=name)

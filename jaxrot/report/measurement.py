"""The main job: every method, judged and timed on one input."""

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax
import numpy as np

import jaxrot
from jaxrot.families import FAMILIES
from jaxrot.measuring import reference
from jaxrot.measuring.accuracy import Accuracy, measure_errors, run_in_chunks, summarise
from jaxrot.measuring.judging import Judged, judge
from jaxrot.measuring.timing import FEWEST_ROUNDS, Compiled, Timing, compile_method, time_methods
from jaxrot.report.inputs import Input

WHOLE = "whole input"


class Plan(NamedTuple):
    """What to measure.

    Attributes:
        methods: Names from `jaxrot.METHODS`.
        dtypes: "float32", "float64" or both.
        batches: Batch sizes to time, ascending.
        batch_if_time_permits: One more, timed where `timing_budget_s` is not spent by then.
        matrices_a_family: Matrices drawn from each family.
        timing_budget_s: Seconds for all timing together, roughly.
    """

    methods: tuple[str, ...]
    dtypes: tuple[str, ...]
    batches: tuple[int, ...]
    batch_if_time_permits: int | None
    matrices_a_family: int
    timing_budget_s: float


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
    """How often `measure` calls `advance`."""
    batches = len(plan.batches) + (plan.batch_if_time_permits is not None)
    return len(plan.dtypes) * (1 + batches * (len(plan.methods) + 1) + len(plan.methods))


def measure(plan: Plan, given: Input, advance: Callable[[str], object]) -> Results:
    """Judges and times every method of the plan, inside `measuring_configuration`.

    Args:
        plan: What to measure.
        given: On which matrices; the families come on top.
        advance: Called before each step with what it is.
    """
    results = Results([], [], ())
    for dtype in plan.dtypes:
        advance(f"{dtype}: the reference")
        judged = {
            "input": judge(given.sets, dtype, whole=WHOLE),
            "families": judge(_families(plan.matrices_a_family, dtype), dtype),
        }
        found = _measure_dtype(plan, judged, advance)
        results = Results(
            results.accuracy + found.accuracy, results.timing + found.timing, results.remarks + found.remarks
        )
    return results


def _families(count: int, dtype: str) -> dict[str, np.ndarray]:
    return {name: family.sample(count, dtype=np.dtype(dtype), seed=0).matrices for name, family in FAMILIES.items()}


def _measure_dtype(plan: Plan, judged: Mapping[str, Judged], advance: Callable[[str], object]) -> Results:
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
            compiled[batch][name] = compile_method(_function(name), batch, dtype)

    def time_all(batch: int, budget_s: float) -> None:
        advance(f"{dtype}: timing batch {batch:,}")
        timing.extend(time_methods(compiled[batch], matrices, batch, budget_s=budget_s))

    for batch in plan.batches:
        compile_all(batch)
    accuracy = _judge_methods(plan, judged, compiled, advance)
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
    return Results(accuracy, timing, tuple(remarks))


def _judge_methods(
    plan: Plan,
    judged: Mapping[str, Judged],
    compiled: Mapping[int, Mapping[str, Compiled]],
    advance: Callable[[str], object],
) -> list[Accuracy]:
    # A method compiled for timing judges too, in chunks of its batch size: compiling is what costs.
    total = sum(len(part.matrices) for part in judged.values())
    chunk = min(compiled, key=lambda batch: _cost_of_chunks(total, batch))
    accuracy = []
    for name in plan.methods:
        advance(f"judging {name}")
        for group, part in judged.items():
            rotation = run_in_chunks(compiled[chunk][name].call, part.matrices, chunk)
            errors = measure_errors(rotation, part)
            accuracy.extend(summarise(name, jaxrot.METHODS[name], errors, part, group))
    return accuracy


def _cost_of_chunks(total: int, batch: int) -> int:
    """Matrices computed, a call counted as a thousand of them."""
    return -(-total // batch) * (batch + 1000)


def _function(name: str) -> Callable[[jax.Array], jax.Array]:
    return lambda matrix: jaxrot.nearest_rotation(matrix, method=name)

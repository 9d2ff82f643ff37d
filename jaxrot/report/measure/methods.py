"""Error and time of every method of jaxrot."""

import time
from collections.abc import Callable, Mapping, Sequence

import jax
import numpy as np

import jaxrot
from jaxrot.evaluation import reference
from jaxrot.evaluation.accuracy import Accuracy, measure_errors, run_in_chunks, summarise
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.evaluation.timing import FEWEST_ROUNDS, Compiled, Timing, compile_method, time_methods
from jaxrot.report.plan import Plan


class Programs:
    """The methods in one dtype, compiled for every batch size.

    Errors and times come from the same programs, because compiling takes longer than either.
    """

    def __init__(self, methods: Sequence[str], dtype: str, batches: Sequence[int]) -> None:
        self.methods, self.dtype = methods, dtype
        # The first compilation in a process initialises XLA. Do it here, so that no method's compile time includes it.
        compile_method(lambda matrix: matrix + 1, 1, dtype)
        self.compiled: dict[int, dict[str, Compiled]] = {}
        for batch in batches:
            self.compile_for(batch)

    def compile_for(self, batch: int) -> None:
        """Adds a batch size."""
        self.compiled[batch] = {name: compile_method(method_function(name), batch, self.dtype) for name in self.methods}

    def run(self, name: str, matrices: np.ndarray) -> np.ndarray:
        """The rotations of any number of matrices, in chunks of the batch size that costs least."""

        def cost(batch: int) -> int:
            # A call costs about as much as a thousand matrices.
            return -(-len(matrices) // batch) * (batch + 1000)

        batch = min(self.compiled, key=cost)
        return run_in_chunks(self.compiled[batch][name].call, matrices, batch)


def method_function(name: str) -> Callable[[jax.Array], jax.Array]:
    """`nearest_rotation` by a method."""
    return lambda matrix: jaxrot.nearest_rotation(matrix, method=name)


def judge_methods(programs: Programs, judged: Mapping[str, Judged]) -> list[Accuracy]:
    """The accuracy of every method on every set, the sets by group."""
    accuracy = []
    for name in programs.methods:
        for group, part in judged.items():
            errors = measure_errors(programs.run(name, part.matrices), part)
            accuracy.extend(summarise(name, jaxrot.METHODS[name], errors, part, group))
    return accuracy


def time_batches(plan: Plan, programs: Programs, matrices: np.ndarray) -> tuple[list[Timing], list[str]]:
    """The times of every method at every batch size, and a remark if the last batch size was left out."""
    budget = plan.timing_budget_s / len(plan.dtypes)
    timing: list[Timing] = []

    def time_batch(batch: int, budget_s: float) -> None:
        timing.extend(time_methods(programs.compiled[batch], matrices, batch, budget_s=budget_s))

    start = time.perf_counter()
    to_time = len(plan.batches) + (plan.batch_if_time_permits is not None)
    for position, batch in enumerate(plan.batches):
        time_batch(batch, (budget - (time.perf_counter() - start)) / (to_time - position))
    if (extra := plan.batch_if_time_permits) is None:
        return timing, []
    largest = [entry for entry in timing if entry.batch == plan.batches[-1]]
    needed = sum(entry.median_ns for entry in largest) * 1e-9 * extra * (FEWEST_ROUNDS + 2)
    if time.perf_counter() - start + needed > budget:
        dtype = programs.dtype
        return timing, [f"Batch {extra:,} in {dtype} was left out to save {needed:.0f} s; --batch {extra} times it."]
    programs.compile_for(extra)
    time_batch(extra, needed)
    return timing, []


def precision_remarks(dtype: str) -> list[str]:
    """A remark if this machine has no arithmetic that is wide enough to judge the dtype."""
    if np.finfo(dtype).eps >= 64 * reference.EPS:
        return []
    return [f"This machine has no arithmetic much wider than {dtype}: errors near eps include those of the reference."]

"""Time a matrix: compiled beforehand, warmed up, all methods interleaved in rounds."""

import random
import time
from collections.abc import Callable, Hashable, Mapping
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

# One sample is many calls in a row where a call is short: the clock and the loop around it must not be what is timed.
SHORTEST_SAMPLE_S = 2e-3
FEWEST_ROUNDS = 3
MOST_ROUNDS = 31


Name = TypeVar("Name", bound=Hashable)


class Compiled(NamedTuple):
    """A method compiled for one shape.

    Attributes:
        call: From matrices of that shape, and starts where it takes them, to rotations.
        compile_s: Seconds for tracing, lowering and compiling, no cache involved.
    """

    call: Callable
    compile_s: float


class Timing(NamedTuple):
    """The time of one method at one batch size, in ns a matrix.

    Attributes:
        method: The method's name.
        dtype: "float32" or "float64".
        batch: Matrices in a call.
        median_ns: Median over the samples.
        quartile_1_ns: A quarter of the samples were faster.
        quartile_3_ns: A quarter of the samples were slower.
        fastest_ns: The fastest sample.
        samples: Number of samples, each in a round of its own.
        calls_per_sample: Calls in a sample.
        compile_s: Seconds to compile the method for this shape.
    """

    method: str
    dtype: str
    batch: int
    median_ns: float
    quartile_1_ns: float
    quartile_3_ns: float
    fastest_ns: float
    samples: int
    calls_per_sample: int
    compile_s: float


def compile_method(function: Callable, batch: int, dtype: str, *, arguments: int = 1) -> Compiled:
    """Compiles a function of one array (batch, 3, 3), or of several, and takes the time."""
    start = time.perf_counter()
    shape = jax.ShapeDtypeStruct((batch, 3, 3), jnp.dtype(dtype))
    compiled = jax.jit(function).lower(*[shape] * arguments).compile()
    return Compiled(compiled, time.perf_counter() - start)


def fill_batch(matrices: np.ndarray, batch: int) -> np.ndarray:
    """`batch` of the matrices in random order, repeated as often as needed.

    The order is random because a small batch must not be all of one kind, and because runs of equal matrices would let
    a branch predictor learn them.
    """
    order = np.random.default_rng(0).permutation(len(matrices))
    return matrices[np.resize(order, batch)]


def interleave(
    calls: Mapping[Name, Callable[[], object]],
    *,
    budget_s: float,
    clock: Callable[[], float] = time.perf_counter,
    shortest_sample_s: float = SHORTEST_SAMPLE_S,
    fewest_rounds: int = FEWEST_ROUNDS,
    most_rounds: int = MOST_ROUNDS,
) -> tuple[dict[Name, list[float]], dict[Name, int]]:
    """Times several functions in rounds, each once a round and in random order.

    Whatever drifts (clock rate, temperature, somebody else's work) hits all of them alike, and none always runs behind
    the same neighbour, in the cache that this one leaves.

    Args:
        calls: The functions by name; each returns when its work is done.
        budget_s: Rounds begin until this many seconds are spent.
        clock: Seconds, ever rising.
        shortest_sample_s: A sample repeats the call until it takes about that long.
        fewest_rounds: Rounds to run whatever they cost.
        most_rounds: Rounds after which more would not tell more.

    Returns:
        Seconds a call of every sample, and the calls in a sample, by name.
    """
    repeats = {}
    for name, call in calls.items():
        call()  # the first run touches fresh memory
        begin = clock()
        call()
        repeats[name] = max(1, min(1000, round(shortest_sample_s / max(clock() - begin, 1e-9))))
    shuffle = random.Random(0).shuffle
    order = list(calls)
    samples: dict[Name, list[float]] = {name: [] for name in calls}
    start = clock()
    for rounds in range(most_rounds):
        if rounds >= fewest_rounds and clock() - start > budget_s:
            break
        shuffle(order)
        for name in order:
            call = calls[name]
            begin = clock()
            for _ in range(repeats[name]):
                call()
            samples[name].append((clock() - begin) / repeats[name])
    return samples, repeats


def time_methods(
    compiled: Mapping[str, Compiled],
    matrices: np.ndarray,
    batch: int,
    *,
    budget_s: float,
    starts: np.ndarray | None = None,
) -> list[Timing]:
    """Times methods on one batch, side by side.

    Args:
        compiled: The methods, compiled for this batch size and the matrices' dtype.
        matrices: Shape (n, 3, 3), n > 0; the batch is filled with them.
        batch: Matrices in a call.
        budget_s: Seconds to spend, roughly.
        starts: The rotations that the methods start from, one a matrix, where they take them.

    Returns:
        One `Timing` a method, in the same order.
    """
    arrays = [matrices] if starts is None else [matrices, starts]
    # Equally many: the same random order, so that every matrix keeps its start.
    on_device = [jax.device_put(fill_batch(array, batch)) for array in arrays]
    calls = {name: _blocking(method.call, on_device) for name, method in compiled.items()}
    samples, repeats = interleave(calls, budget_s=budget_s)
    timings = []
    for name, seconds in samples.items():
        nanoseconds = np.asarray(seconds) * 1e9 / batch
        first, median, third = np.quantile(nanoseconds, [0.25, 0.5, 0.75]).tolist()
        timings.append(
            Timing(
                method=name,
                dtype=matrices.dtype.name,
                batch=batch,
                median_ns=median,
                quartile_1_ns=first,
                quartile_3_ns=third,
                fastest_ns=float(nanoseconds.min()),
                samples=len(seconds),
                calls_per_sample=repeats[name],
                compile_s=compiled[name].compile_s,
            )
        )
    return timings


def _blocking(call: Callable, arguments: list[jax.Array]) -> Callable[[], object]:
    return lambda: jax.block_until_ready(call(*arguments))

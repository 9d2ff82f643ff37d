"""Time per matrix, in interleaved rounds of compiled and warmed up methods."""

import random
import time
from collections.abc import Callable, Hashable, Mapping
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

# A sample of a short call repeats it, so that the clock and the loop add little to the time.
SHORTEST_SAMPLE_S = 2e-3
FEWEST_ROUNDS = 3
MOST_ROUNDS = 31

Name = TypeVar("Name", bound=Hashable)


class Compiled(NamedTuple):
    """A method compiled for one shape."""

    call: Callable  # From matrices of that shape, and starts if it takes them, to rotations
    compile_s: float  # Seconds for tracing, lowering and compiling, no cache involved


class Timing(NamedTuple):
    """The time of one method at one batch size, in ns per matrix."""

    method: str  # The method's name
    dtype: str  # "float32" or "float64"
    batch: int  # Matrices in a call
    median_ns: float  # Median over the samples
    quartile_1_ns: float  # A quarter of the samples were faster
    quartile_3_ns: float  # A quarter of the samples were slower
    fastest_ns: float  # The fastest sample
    samples: int  # Number of samples, each in a round of its own
    calls_per_sample: int  # Calls in a sample
    compile_s: float  # Seconds to compile the method for this shape


def compile_method(function: Callable, batch: int, dtype: str, *, arguments: int = 1) -> Compiled:
    """Returns the compiled function of one or several arrays (batch, 3, 3), and the seconds to compile it."""
    start = time.perf_counter()
    shape = jax.ShapeDtypeStruct((batch, 3, 3), jnp.dtype(dtype))
    compiled = jax.jit(function).lower(*[shape] * arguments).compile()
    return Compiled(compiled, time.perf_counter() - start)


def fill_batch(matrices: np.ndarray, batch: int) -> np.ndarray:
    """`batch` of the matrices in random order, repeated as often as needed.

    In their own order a small batch would hold matrices of one kind only, and a branch predictor would learn the kind.
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
    """Returns the seconds per call of every sample, and the number of calls in a sample, by name.

    Every function runs once in a round. Interleaving spreads drift (clock rate, temperature, other load) evenly. The
    random order keeps any function from always inheriting the cache state of the same predecessor. A function returns
    when its work is done. A sample repeats a call until it takes about `shortest_sample_s`. After `fewest_rounds`, a
    round starts only if fewer seconds than `budget_s` are spent.
    """
    repeats = {}
    for name, call in calls.items():
        call()  # the first call touches fresh memory
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
    """Returns the time of each method on the same batch, which the matrices fill, from interleaved rounds.

    The methods are compiled for this batch size and the matrices' dtype. `starts` holds one rotation for each matrix,
    if the methods take a start.
    """
    arrays = [matrices] if starts is None else [matrices, starts]
    # Both arrays have the same length and get the same random order, so that every matrix keeps its start.
    on_device = [jax.device_put(fill_batch(array, batch)) for array in arrays]
    calls = {name: blocking(method.call, *on_device) for name, method in compiled.items()}
    samples, repeats = interleave(calls, budget_s=budget_s)
    timings = []
    for name, seconds in samples.items():
        fastest, first, median, third = (np.quantile(seconds, [0, 0.25, 0.5, 0.75]) * 1e9 / batch).tolist()
        times = {"median_ns": median, "quartile_1_ns": first, "quartile_3_ns": third, "fastest_ns": fastest}
        counts = {"batch": batch, "samples": len(seconds), "calls_per_sample": repeats[name]}
        timings.append(Timing(name, matrices.dtype.name, **times, **counts, compile_s=compiled[name].compile_s))
    return timings


def blocking(call: Callable, *arguments: Any) -> Callable[[], object]:
    """The call as a function that returns when its result is ready."""
    return lambda: jax.block_until_ready(call(*arguments))

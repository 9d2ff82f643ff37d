"""`report --bench`: the library's own speed goals, as ratios of times in the same rounds."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxrot
from jaxrot.evaluation.timing import MOST_ROUNDS, SHORTEST_SAMPLE_S, blocking, compile_method, interleave
from jaxrot.report.measure.methods import method_function


class Size(NamedTuple):
    """How large the batches are, and how long a group of functions is timed."""

    small: int = 100
    middle: int = 100_000
    large: int = 1_000_000
    growth: tuple[int, ...] = (10_000, 100_000, 1_000_000, 10_000_000)
    budget_s: float = 12.0


class Goal(NamedTuple):
    """One line of the table."""

    what: str  # The quantity
    batch: int  # Matrices in a call
    median: float  # Of the ratios in the rounds; or the only value
    quartile_1: float  # Lower quartile of the ratios
    quartile_3: float  # Upper quartile of the ratios
    bound: float  # The goal
    at_least: bool  # The bound is a lower bound

    @property
    def is_met(self) -> bool:
        """Whether the median keeps the bound."""
        return self.median >= self.bound if self.at_least else self.median <= self.bound


class Bench(NamedTuple):
    """Everything that `--bench` measures; `nanoseconds` are medians per matrix, by function and batch."""

    goals: list[Goal]
    nanoseconds: dict[str, float]


def run_bench(size: Size) -> Bench:
    """Measures all groups of functions, inside `measuring_configuration`."""
    bench = Bench([], {})
    for measure_group in (_middle, _large, _growth, _small, _compile_times):
        measure_group(bench, size)
    return bench


def _gaussian(count: int, dtype: str = "float32") -> jax.Array:
    return jnp.asarray(np.random.default_rng(0).standard_normal((count, 3, 3), np.float32), dtype)


def _copy(matrix: jax.Array) -> jax.Array:
    return matrix * 1.5


def _with_pullback(matrix: jax.Array) -> tuple[jax.Array, jax.Array]:
    rotation, pullback = jax.vjp(jaxrot.nearest_rotation, matrix)
    return rotation, pullback(matrix)[0]


def _newton(matrix: jax.Array, rotation: jax.Array) -> jax.Array:
    return jaxrot.refine_rotation(matrix, rotation, step="newton", iterations=1)


def _time(
    bench: Bench,
    functions: Mapping[str, tuple[Callable, tuple]],
    size: Size,
    shortest_sample_s: float = SHORTEST_SAMPLE_S,
    most_rounds: int = MOST_ROUNDS,
) -> dict[str, np.ndarray]:
    """The seconds of every round, by name. The medians per matrix are added to the bench."""
    calls = {
        name: blocking(jax.jit(function).lower(*given).compile(), *given)
        for name, (function, given) in functions.items()
    }
    samples, _ = interleave(calls, budget_s=size.budget_s, shortest_sample_s=shortest_sample_s, most_rounds=most_rounds)
    for name, seconds in samples.items():
        batch = len(functions[name][1][0])
        bench.nanoseconds[f"{name}, batch {batch:,}"] = float(np.median(seconds)) / batch * 1e9
    return {name: np.asarray(seconds) for name, seconds in samples.items()}


def _add(
    bench: Bench, what: str, batch: int, ratio: np.ndarray, *, at_least: float | None = None, at_most: float = 0.0
) -> None:
    first, median, third = np.quantile(ratio, [0.25, 0.5, 0.75]).tolist()
    is_lower, bound = at_least is not None, at_most if at_least is None else at_least
    bench.goals.append(Goal(what, batch, median, quartile_1=first, quartile_3=third, bound=bound, at_least=is_lower))


def _middle(bench: Bench, size: Size) -> None:
    batch = size.middle
    a, wide = _gaussian(batch), _gaussian(batch, "float64")
    warm = jaxrot.nearest_rotation(a + 0.05)
    functions = {
        "default": (jaxrot.nearest_rotation, (a,)),
        "svd": (method_function("svd"), (a,)),
        "newton step": (_newton, (a, warm)),
        "quaternion_average": (method_function("quaternion_average"), (a,)),
        "value and VJP": (_with_pullback, (a,)),
        "default, float64": (jaxrot.nearest_rotation, (wide,)),
    }
    t = _time(bench, functions, size)
    _add(bench, "svd over default", batch, t["svd"] / t["default"], at_least=25)
    _add(bench, "svd over one newton step", batch, t["svd"] / t["newton step"], at_least=100)
    _add(bench, "svd over quaternion_average", batch, t["svd"] / t["quaternion_average"], at_least=100)
    _add(bench, "value and VJP over value", batch, t["value and VJP"] / t["default"], at_most=2.5)
    _add(bench, "float64 over float32", batch, t["default, float64"] / t["default"], at_most=2.5)


def _large(bench: Bench, size: Size) -> None:
    batch = size.large
    a = _gaussian(batch)
    warm = jaxrot.in_blocks(jaxrot.nearest_rotation)(a + 0.05)
    functions = {
        "copy": (_copy, (a,)),
        "svd": (method_function("svd"), (a,)),
        "default at once": (jaxrot.nearest_rotation, (a,)),
        "default in blocks": (jaxrot.in_blocks(jaxrot.nearest_rotation), (a,)),
        "newton step in blocks": (jaxrot.in_blocks(_newton), (a, warm)),
        "quaternion_average in blocks": (jaxrot.in_blocks(method_function("quaternion_average")), (a,)),
    }
    t = _time(bench, functions, size)
    _add(bench, "svd over default in blocks", batch, t["svd"] / t["default in blocks"], at_least=20)
    _add(bench, "default in blocks over copy", batch, t["default in blocks"] / t["copy"], at_most=4)
    _add(bench, "newton step in blocks over copy", batch, t["newton step in blocks"] / t["copy"], at_most=2)
    average = t["quaternion_average in blocks"]
    _add(bench, "quaternion_average in blocks over copy", batch, average / t["copy"], at_most=2)
    memory = jax.jit(functions["default in blocks"][0]).lower(a).compile().memory_analysis()
    if memory is not None:
        mebibytes = np.array(memory.temp_size_in_bytes / 2**20)
        _add(bench, "MiB of temporary arrays, in blocks", batch, mebibytes, at_most=64)


def _growth(bench: Bench, size: Size) -> None:
    functions = {
        f"default in blocks of the batch {count:,}": (jaxrot.in_blocks(jaxrot.nearest_rotation), (_gaussian(count),))
        for count in size.growth
    }
    # Use long samples: after a batch of 1e7 the first calls of a small one miss the cache.
    t = _time(bench, functions, size, shortest_sample_s=size.budget_s / 100)
    per_matrix = np.stack([seconds / count for seconds, count in zip(t.values(), size.growth, strict=True)])
    ratio = per_matrix.max(0) / per_matrix.min(0)
    _add(bench, "slowest over fastest batch, a matrix", size.growth[-1], ratio, at_most=1.5)


def _small(bench: Bench, size: Size) -> None:
    exact = [name for name, method in jaxrot.METHODS.items() if method.exact]
    for batch in (1, size.small):
        a = _gaussian(batch)
        # One call per sample: in a row of short calls, a few wait for a thread as long as all the others take.
        functions = {name: (method_function(name), (a,)) for name in exact}
        t = _time(bench, functions, size, shortest_sample_s=0.0, most_rounds=500)
        fastest = min(set(exact) - {jaxrot.DEFAULT_METHOD}, key=lambda name: np.median(t[name]))
        ratio = t[jaxrot.DEFAULT_METHOD] / t[fastest]
        _add(bench, f"default over {fastest}, the fastest other exact method", batch, ratio, at_most=1.3)


def _compile_times(bench: Bench, size: Size) -> None:
    compile_method(_copy, 1, "float32")  # the first compilation in a process initialises XLA
    seconds = {
        name: compile_method(method_function(name), size.middle + 1, "float32").compile_s for name in jaxrot.METHODS
    }
    slowest = max(seconds, key=lambda name: seconds[name])
    for name in dict.fromkeys((jaxrot.DEFAULT_METHOD, slowest)):
        _add(bench, f"seconds to compile {name}", size.middle + 1, np.array(seconds[name]), at_most=1.5)

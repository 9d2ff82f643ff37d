import numpy as np
import pytest

from jaxrot.evaluation import timing


class Clock:
    """Time that passes only when a function takes it, and a record of who ran."""

    def __init__(self):
        self.now, self.log = 0.0, []

    def __call__(self):
        return self.now

    def function(self, name, seconds):
        def call():
            self.log.append(name)
            self.now += seconds if isinstance(seconds, float) else seconds()

        return call


def interleave(clock, calls, **options):
    options = {"budget_s": 1e9, "most_rounds": 8, "shortest_sample_s": 0.0} | options
    return timing.interleave(calls, clock=clock, **options)


def test_every_method_runs_once_in_every_round():
    clock = Clock()
    calls = {name: clock.function(name, 1.0) for name in "abc"}
    samples, repeats = interleave(clock, calls)
    rounds = np.reshape(clock.log[2 * len(calls) :], (8, 3))
    assert all(sorted(row) == ["a", "b", "c"] for row in rounds.tolist())
    assert len({tuple(row) for row in rounds.tolist()}) > 1, "always the same order, always the same neighbours"
    assert samples == {name: [1.0] * 8 for name in "abc"}
    assert repeats == dict.fromkeys("abc", 1)


def test_a_short_call_is_repeated_within_a_sample_and_drift_hits_all_methods_alike():
    clock = Clock()
    calls = {"short": clock.function("short", 1e-4), "long": clock.function("long", 1.0)}
    samples, repeats = interleave(clock, calls, shortest_sample_s=2e-3)
    assert repeats == {"short": 20, "long": 1}
    assert samples["short"] == pytest.approx([1e-4] * 8)
    clock = Clock()
    slower_and_slower = lambda: 1.0 + clock.now / 100  # noqa: E731
    samples, _ = interleave(clock, {name: clock.function(name, slower_and_slower) for name in "ab"}, most_rounds=30)
    a, b = np.median(samples["a"]), np.median(samples["b"])
    assert abs(a - b) / a < 0.1
    assert samples["a"][-1] > 1.5 * samples["a"][0]


def test_the_budget_ends_the_rounds_but_not_before_the_fewest_and_the_first_call_is_not_counted():
    clock = Clock()
    samples, _ = interleave(clock, {"a": clock.function("a", 1.0)}, budget_s=4.5, most_rounds=99, fewest_rounds=3)
    assert len(samples["a"]) == 5
    samples, _ = interleave(clock, {"a": clock.function("a", 1.0)}, budget_s=0.0, most_rounds=99, fewest_rounds=3)
    assert len(samples["a"]) == 3
    clock = Clock()
    cost = iter([1000.0] + [1.0] * 99)
    samples, _ = interleave(clock, {"a": clock.function("a", lambda: next(cost))})
    assert max(samples["a"]) == 1.0


def test_a_batch_is_filled_with_all_the_matrices():
    matrices = np.arange(5 * 9, dtype=np.float32).reshape(5, 3, 3)
    filled = timing.fill_batch(matrices, 12)
    assert filled.shape == (12, 3, 3)
    assert {matrix[0, 0] for matrix in filled} == {matrix[0, 0] for matrix in matrices}
    assert timing.fill_batch(matrices, 2).shape == (2, 3, 3)


def test_times_are_per_matrix_and_compile_time_is_apart():
    matrices = np.ones((4, 3, 3), np.float32)
    compiled = {"double": timing.compile_method(lambda matrix: 2 * matrix, 64, "float32")}
    (entry,) = timing.time_methods(compiled, matrices, 64, budget_s=0.05)
    assert entry.compile_s == compiled["double"].compile_s > 0
    assert 0 < entry.fastest_ns <= entry.quartile_1_ns <= entry.median_ns <= entry.quartile_3_ns
    assert entry.median_ns < 1e9 * 0.05 / 64
    assert (entry.method, entry.dtype, entry.batch) == ("double", "float32", 64)


def test_every_matrix_keeps_its_start():
    matrices = np.arange(5 * 9, dtype=np.float32).reshape(5, 3, 3)
    pairs = []

    def call(matrix, start):
        pairs.append((np.asarray(matrix), np.asarray(start)))
        return matrix

    timing.time_methods({"own": timing.Compiled(call, 0.0)}, matrices, 7, budget_s=0.0, starts=-matrices)
    assert all(matrix.shape == (7, 3, 3) and (matrix == -start).all() for matrix, start in pairs)
    compiled = timing.compile_method(lambda matrix, start: matrix - start, 4, "float32", arguments=2)
    assert compiled.call(matrices[:4], -matrices[:4]).tolist() == (2 * matrices[:4]).tolist()

"""How much a report measures."""

from typing import NamedTuple

import jaxrot


class GuardsPlan(NamedTuple):
    """How much is measured for each guard."""

    batch: int = 100_000  # Matrices in a timed call. It grows to the number of judged matrices if these are more
    matrices_a_family: int = 500  # Matrices drawn from each family for the default method
    starts_a_family: int = 60  # Matrices drawn from each family for the steps, each with four starts
    budget_s: float = 1.5  # Seconds to time one method or step with and without each of its guards, roughly


class Plan(NamedTuple):
    """What to measure, and how much of it: by default a full report with peers."""

    methods: tuple[str, ...] = tuple(jaxrot.METHODS)  # Names from `jaxrot.METHODS`
    dtypes: tuple[str, ...] = ("float32", "float64")
    batches: tuple[int, ...] = (100, 10_000, 100_000)  # Batch sizes to time, ascending
    batch_if_time_permits: int | None = 1_000_000  # One more, timed if `timing_budget_s` is not spent by then
    clusters: int = 400  # Clusters of the dragon, if the user gives no file
    most_matrices: int = 200_000  # Matrices of the user's file that are measured at most
    matrices_a_family: int = 200  # Matrices drawn from each family
    timing_budget_s: float = 70.0  # Seconds for all timing of methods together, roughly
    peers_budget_s: float | None = 40.0  # Seconds to time peers in all dtypes; None leaves peers out
    warm_starts_budget_s: float | None = 16.0  # Seconds to time warm starts in all dtypes; None leaves them out
    map_steps: int | None = 64  # Steps of the stability maps along s2/s1, a power of two; None leaves the maps out
    guards: GuardsPlan | None = GuardsPlan()  # How much to measure of the guards; None leaves them out


FULL = Plan()
QUICK = Plan(
    dtypes=("float32",),
    batches=(10_000,),
    batch_if_time_permits=None,
    clusters=100,
    most_matrices=20_000,
    matrices_a_family=20,
    timing_budget_s=4.0,
    peers_budget_s=4.0,
    warm_starts_budget_s=None,
    map_steps=None,
    guards=None,
)

"""Records of what is measured beside each other, jaxrot's methods and its peers, and who is beyond whose front."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

_AS_ACCURATE = 1.1


class Spread(NamedTuple):
    """Median and quartiles of the time a matrix, in ns."""

    median: float
    quartile_1: float
    quartile_3: float


class Quantiles(NamedTuple):
    """Median, 99th percentile and largest of some errors; infinite where one is no number."""

    median: float
    percentile_99: float
    largest: float


def quantiles(values: np.ndarray) -> Quantiles | None:
    """Of what is a number or infinite; None where nothing is."""
    values = values[~np.isnan(values)]
    # "higher" interpolates nothing: between a number and an infinity there is no number.
    return Quantiles(*np.quantile(values, [0.5, 0.99, 1.0], method="higher").tolist()) if values.size else None


def spread(seconds: Sequence[float], batch: int) -> Spread:
    """The time a matrix of samples that are seconds a call."""
    first, median, third = (np.quantile(seconds, [0.25, 0.5, 0.75]) * 1e9 / batch).tolist()
    return Spread(median, first, third)


class Contender(NamedTuple):
    """One method of jaxrot, or one peer, on the input in one dtype.

    Attributes:
        name: Its name.
        description: What it is.
        is_own: It is jaxrot's.
        dtype: "float32" or "float64", of the matrices and of the result.
        computes_in: The dtype it computes in.
        threads: Threads that compute.
        batch: Matrices in a call.
        no_result: Finite matrices for which it gives no rotation (NaN, or it refuses them); their error is infinite.
        outside: Matrices outside the contract, these included.
        error: ‖R − R*‖_F, where R* is determined.
        time: Of the value; None where it takes none of the matrices.
        gradient_error: ‖Ā − Ā*‖_F / ‖Ā*‖_F of the cotangents of A for a random one of R, where κ ≤ 1/(128 eps); None
            without a derivative. Infinite where it is no number.
        gradient_no_number: Of the input, matrices whose gradient is no number.
        families_no_number: Families of `jaxrot.families` with a finite matrix whose gradient is no number.
        gradient_time: Of value and gradient together.
    """

    name: str
    description: str
    is_own: bool
    dtype: str
    computes_in: str
    threads: int
    batch: int
    no_result: int
    outside: int
    error: Quantiles | None
    time: Spread | None
    gradient_error: Quantiles | None
    gradient_no_number: int
    families_no_number: tuple[str, ...]
    gradient_time: Spread | None


class Beside(NamedTuple):
    """What came of it: the contenders of every dtype, and which peers were skipped and why, one line each."""

    contenders: list[Contender]
    skipped: list[str]


def beyond_front(contenders: Sequence[Contender], *, of_gradients: bool) -> list[Contender]:
    """The peers that no method of jaxrot's beats in the same dtype: none is as accurate and as fast.

    As fast by the spread of the times; as accurate to a tenth, which is what two roundings of one number may differ by.
    """

    def place(contender: Contender) -> tuple[Quantiles | None, Spread | None]:
        if of_gradients:
            return contender.gradient_error, contender.gradient_time
        return contender.error, contender.time

    def is_beaten(peer: Contender) -> bool:
        error, time = place(peer)
        if error is None or time is None:
            return True
        own = [place(other) for other in contenders if other.is_own and other.dtype == peer.dtype]
        return any(
            e is not None
            and t is not None
            and e.percentile_99 <= _AS_ACCURATE * error.percentile_99
            and t.quartile_1 <= time.median
            for e, t in own
        )

    return [contender for contender in contenders if not contender.is_own and not is_beaten(contender)]

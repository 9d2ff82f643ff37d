"""The Pareto front of error and time, and the peers that extend it."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

import jaxrot
from jaxrot.report.measure.peer_comparison import ComparedMethod
from jaxrot.report.measure.results import Quantiles, Results, Spread, on_input, times_at_largest_batch

EXACT, APPROXIMATION, PEER = "exact method", "approximation", "another package"
# Two roundings of one error may differ by a tenth.
_AS_ACCURATE = 1.1


class Point(NamedTuple):
    """Time and error of one method or peer."""

    name: str  # The method or peer
    time_ns: float  # Median time per matrix
    error: float  # The error that places it: the 99th percentile
    error_median: float  # Lower end of its whisker
    error_max: float  # Upper end of its whisker
    kind: str  # `EXACT`, `APPROXIMATION` or `PEER`
    is_beyond: bool = False  # It is a peer beyond jaxrot's front


def pareto_front(points: Iterable[Point]) -> list[Point]:
    """The points that no other point beats in time and error, the fastest first.

    A point with an infinite error is on no front, however fast it is.
    """
    front: list[Point] = []
    finite = [point for point in points if np.isfinite(point.error)]
    for point in sorted(finite, key=lambda point: (point.time_ns, point.error)):
        is_twin = bool(front) and (point.time_ns, point.error) == (front[-1].time_ns, front[-1].error)
        if not front or point.error < front[-1].error or is_twin:
            front.append(point)
    return front


def method_points(results: Results, dtype: str) -> list[Point]:
    """Every method on the whole input at the largest batch."""
    accuracy = on_input(results, dtype)
    return [
        _point(name, timing.median_ns, Quantiles(entry.forward_median, entry.forward_99th, entry.forward_max))
        for name, timing in times_at_largest_batch(results, dtype).items()
        if (entry := accuracy[name]).forward_99th is not None
        and entry.forward_median is not None
        and entry.forward_max is not None
    ]


def peer_points(compared: Sequence[ComparedMethod], dtype: str, *, of_gradients: bool) -> list[Point]:
    """The methods and peers that have an error and a time."""
    beyond = beyond_front(compared, of_gradients=of_gradients)
    return [
        _point(entry.name, time.median, error, is_peer=not entry.is_own)._replace(is_beyond=entry in beyond)
        for entry in compared
        if entry.dtype == dtype and (place := placed(entry, of_gradients=of_gradients)) is not None
        for error, time in [place]
    ]


def placed(entry: ComparedMethod, *, of_gradients: bool) -> tuple[Quantiles, Spread] | None:
    """Error and time of the value or of the gradient; None if one of them is missing."""
    error, time = (entry.gradient_error, entry.gradient_time) if of_gradients else (entry.error, entry.time)
    return None if error is None or time is None else (error, time)


def beyond_front(compared: Sequence[ComparedMethod], *, of_gradients: bool) -> list[ComparedMethod]:
    """The peers that no method of jaxrot beats in the same dtype: none is as accurate and as fast.

    Two errors count as equal up to a tenth, two times up to the spread.
    """

    def is_beyond(peer: ComparedMethod) -> bool:
        place = placed(peer, of_gradients=of_gradients)
        own = [
            placed(entry, of_gradients=of_gradients) for entry in compared if entry.is_own and entry.dtype == peer.dtype
        ]
        return place is not None and not any(
            error.percentile_99 <= _AS_ACCURATE * place[0].percentile_99 and time.quartile_1 <= place[1].median
            for error, time in filter(None, own)
        )

    return [entry for entry in compared if not entry.is_own and is_beyond(entry)]


def _point(name: str, time_ns: float, error: Quantiles, *, is_peer: bool = False) -> Point:
    method = jaxrot.METHODS.get(name)
    # The default method in another dtype has a name of its own.
    kind = EXACT if method is None or method.exact else APPROXIMATION
    return Point(
        name=name,
        time_ns=time_ns,
        error=error.percentile_99,
        error_median=error.median,
        error_max=error.largest,
        kind=PEER if is_peer else kind,
    )

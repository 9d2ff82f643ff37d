"""What a peer is: how to hand it matrices, how to run it, and what to know about it."""

import importlib.util
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np


class UnavailableError(Exception):
    """Why a peer cannot run here, in a few words."""


class Peer(NamedTuple):
    """A peer, ready for one dtype. "Own" arrays are whatever its package computes with, in its memory.

    Attributes:
        load: From (n, 3, 3) NumPy matrices to its own; not timed.
        value: From its own matrices to its own rotations; returns when they are there.
        pullback: From its own matrices and cotangents of R to (rotations, cotangents of A); None where it has no
            derivative.
        unload: From its own array to NumPy, (n, 3, 3); NaN where it refused a matrix.
        threads: Threads that compute.
        computes_in: The dtype it computes in, whatever it is given.
        accepts: From (n, 3, 3) matrices to whether it takes each; None where it takes all. It is timed on these alone.
    """

    load: Callable[[np.ndarray], Any]
    value: Callable[[Any], Any]
    pullback: Callable[[Any, Any], tuple[Any, Any]] | None
    unload: Callable[[Any], np.ndarray]
    threads: int
    computes_in: str
    accepts: Callable[[np.ndarray], np.ndarray] | None = None


class Source(NamedTuple):
    """Where a peer comes from.

    Attributes:
        description: What it is, for the report.
        needs: Modules it imports.
        make: From "float32" or "float64" to the peer; raises `UnavailableError`.
        largest_batch: Matrices it can be asked for at once without the report taking all day.
    """

    description: str
    needs: tuple[str, ...]
    make: Callable[[str], Peer]
    largest_batch: int = 100_000


def make_peer(source: Source, dtype: str) -> Peer:
    """The peer, or why there is none.

    Raises:
        UnavailableError: A package is not installed, or the peer cannot run on this machine.
    """
    missing = [name for name in source.needs if importlib.util.find_spec(name) is None]
    if missing:
        raise UnavailableError(f"{' and '.join(missing)} not installed")
    try:
        return source.make(dtype)
    except (ImportError, AttributeError, OSError) as error:
        raise UnavailableError(f"it does not start ({' '.join(str(error).split())})") from None

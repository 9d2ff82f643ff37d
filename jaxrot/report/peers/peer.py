"""The record of a peer: how to pass matrices to it, how to run it, and what it computes with."""

import importlib.util
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np


class UnavailableError(Exception):
    """Why a peer cannot run here, in a few words."""


class Peer(NamedTuple):
    """A peer, ready for one dtype. Its own arrays are those of its package, in the memory where it computes."""

    load: Callable[[np.ndarray], Any]  # From (n, 3, 3) NumPy matrices to its own; not timed
    value: Callable[[Any], Any]  # From its own matrices to its own rotations; returns when they are there
    # From its own matrices and cotangents of R to (rotations, cotangents of A); None if it has no derivative.
    pullback: Callable[[Any, Any], tuple[Any, Any]] | None
    unload: Callable[[Any], np.ndarray]  # From its own array to NumPy, (n, 3, 3); NaN for a refused matrix
    threads: int  # Threads that compute
    computes_in: str  # The dtype it computes in, whatever it is given
    # From (n, 3, 3) matrices to whether it takes each; None if it takes all. Only accepted matrices are timed.
    accepts: Callable[[np.ndarray], np.ndarray] | None = None


class Source(NamedTuple):
    """Where a peer comes from."""

    description: str  # What it is, for the report
    needs: tuple[str, ...]  # Modules it imports
    make: Callable[[str], Peer]  # From "float32" or "float64" to the peer; raises `UnavailableError`
    largest_batch: int = 100_000  # Matrices it can be asked for at once without the report taking all day


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

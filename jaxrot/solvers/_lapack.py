"""A guard for solvers that call LAPACK."""

import functools
from collections.abc import Callable

import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3


def finite_only(solve: Callable[[Mat3], Mat3]) -> Callable[[Mat3], Mat3]:
    """Gives a solver zeros instead of NaN, and returns NaN there.

    Scaling turns a matrix with an infinite entry into NaN. On some processors LAPACK's singular value decomposition
    never returns from such a matrix.
    """

    @functools.wraps(solve)
    def guarded(a: Mat3) -> Mat3:
        is_nan = jnp.isnan(a[0][0])
        rotation = solve(mat3.where(is_nan, mat3.scale(mat3.identity_like(a), 0.0), a))
        return mat3.where(is_nan, a, rotation)

    return guarded

"""A guard for solvers that call LAPACK."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3


def finite_only(solve: Callable[[Mat3], Mat3]) -> Callable[[Mat3], Mat3]:
    """Gives a solver zeros in place of a matrix with NaN, and returns NaN there.

    Scaling turns an infinite entry into NaN. On some processors LAPACK's singular value decomposition never returns
    from a matrix that is not finite.
    """

    @functools.wraps(solve)
    def guarded(a: Mat3) -> Mat3:
        largest = mat3.largest_entry(a)
        is_nan = jnp.isnan(largest)
        rotation = solve(jax.tree.map(lambda entry: jnp.where(is_nan, jnp.zeros_like(entry), entry), a))
        return jax.tree.map(lambda entry: jnp.where(is_nan, largest, entry), rotation)

    return guarded

"""A guard for solvers that call LAPACK."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp


def finite_only(solve: Callable[[jax.Array], jax.Array]) -> Callable[[jax.Array], jax.Array]:
    """Keeps matrices that are not finite from a solver, and returns NaN for them.

    LAPACK's singular value decomposition never returns from an infinite matrix on some processors.
    """

    @functools.wraps(solve)
    def guarded(matrix: jax.Array) -> jax.Array:
        is_finite = jnp.isfinite(matrix).all(axis=(-2, -1), keepdims=True)
        rotation = solve(jnp.where(is_finite, matrix, jnp.zeros_like(matrix)))
        return jnp.where(is_finite, rotation, jnp.full_like(rotation, jnp.nan))

    return guarded

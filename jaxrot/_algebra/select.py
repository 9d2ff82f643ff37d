"""Selection without branches."""

import jax
import jax.numpy as jnp
from jax import lax


def is_positive(x: jax.Array) -> jax.Array:
    """Whether x > 0, from a quotient, which XLA:CPU does not recompute."""
    return x / (jnp.abs(x) + float(jnp.finfo(x.dtype).tiny)) > 0


def constant_like(x: jax.Array, value: float) -> jax.Array:
    """Returns an array of one value that is batched and sharded like x, also inside `vmap`. It is NaN where x is.

    `jnp.full_like` is not batched inside `vmap`. On jax 0.10 and a mesh with Explicit axes such constants fail if two
    of them are selected from, if they are stacked, or if a loop starts from one.
    """
    constant = x.dtype.type(value)
    return lax.clamp(constant, lax.stop_gradient(x), constant)


def sign_of(x: jax.Array) -> jax.Array:
    """−1 where x < 0, +1 elsewhere: sign(0) counts as +1."""
    is_negative = (x < 0).astype(x.dtype)
    return 1 - (is_negative + is_negative)


def exchange(condition: jax.Array, a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """(b, a) where the condition holds, (a, b) elsewhere."""
    return jnp.where(condition, b, a), jnp.where(condition, a, b)


def index_of_largest(values: tuple[jax.Array, ...]) -> jax.Array:
    """The index of the largest value, the first if several are equal, as a floating-point number."""
    # An index has no derivative. Without this line the derivative of a maximum selects between constants, which fails
    # on a mesh with Explicit axes, see `constant_like`.
    values = lax.stop_gradient(values)
    best, index = values[0], constant_like(values[0], 0)
    for i, value in enumerate(values[1:], start=1):
        index = jnp.where(value > best, jnp.full_like(index, i), index)
        best = jnp.maximum(best, value)
    return index


def choose(index: jax.Array, *values: jax.Array) -> jax.Array:
    """The value with this index."""
    chosen = values[-1]
    for i in reversed(range(len(values) - 1)):
        chosen = jnp.where(index < i + 0.5, values[i], chosen)
    return chosen

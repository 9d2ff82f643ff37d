"""Choices, and what is rounding, made once for everything that hangs on them.

XLA:CPU computes what is cheap again in every fusion, with products and sums contracted differently. Where a number is 0
but for rounding, one component of a result could then follow one branch and its neighbour the other: no rotation, or a
wrong one. What is divided it computes once.
"""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._platform import platform

_Tree = TypeVar("_Tree")


def computed_once(values: _Tree, divisor: jax.Array | None = None) -> _Tree:
    """The values, one array or several, over a divisor.

    XLA:CPU stores quotients and computes everything else again where it is used. Where there is no divisor, a CPU
    divides by a 1 that XLA does not see through. Other platforms compute the values of a kernel once: there the values
    without a divisor stay as they are, and one reciprocal serves all of them.
    """
    if platform() != "cpu":
        inverse = None if divisor is None else 1 / divisor
        return values if inverse is None else jax.tree.map(lambda value: value * inverse, values)
    if divisor is None:
        divisor = constant_like(jax.tree.leaves(values)[0], 1)
    return jax.tree.map(lambda value: value / divisor, values)


def is_positive(x: jax.Array) -> jax.Array:
    """Whether x > 0."""
    return x / (jnp.abs(x) + float(jnp.finfo(x.dtype).tiny)) > 0


def constant_like(x: jax.Array, value: float) -> jax.Array:
    """An array of one value that is batched and sharded as x is, also inside `vmap`; NaN where x is.

    `jnp.full_like` is not batched inside `vmap`. A choice between two such constants, a stack of them or a loop that
    starts from one fails on a mesh with Explicit axes on jax 0.10.
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
    """The index of the largest value, the first of equal ones, as a floating-point number."""
    # The derivative of a maximum is such a choice between constants; an index has none.
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

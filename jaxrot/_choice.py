"""Choices, and what is rounding, made once for everything that hangs on them.

XLA:CPU computes what is cheap again in every fusion, with products and sums contracted differently. Where a number is 0
but for rounding, one component of a result could then follow one branch and its neighbour the other: no rotation, or a
wrong one. What is divided it computes once.
"""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax

_Tree = TypeVar("_Tree")


def computed_once(values: _Tree) -> _Tree:
    """The values themselves, one array or several, over a 1 that XLA does not see through.

    That saves time too where many quotients follow: a third of a `newton` step.
    """
    number = 1 + jnp.abs(lax.stop_gradient(jax.tree.leaves(values)[0]))
    # The maximum keeps XLA from turning x/(y/y) into (x y)/y, which rounds.
    one = jnp.maximum(number / number, 0.5)
    return jax.tree.map(lambda value: value / one, values)


def is_positive(x: jax.Array) -> jax.Array:
    """Whether x > 0."""
    return x / (jnp.abs(x) + float(jnp.finfo(x.dtype).tiny)) > 0


def exchange(condition: jax.Array, a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """(b, a) where the condition holds, (a, b) elsewhere."""
    return jnp.where(condition, b, a), jnp.where(condition, a, b)


def index_of_largest(values: tuple[jax.Array, ...]) -> jax.Array:
    """The index of the largest value, the first of equal ones, as a floating-point number."""
    best, index = values[0], jnp.zeros_like(values[0])
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

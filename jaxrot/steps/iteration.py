"""The loop that every step runs in."""

from collections.abc import Callable

import jax.numpy as jnp
from jax import lax

from jaxrot import _mat3, _quaternion
from jaxrot._choice import computed_once
from jaxrot._mat3 import Mat3
from jaxrot._quaternion import Quaternion


def iterate(correction: Callable[[Mat3], Quaternion], a: Mat3, q: Quaternion, iterations: int) -> Quaternion:
    """Applies a step a fixed number of times: Q ← Q · correction(QᵀA).

    Args:
        correction: From B = QᵀA to the quaternion of the rotation to append; any length but 0.
        a: The matrices on components, their scale removed.
        q: The start, a unit quaternion on components of the same batch shape.
        iterations: Static trip count, so that the loop is differentiable in reverse too.

    Returns:
        The unit quaternion after the last step.
    """

    def advance(_, q: Quaternion) -> Quaternion:
        b = _mat3.transpose_multiply(_quaternion.to_rotation(q), a)
        q = _quaternion.product(q, correction(b))
        return computed_once(q, jnp.sqrt(_quaternion.squared_norm(q)))

    return lax.fori_loop(0, iterations, advance, q)

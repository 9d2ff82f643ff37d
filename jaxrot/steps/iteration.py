"""The loop in which every step runs."""

from collections.abc import Callable

import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion


def iterate(correction: Callable[[Mat3], Quaternion], a: Mat3, q: Quaternion, iterations: int) -> Quaternion:
    """Applies a step a fixed number of times: Q ← Q · correction(QᵀA).

    Args:
        correction: From B = QᵀA to the quaternion of the rotation to append; any length but 0.
        a: The matrices on components, their scale removed.
        q: The start, a unit quaternion on components of the same batch shape.
        iterations: Static trip count. It makes the loop differentiable in reverse mode.

    Returns:
        The unit quaternion after the last step.
    """

    def advance(_, q: Quaternion) -> Quaternion:
        b = mat3.transpose_multiply(quaternion.to_rotation(q), a)
        q = quaternion.product(q, correction(b))
        return fusion_barrier(q, jnp.sqrt(quaternion.squared_norm(q)))

    return lax.fori_loop(0, iterations, advance, q)

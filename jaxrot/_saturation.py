"""The scale of a derivative: exact where the dtype can hold it, saturated where it would overflow.

The n-th derivative of what does not depend on the scale of A grows like 1/|A|ⁿ: at |A| = 1e-20 the second one is 1e40.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot import _mat3
from jaxrot._mat3 import Vec3
from jaxrot._scaling import power_of_two_factor


def factor_of(matrix: jax.Array) -> jax.Array:
    """The power of two that normalises A; 0 where A = 0, which makes every derivative there 0."""
    magnitude = _mat3.largest_entry(_mat3.components(lax.stop_gradient(matrix)))
    return jnp.where(magnitude == 0, jnp.zeros_like(magnitude), power_of_two_factor(magnitude))


def gain(factor: jax.Array, norm: jax.Array, order: int) -> jax.Array:
    """The factor, saturated so that the derivatives up to this order stay finite where they would overflow.

    The n-th derivative grows like gⁿ, g = factor·norm. Beyond what the dtype holds the product of the factors is held
    constant, with a margin of 2¹² an order for the number of terms.

    Args:
        factor: The power of two that normalises A, or 0.
        norm: That of the linear map to which the factor belongs, of the normalised A. A constant to differentiation.
        order: How many derivatives have been taken before this one.
    """
    norm = lax.stop_gradient(norm)
    largest = 2.0 ** (jnp.finfo(factor.dtype).maxexp - 3)
    limit = largest * 2.0 ** (-12 * order)
    growth = factor * norm
    lower_orders = 1.0 if order == 0 else jnp.minimum(growth**order, largest * 2.0 ** (-12 * (order - 1)))
    return jnp.where(growth <= limit ** (1 / (order + 1)), factor, limit / lower_orders / norm)


def scaled_response(
    response: Callable[[Vec3], Vec3], load: Vec3, factor: jax.Array, norm: jax.Array, order: int
) -> Vec3:
    """A linear map of a vector, times the saturated factor; arguments as for `gain`.

    The factor is applied in two halves, before and after: at once it could overflow or underflow on one side. Both are
    divisions, because XLA:CPU stores quotients and forms products again in each entry of the result; the transpose,
    the reverse mode, has them in the other order. With products it took 1.7 times as long.
    """
    first_half = power_of_two_factor(lax.rsqrt(jnp.where(factor > 0, factor, jnp.ones_like(factor))))
    return _divided(response(_divided(load, 1 / first_half)), first_half / gain(factor, norm, order))


def _divided(v: Vec3, divisor: jax.Array) -> Vec3:
    # The maximum keeps XLA from turning x/(y/z) into (x z)/y, which overflows.
    divisor = jnp.maximum(divisor, float(jnp.finfo(divisor.dtype).tiny))
    return (v[0] / divisor, v[1] / divisor, v[2] / divisor)

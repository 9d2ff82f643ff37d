"""The scale of a derivative: exact where the dtype can hold it, saturated where it would overflow.

The n-th derivative of what does not depend on the scale of A grows like 1/|A|ⁿ: at |A| = 1e-20 the second one is 1e40.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import power_of_two_factor


def normalising_factor(matrix: Mat3) -> jax.Array:
    """The power of two that normalises A; 0 where A = 0, which makes every derivative there 0."""
    magnitude = mat3.largest_entry(lax.stop_gradient(matrix))
    return jnp.where(magnitude == 0, jnp.zeros_like(magnitude), power_of_two_factor(magnitude))


def saturate(factor: jax.Array, norm: jax.Array, order: int) -> jax.Array:
    """The factor, saturated so that the derivatives up to this order stay finite where they would overflow.

    The n-th derivative grows like factorⁿ·norm²ⁿ⁻¹: each one more has the map on both sides. Beyond what the dtype
    holds the product of the gains and norms is held constant, with a margin of 2¹² an order for the number of terms.

    Args:
        factor: The power of two that normalises A, or 0.
        norm: That of the linear map to which the factor belongs, of the normalised A. Both are constants to
            differentiation.
        order: How many derivatives have been taken before this one.
    """
    factor, norm = lax.stop_gradient((factor, norm))
    largest = 2.0 ** (jnp.finfo(factor.dtype).maxexp - 4)
    # 1 instead of 0 keeps every quotient finite.
    is_zero = factor == 0
    factor = jnp.where(is_zero, jnp.ones_like(factor), factor)
    scale = jnp.minimum(factor, largest / norm)
    tiny = float(jnp.finfo(factor.dtype).tiny)
    spent = jnp.clip(factor * norm, tiny, largest)
    for lower in range(1, order + 1):
        # The minimum keeps XLA from turning x/y/z into x/(y z), which overflows.
        left = jnp.minimum(largest * 2.0 ** (-12 * lower) / spent, largest)
        scale = jnp.minimum(factor, left / (norm * norm))
        spent = jnp.maximum(spent * (scale * norm) * norm, tiny)
    return jnp.where(is_zero, jnp.zeros_like(scale), scale)


def split_scale(scale: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Two factors of about the same size, the first a power of two, whose product is the scale ≥ 0."""
    first = power_of_two_factor(lax.rsqrt(jnp.where(scale > 0, scale, jnp.ones_like(scale))))
    return first, scale / first


def apply_scaled(response: Callable[[Vec3], Vec3], load: Vec3, scale: jax.Array) -> Vec3:
    """A linear map of a vector, times a scale ≥ 0 as large or as small as the dtype has.

    The scale is applied in two halves, before and after: at once it could overflow or underflow on one side. Both are
    divisions, because XLA:CPU stores quotients and forms products again in each entry of the result; the transpose,
    the reverse mode, has them in the other order. With products it took 1.7 times as long.
    """
    # 1/0 would be infinite, which `checkify` and `jax_debug_infs` report.
    is_zero = scale == 0
    before, after = split_scale(jnp.where(is_zero, jnp.ones_like(scale), scale))
    load = mat3.where(is_zero, mat3.scale_vector(load, 0.0), load)
    return _divided(response(_divided(load, 1 / before)), 1 / after)


def _divided(v: Vec3, divisor: jax.Array) -> Vec3:
    # The maximum keeps XLA from turning x/(y/z) into (x z)/y, which overflows.
    divisor = jnp.maximum(divisor, float(jnp.finfo(divisor.dtype).tiny))
    return (v[0] / divisor, v[1] / divisor, v[2] / divisor)

"""The scale of a derivative: exact where the dtype can represent it, saturated where it would overflow.

The n-th derivative of a function that does not depend on the scale of A grows like 1/|A|ⁿ. At |A| = 1e-20 the second
derivative is 1e40.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import power_of_two_factor


def normalising_factor(matrix: Mat3) -> jax.Array:
    """The power of two that normalises A. It is 0 where A = 0, so that every derivative there is 0."""
    magnitude = mat3.largest_entry(lax.stop_gradient(matrix))
    return jnp.where(magnitude == 0, jnp.zeros_like(magnitude), power_of_two_factor(magnitude))


def saturate(factor: jax.Array, norm: jax.Array, order: int) -> jax.Array:
    """Returns the factor, saturated where a derivative up to this order would overflow.

    The n-th derivative grows like factorⁿ·norm²ⁿ⁻¹, because each further derivative has the linear map on both sides.
    If the dtype cannot represent it, the returned factor is reduced until the product of factors and norms fits. A
    margin of 2¹² for each order allows for the sum of many terms.

    Args:
        factor: The power of two that normalises A, or 0. Not differentiated.
        norm: The norm of the linear map that the factor multiplies, for the normalised A. Not differentiated.
        order: The number of derivatives taken before this one.
    """
    factor, norm = lax.stop_gradient((factor, norm))
    largest = 2.0 ** (jnp.finfo(factor.dtype).maxexp - 4)
    # Replace 0 by 1: the quotients below stay finite.
    is_zero = factor == 0
    factor = jnp.where(is_zero, jnp.ones_like(factor), factor)
    scale = jnp.minimum(factor, largest / norm)
    tiny = float(jnp.finfo(factor.dtype).tiny)
    spent = jnp.clip(factor * norm, tiny, largest)
    for lower in range(1, order + 1):
        # The minimum keeps XLA from rewriting x/y/z as x/(y z), which overflows.
        left = jnp.minimum(largest * 2.0 ** (-12 * lower) / spent, largest)
        scale = jnp.minimum(factor, left / (norm * norm))
        spent = jnp.maximum(spent * (scale * norm) * norm, tiny)
    return jnp.where(is_zero, jnp.zeros_like(scale), scale)


def split_scale(scale: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Splits a scale ≥ 0 into two factors of about the same size. The first is a power of two."""
    first = power_of_two_factor(lax.rsqrt(jnp.where(scale > 0, scale, jnp.ones_like(scale))))
    return first, scale / first


def apply_scaled(response: Callable[[Vec3], Vec3], load: Vec3, scale: jax.Array) -> Vec3:
    """Returns a linear map of a vector times a scale ≥ 0, for every scale that the dtype can represent.

    Half of the scale is applied before the map and half after it. All of it on one side could overflow or underflow.
    Reverse mode, the transpose, visits the halves in the opposite order. Both are divisions: XLA:CPU stores quotients
    but recomputes products in each entry of the result, which took 1.7 times as long.
    """
    # Replace a scale of 0 by 1: `checkify` and `jax_debug_infs` would report the infinite 1/0.
    is_zero = scale == 0
    before, after = split_scale(jnp.where(is_zero, jnp.ones_like(scale), scale))
    load = mat3.where(is_zero, mat3.scale_vector(load, 0.0), load)
    return _divided(response(_divided(load, 1 / before)), 1 / after)


def _divided(v: Vec3, divisor: jax.Array) -> Vec3:
    # The maximum keeps XLA from rewriting x/(y/z) as (x z)/y, which overflows.
    divisor = jnp.maximum(divisor, float(jnp.finfo(divisor.dtype).tiny))
    return (v[0] / divisor, v[1] / divisor, v[2] / divisor)

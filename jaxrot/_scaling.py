"""Exact scaling by powers of two; divisions and roots that are safe where their argument is 0."""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot import _mat3
from jaxrot._mat3 import Mat3

_Tree = TypeVar("_Tree")


def power_of_two_factor(magnitude: jax.Array) -> jax.Array:
    """The power of two c with c·magnitude in [2, 4).

    The interval is [2, 4) and not [1, 2) because the factor for the largest finite numbers would there be 2⁻¹²⁷, itself
    subnormal, and XLA:CPU flushes subnormals to zero. The exponent is read from the bits: `jnp.frexp` is wrong on
    subnormals.

    Args:
        magnitude: Non-negative float32 or float64, any shape.

    Returns:
        The factor, same shape. For 0 and subnormal numbers it is the largest power of two there is; for inf and NaN it
        is 0, and inf·0 is NaN. It is a constant to differentiation.
    """
    info = jnp.finfo(magnitude.dtype)
    mask = ((1 << int(info.nexp)) - 1) << int(info.nmant)
    normal = jnp.maximum(lax.stop_gradient(magnitude), float(info.tiny))
    exponent = lax.bitcast_convert_type(normal, jnp.dtype(f"int{info.bits}")) & mask
    return lax.bitcast_convert_type(mask - exponent, magnitude.dtype)


def power_of_two(m: object) -> jax.Array:
    """The power of two that brings the largest entry into [1, 2) when it divides all of them.

    Where that is not finite it is NaN; for 0 and subnormal numbers it is the smallest normal one. It is a constant to
    differentiation.
    """
    largest = _mat3.largest_entry(lax.stop_gradient(m))
    info = jnp.finfo(largest.dtype)
    integer = jnp.dtype(f"int{info.bits}")
    normal = jnp.maximum(largest, float(info.tiny))
    fraction = lax.bitcast_convert_type(normal, integer) & ((1 << int(info.nmant)) - 1)
    one = lax.bitcast_convert_type(jnp.ones_like(normal), integer)
    # Of inf the mantissa is 1 too; inf/inf makes the power NaN.
    mantissa = jnp.where(normal == jnp.inf, normal, lax.bitcast_convert_type(fraction | one, normal.dtype))
    # The maximum keeps XLA from turning x/(y/z) into (x z)/y, which rounds, and overflows at the largest numbers.
    return jnp.maximum(normal / mantissa, float(info.tiny))


def scaled(m: _Tree) -> _Tree:
    """The entries of a matrix or quaternion over the power of two that brings the largest one into [1, 2).

    Where one is not finite all are NaN, and zeros stay zero. Scaling by a power of two is exact: R(2ᵏA) = R(A) bit for
    bit. The entries are quotients, which XLA:CPU stores, one array each; a product it would form again from the
    (..., 3, 3) array in every pass, with the largest entry: the default method took 1.2 times as long.
    """
    power = power_of_two(m)
    return jax.tree.map(lambda entry: entry / power, m)


def unit_scaled(m: Mat3) -> Mat3:
    """The matrix with the Frobenius norm √3 of a rotation; a zero matrix stays zero."""
    m = scaled(m)
    norm = safe_sqrt(_mat3.squared_norm(m))
    return _mat3.scale(m, safe_divide(jnp.full_like(norm, 3**0.5), norm))


def safe_divide(numerator: jax.Array, denominator: jax.Array) -> jax.Array:
    """The quotient, and 0 where the denominator is 0; the derivative is finite there too."""
    is_zero = denominator == 0
    safe = jnp.where(is_zero, jnp.ones_like(denominator), denominator)
    return jnp.where(is_zero, jnp.zeros_like(denominator), numerator / safe)


def safe_sqrt(square: jax.Array) -> jax.Array:
    """√square, and 0 where it is zero or, by rounding, below; the derivative there is 0 instead of infinite."""
    is_positive = square > 0
    # A NaN is neither, so the outer choice must hand it on.
    safe = jnp.where(square <= 0, jnp.ones_like(square), square)
    return jnp.where(is_positive | jnp.isnan(square), jnp.sqrt(safe), jnp.zeros_like(square))

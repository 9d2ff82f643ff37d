"""Exact scaling by powers of two; divisions, roots and signs that are safe where their argument is 0 or rounding."""

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot import _mat3
from jaxrot._mat3 import Mat3


def power_of_two_factor(magnitude: jax.Array) -> jax.Array:
    """The power of two c with c·magnitude in [2, 4).

    The interval is [2, 4) and not [1, 2) because the factor for the largest finite numbers would there be 2⁻¹²⁷, itself
    subnormal, and XLA:CPU flushes subnormals to zero. The exponent is read from the bits: `jnp.frexp` is wrong on
    subnormals.

    Args:
        magnitude: Non-negative float32 or float64, any shape.

    Returns:
        The factor, a normal number, same shape. For 0 and subnormal numbers it is the largest power of two there is;
        for inf and NaN the smallest normal one. It is a constant to differentiation.
    """
    magnitude = lax.stop_gradient(magnitude)
    info = jnp.finfo(magnitude.dtype)
    mantissa_bits, mask = int(info.nmant), (1 << int(info.nexp)) - 1
    exponent = (lax.bitcast_convert_type(magnitude, jnp.dtype(f"int{info.bits}")) >> mantissa_bits) & mask
    inverse = jnp.clip(mask - exponent, 1, mask - 1)
    return lax.bitcast_convert_type(inverse << mantissa_bits, magnitude.dtype)


def scaled(m: Mat3) -> tuple[Mat3, jax.Array]:
    """The matrix times a power of two that brings its largest entry into [2, 4), and that power.

    Scaling by a power of two is exact: R(2ᵏA) = R(A) bit for bit. A zero matrix stays zero.
    """
    factor = power_of_two_factor(_mat3.largest_entry(m))
    return _mat3.scale(m, factor), factor


def unit_scaled(m: Mat3) -> Mat3:
    """The matrix with the Frobenius norm √3 of a rotation; a zero matrix stays zero."""
    m, _ = scaled(m)
    norm = safe_sqrt(_mat3.squared_norm(m))
    return _mat3.scale(m, safe_divide(jnp.full_like(norm, 3**0.5), norm))


def is_positive(x: jax.Array) -> jax.Array:
    """Whether x > 0, decided once for everything that hangs on it.

    XLA computes what is cheap again in every fusion, with products and sums contracted differently. Where x is 0 but
    for rounding, one component of a result could then follow one branch and its neighbour the other: no rotation, or a
    wrong one. A quotient is computed once.
    """
    return x / (jnp.abs(x) + float(jnp.finfo(x.dtype).tiny)) > 0


def computed_once(m: Mat3) -> Mat3:
    """The matrix itself, which XLA:CPU then computes once for all that is made of it.

    What is cheap it computes again in every fusion, and a step of many quotients has many; what is divided it keeps. To
    divide QᵀA by 1 takes a `newton` step from 103 to 65 ns a matrix, and each result sees the same rounding of it.
    """
    number = 1 + jnp.abs(m[0][0])
    one = number / number
    return jax.tree.map(lambda entry: entry / one, m)


def safe_divide(numerator: jax.Array, denominator: jax.Array) -> jax.Array:
    """The quotient, and 0 where the denominator is 0; the derivative is finite there too."""
    is_zero = denominator == 0
    safe = jnp.where(is_zero, jnp.ones_like(denominator), denominator)
    return jnp.where(is_zero, jnp.zeros_like(numerator), numerator) / safe


def safe_sqrt(square: jax.Array) -> jax.Array:
    """√square, and 0 where it is zero or, by rounding, below; the derivative there is 0 instead of infinite."""
    is_positive = square > 0
    # A NaN is neither, so the outer choice must hand it on.
    safe = jnp.where(square <= 0, jnp.ones_like(square), square)
    return jnp.where(is_positive | jnp.isnan(square), jnp.sqrt(safe), jnp.zeros_like(square))

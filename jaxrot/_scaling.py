"""Exact scaling by powers of two; divisions and roots that are safe where their argument is 0."""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot import _mat3
from jaxrot._choice import computed_once
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
    exponent, mask = _exponent(magnitude)
    return lax.bitcast_convert_type(mask - exponent, magnitude.dtype)


def scaled(m: _Tree) -> _Tree:
    """The entries of a matrix or quaternion times the power of two that brings the largest one into [2, 4).

    Where one is not finite all are NaN, and zeros stay zero. Scaling by a power of two is exact: R(2ᵏA) = R(A) bit for
    bit. The power is made of bits: on accelerators quotients are not exact, and the reciprocal of a number above 2¹²⁶
    may be 0.
    """
    factor = power_of_two_factor(_size(m))
    return jax.tree.map(lambda entry: entry * factor, m)


def unscaled(values: _Tree, m: object) -> _Tree:
    """What belongs to the `scaled` entries of m, in the unit of m again."""
    size = _size(m)
    # Half of it first: the factor of the largest numbers has a reciprocal, that of the smallest has none.
    power = lax.bitcast_convert_type(_exponent(size)[0], size.dtype)
    return jax.tree.map(lambda value: (value * 0.5) * power, values)


def _size(m: object) -> jax.Array:
    # The same wherever it decides about a power of two, also where quotients are inexact.
    return computed_once(_mat3.largest_entry(m))


def _exponent(magnitude: jax.Array) -> tuple[jax.Array, int]:
    """The bits of the exponent of a number ≥ 0, no less than that of the smallest normal one, and the mask of them."""
    info = jnp.finfo(magnitude.dtype)
    mask = ((1 << int(info.nexp)) - 1) << int(info.nmant)
    normal = jnp.maximum(lax.stop_gradient(magnitude), float(info.tiny))
    return lax.bitcast_convert_type(normal, jnp.dtype(f"int{info.bits}")) & mask, mask


def unit_scaled(m: Mat3) -> Mat3:
    """The matrix with the Frobenius norm √3 of a rotation; a zero matrix stays zero."""
    m = scaled(m)
    norm = safe_sqrt(_mat3.squared_norm(m))
    # Exactly 1 for a rotation: with another form `taylor` rounds every entry, and drifts twice as far.
    return computed_once(_mat3.scale(m, safe_divide(jnp.full_like(norm, 3**0.5), norm)))


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

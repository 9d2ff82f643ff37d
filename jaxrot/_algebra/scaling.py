"""Exact scaling by powers of two; divisions and roots that are safe where their argument is 0."""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.select import constant_like

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
    """Multiplies a matrix or quaternion by the power of two that brings its largest absolute entry into [2, 4).

    An infinite entry becomes NaN, and zeros stay zero. Scaling by a power of two is exact: R(2ᵏA) = R(A) bit for
    bit. The power is built from the exponent bits. A division would be rounded on accelerators, and they flush the
    reciprocal of a number above 2¹²⁶ to 0.
    """
    factor = power_of_two_factor(_size(m))
    return jax.tree.map(lambda entry: entry * factor, m)


def unscaled(values: _Tree, m: object) -> _Tree:
    """Undoes `scaled(m)`: divides the values by the power of two that `scaled` multiplies m by."""
    size = _size(m)
    # 1/factor is half of this power. For the smallest matrices 1/factor is subnormal, but the power is normal.
    power = lax.bitcast_convert_type(_exponent(size)[0], size.dtype)
    return jax.tree.map(lambda value: (value * 0.5) * power, values)


def _size(m: object) -> jax.Array:
    # `scaled` and `unscaled` must see the same number, also where a quotient is inexact.
    return fusion_barrier(mat3.largest_entry(m))


def _exponent(magnitude: jax.Array) -> tuple[jax.Array, int]:
    """The exponent bits of a number ≥ 0 and their mask. The exponent is at least that of the smallest normal number."""
    info = jnp.finfo(magnitude.dtype)
    mask = ((1 << int(info.nexp)) - 1) << int(info.nmant)
    normal = jnp.maximum(lax.stop_gradient(magnitude), float(info.tiny))
    return lax.bitcast_convert_type(normal, jnp.dtype(f"int{info.bits}")) & mask, mask


def unit_scaled(m: Mat3) -> Mat3:
    """A matrix, already `scaled`, with the Frobenius norm √3 of a rotation; a zero matrix stays zero."""
    norm = safe_sqrt(mat3.squared_norm(m))
    # The factor is exactly 1 for a rotation. With another form `taylor` rounds every entry and drifts twice as far.
    return fusion_barrier(mat3.scale(m, safe_divide(jnp.full_like(norm, 3**0.5), norm)))


def safe_divide(numerator: jax.Array, denominator: jax.Array) -> jax.Array:
    """The quotient, or 0 if the denominator is 0; the derivative is finite there too.

    The division comes last: XLA:CPU stores a quotient, but recomputes a selection in every fusion that uses it.
    """
    is_zero = denominator == 0
    safe = jnp.where(is_zero, jnp.ones_like(denominator), denominator)
    return jnp.where(is_zero, constant_like(denominator, 0), numerator) / safe


def safe_sqrt(square: jax.Array) -> jax.Array:
    """√square, or 0 if the square is 0 or, by rounding, negative. The derivative is then 0 instead of infinite."""
    is_zero = square <= 0
    root = jnp.sqrt(jnp.where(is_zero, jnp.ones_like(square), square))
    return jnp.where(is_zero, jnp.zeros_like(root), root)


def nonzero_sqrt(square: jax.Array, smallest: float | None = None) -> jax.Array:
    """The square root of a number, or of `smallest` where the number is smaller.

    It serves as a divisor: 0 over it is 0, with a finite derivative. `smallest` is the smallest normal number unless it
    is given.
    """
    bound = jnp.full_like(square, float(jnp.finfo(square.dtype).tiny) if smallest is None else smallest)
    # A maximum would not do: on a mesh with Explicit axes jax 0.10 cannot differentiate it.
    return jnp.sqrt(jnp.where(square <= bound, bound, square))

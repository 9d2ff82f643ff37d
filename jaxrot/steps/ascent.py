"""The direction of ascent that Newton's equation gives: a solve whose pivots count by their absolute values."""

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_sqrt
from jaxrot._algebra.select import exchange, is_positive


def ascent(h: Mat3, b: Mat3, v: Vec3, *, has_absolute_pivots: bool = True, keeps_free_axes: bool = True) -> Vec3:
    """h⁻¹ v, with the pivots of LDLᵀ replaced by their absolute values; 1/p is p/(p² + δ²), so that 1/0 is 0.

    With diagonal pivoting, so that an axis without a gap shows in the last pivot and not in the rounding of the others.

    Args:
        h: Symmetric, of any signature.
        b: QᵀA, whose size decides what is rounding.
        v: The right-hand side, the torque.
        has_absolute_pivots: Static. With False the result is h⁻¹ v, which leads to a saddle where h is indefinite.
        keeps_free_axes: Static. With False the solution has any part along an axis without a gap.
    """
    delta, torque = _resolved(b)
    magnitude = jnp.abs if has_absolute_pivots else jnp.positive
    (h00, h01, h02), (_, h11, h12), (_, _, h22) = h
    v0, v1, v2 = v
    # The largest comes first. What is exchanged here is exchanged back, in reverse, at the end.
    first = is_positive(jnp.abs(h11) - jnp.abs(h00))
    h00, h11 = exchange(first, h00, h11)
    h02, h12 = exchange(first, h02, h12)
    v0, v1 = exchange(first, v0, v1)
    second = is_positive(jnp.abs(h22) - jnp.abs(h00))
    h00, h22 = exchange(second, h00, h22)
    h01, h12 = exchange(second, h01, h12)
    v0, v2 = exchange(second, v0, v2)

    square = delta * delta
    inverse0 = h00 / (h00 * h00 + square)
    l1, l2 = h01 * inverse0, h02 * inverse0
    s11, s12, s22 = h11 - l1 * h01, h12 - l1 * h02, h22 - l2 * h02
    y1, y2 = v1 - l1 * v0, v2 - l2 * v0
    third = is_positive(jnp.abs(s22) - jnp.abs(s11))
    s11, s22 = exchange(third, s11, s22)
    y1, y2 = exchange(third, y1, y2)
    h01, h02 = exchange(third, h01, h02)

    inverse1 = s11 / (s11 * s11 + square)
    l12 = s12 * inverse1
    pivot = s22 - l12 * s12
    # Quotients: along an axis without a gap these are rounding, and only what is divided XLA computes once.
    last = y2 - l12 * y1
    x2 = last * magnitude(pivot) / (pivot * pivot + square)
    x1 = (y1 * magnitude(s11) - s11 * s12 * x2) / (s11 * s11 + square)
    x0 = (v0 * magnitude(h00) - h00 * (h01 * x1 + h02 * x2)) / (h00 * h00 + square)

    if keeps_free_axes:
        # That solution has any part along u, which the last pivot belongs to; where the pivot is 0, the shortest has
        # none. Without this half of all starts turn about the axis that a matrix of rank 1 leaves free, by up to 90°.
        u0 = (h01 * l12 - h02) * inverse0
        fourth = square * square
        # Where one begins and the other ends is a constant to differentiation, whose δ⁻⁸ float32 does not hold.
        size = lax.stop_gradient((u0 * u0 + l12 * l12 + 1) * (pivot**4 + fourth) / fourth)
        part = jnp.where(jnp.abs(last) > torque, jnp.zeros_like(fourth), u0 * x0 - l12 * x1 + x2) / size
        x0, x1, x2 = x0 - part * u0, x1 + part * l12, x2 - part

    x1, x2 = exchange(third, x1, x2)
    x0, x2 = exchange(second, x0, x2)
    x0, x1 = exchange(first, x0, x1)
    return x0, x1, x2


def _resolved(b: Mat3) -> tuple[jax.Array, jax.Array]:
    """The gap δ below which an axis is not turned about, eps^⅔ ‖B‖, unless the torque about it is more than 64 eps ‖B‖.

    The part of the solution along a free axis, whose gap and torque are rounding, is reduced to (eps/δ)⁴, less than
    eps. A gap may also vanish on the way while the torque does not, a quarter turn off for example: without the second
    condition 9 of 167,000 random starts stayed there in float32. Both are 1 where B = 0, so that nothing is 0/0.
    """
    norm = safe_sqrt(mat3.squared_norm(b))
    norm = jnp.where(norm == 0, jnp.ones_like(norm), norm)
    eps = float(jnp.finfo(norm.dtype).eps)
    return eps ** (2 / 3) * norm, 64 * eps * norm

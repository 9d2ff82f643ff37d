"""A direction in which tr(RᵀA) increases: Newton's equation, solved with the absolute values of the pivots."""

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_sqrt
from jaxrot._algebra.select import exchange, is_positive


def ascent(h: Mat3, b: Mat3, v: Vec3, *, has_absolute_pivots: bool = True, keeps_free_axes: bool = True) -> Vec3:
    """The solution of h x = v, with each pivot of LDLᵀ replaced by its absolute value.

    The reciprocal of a pivot p is p/(p² + δ²), which is 0 at p = 0. Diagonal pivoting brings an axis without a gap into
    the last pivot, and keeps it out of the rounding of the others.

    Args:
        h: Symmetric, of any signature.
        b: QᵀA. Its norm sets the level of rounding.
        v: The right-hand side, the torque.
        has_absolute_pivots: Static. With False the result is h⁻¹ v, which leads to a saddle where h is indefinite.
        keeps_free_axes: Static. With False the solution has any part along an axis without a gap.
    """
    delta, torque = _resolved(b)
    magnitude = jnp.abs if has_absolute_pivots else jnp.positive
    (h00, h01, h02), (_, h11, h12), (_, _, h22) = h
    v0, v1, v2 = v
    # The largest diagonal entry comes first. The exchanges are undone at the end, in reverse order.
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
    # The unknowns are quotients. Along an axis without a gap they are rounding, and XLA computes only quotients once.
    last = y2 - l12 * y1
    x2 = last * magnitude(pivot) / (pivot * pivot + square)
    x1 = (y1 * magnitude(s11) - s11 * s12 * x2) / (s11 * s11 + square)
    x0 = (v0 * magnitude(h00) - h00 * (h01 * x1 + h02 * x2)) / (h00 * h00 + square)

    if keeps_free_axes:
        # The last pivot belongs to the axis u. Where that pivot is 0, the solution along u is arbitrary; the
        # shortest solution has none. Without this, half of all starts turn by up to 90° about the axis that a
        # matrix of rank 1 leaves free.
        u0 = (h01 * l12 - h02) * inverse0
        fourth = square * square
        # Its derivative would contain δ⁻⁸, which overflows in float32.
        size = lax.stop_gradient((u0 * u0 + l12 * l12 + 1) * (pivot**4 + fourth) / fourth)
        part = jnp.where(jnp.abs(last) > torque, jnp.zeros_like(fourth), u0 * x0 - l12 * x1 + x2) / size
        x0, x1, x2 = x0 - part * u0, x1 + part * l12, x2 - part

    x1, x2 = exchange(third, x1, x2)
    x0, x2 = exchange(second, x0, x2)
    x0, x1 = exchange(first, x0, x1)
    return x0, x1, x2


def _resolved(b: Mat3) -> tuple[jax.Array, jax.Array]:
    """Two thresholds: the gap δ = eps^⅔ ‖B‖, and the torque 64 eps ‖B‖.

    A step does not turn about an axis whose gap is below δ, unless the torque about it exceeds its threshold. The gap
    and the torque of a free axis are rounding: the part of the solution along it is reduced to (eps/δ)⁴ < eps. A gap
    can also vanish on the way while the torque does not, for example a quarter turn off. Without the second threshold
    9 of 167,000 random starts stayed there in float32. Both use the norm 1 where B = 0, which avoids 0/0.
    """
    norm = safe_sqrt(mat3.squared_norm(b))
    norm = jnp.where(norm == 0, jnp.ones_like(norm), norm)
    eps = float(jnp.finfo(norm.dtype).eps)
    return eps ** (2 / 3) * norm, 64 * eps * norm

"""The best angle about a given axis, which `torque_exact_angle` and `newton` share."""

import jax.numpy as jnp

from jaxrot import _mat3
from jaxrot._mat3 import Mat3, Vec3
from jaxrot._quaternion import Quaternion
from jaxrot._scaling import safe_divide, safe_sqrt

# Below 4 eps ‖B‖ the trace depends on the angle by rounding alone. And a torque below 1 eps ‖B‖ is rounding: followed,
# it turned some of 20,000 matrices of rank 1 by 600 eps about the axis that they leave free, instead of 13 at most.
_FLAT = 4


def turn_about(b: Mat3, axis: Vec3) -> Quaternion:
    """The rotation about an axis that makes tr(RᵀA) largest.

    For n = axis/‖axis‖ the trace after a turn by φ is nᵀBn + c cos φ + s sin φ with c = nᵀHn, H = tr(B)·1 − sym B, and
    s = d·n: the best angle is atan2(s, c). The trace never gets smaller, there is no ε, no scale and no overshoot, and
    it is right beyond 90°. No trigonometric function: tan(φ/4) comes from the half angle, and that from s and c.

    Args:
        b: B = QᵀA on components, its scale removed by a power of two.
        axis: Any length. Its components must be computed once, quotients for example: see `_scaling.is_positive`.

    Returns:
        The correction as a quaternion of length 1 to 2, to be multiplied from the right; the identity where the axis is
        0 or the trace does not depend on the angle.

    Source: Wahba's problem on the circle of rotations about n. About 65 flops.
    """
    length = safe_sqrt(_mat3.dot(axis, axis))
    x, y, z = (safe_divide(component, length) for component in axis)
    s = _mat3.dot(_mat3.axial(b), (x, y, z))
    # Not t − nᵀBn, which cancels where the gap is small.
    c = _mat3.dot((x, y, z), _mat3.apply(_mat3.gap_matrix(b), (x, y, z)))
    r = safe_sqrt(s * s + c * c)
    # (cos φ/2, sin φ/2) ∝ (r + c, s). Where c < 0 that cancels, and (|s|, ±(r − c)) is the same direction.
    sine = jnp.where(c >= 0, s, jnp.where(s < 0, c - r, r - c))
    cosine = jnp.where(c >= 0, r + c, jnp.abs(s))
    rounding = float(jnp.finfo(r.dtype).eps) * safe_sqrt(_mat3.squared_norm(b))
    is_flat = (r <= _FLAT * rounding) | ((c > 0) & (jnp.abs(s) <= rounding))
    # One quotient holds the angle and all its choices, so that the four components agree where s and c are rounding.
    half = safe_sqrt(sine * sine + cosine * cosine)
    quarter = safe_divide(jnp.where(is_flat, jnp.zeros_like(sine), sine), half + cosine)
    return (1 - quarter * quarter, *_mat3.scale_vector((x, y, z), 2 * quarter))

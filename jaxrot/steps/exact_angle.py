"""The best angle about a given axis, shared by two steps."""

import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import nonzero_sqrt

# If the trace varies by less than 4 eps ‖B‖ along the circle, its dependence on the angle is rounding. A torque below
# eps ‖B‖ is rounding too. Steps that follow it turned some of 20,000 matrices of rank 1 by 600 eps about the axis that
# they leave free, instead of 13 at most.
_FLAT = 4


def turn_about(h: Mat3, torque: Vec3, axis: Vec3, *, flat: float = _FLAT) -> Quaternion:
    """The rotation about an axis that makes tr(RᵀA) largest.

    For n = axis/‖axis‖ the trace after a turn by φ is nᵀBn + c cos φ + s sin φ, with c = nᵀHn and s = d·n. The best
    angle is atan2(s, c). The trace never decreases, and the angle is right beyond 90°. There is no ε, no scale and no
    overshoot. No trigonometric function is needed: tan(φ/4) follows from the half angle, and the half angle from s and
    c.

    Args:
        h: H = tr(B)·1 − sym B for B = QᵀA.
        torque: d = vee(B − Bᵀ).
        axis: Any length. XLA must compute its components once, as it does quotients; see `fusion`.
        flat: Bound in units of eps ‖B‖. If the trace varies less along the circle, it counts as constant.

    Returns:
        The correction as a quaternion of length 1 to 2, to be multiplied from the right. It is the identity where the
        axis is 0 or the trace does not depend on the angle.

    Cost: about 65 flops.
    Source: Wahba's problem on the circle of rotations about n.
    """
    length = nonzero_sqrt(mat3.dot(axis, axis))
    x, y, z = axis[0] / length, axis[1] / length, axis[2] / length
    s, c = mat3.dot(torque, (x, y, z)), mat3.dot((x, y, z), mat3.apply(h, (x, y, z)))
    r = nonzero_sqrt(s * s + c * c)
    # (cos φ/2, sin φ/2) ∝ (r + c, s). For c < 0 this cancels; (|s|, ±(r − c)) is the same direction.
    sine = jnp.where(c >= 0, s, jnp.where(s < 0, c - r, r - c))
    cosine = jnp.where(c >= 0, r + c, jnp.abs(s))
    # ‖B‖ up to a factor of 2.
    size = nonzero_sqrt(mat3.squared_norm(h) + 0.5 * mat3.dot(torque, torque))
    rounding = float(jnp.finfo(r.dtype).eps) * size
    is_flat = (r <= flat * rounding) | ((c > 0) & (jnp.abs(s) <= 0.25 * flat * rounding))
    # One quotient holds the angle and all its choices. So the four components agree where s and c are rounding.
    half = nonzero_sqrt(sine * sine + cosine * cosine)
    quarter = jnp.where(is_flat, jnp.zeros_like(sine), sine) / (half + cosine)
    return (1 - quarter * quarter, *mat3.scale_vector((x, y, z), 2 * quarter))

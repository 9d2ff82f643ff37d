"""Leaving an equilibrium that is not the nearest rotation."""

import jax.numpy as jnp

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.eigh import eigen
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import safe_sqrt
from jaxrot._algebra.select import constant_like

# An eigenvalue of the gap matrix above −4 eps ‖A‖ counts as zero.
_ZERO = 4


def leave_equilibrium(a: Mat3, q: Quaternion) -> Quaternion:
    """The start, turned away from an equilibrium where tr(RᵀA) is not largest; other starts are returned unchanged.

    The torque also vanishes at R turned by 180° about a principal axis of the stretch. That is a saddle, or a maximum
    of ‖A − R‖. There H = t·1 − sym B has a negative eigenvalue, and the eigenvector n of the smallest eigenvalue is
    that axis. The best angle about n, 180° from the equilibrium itself, leads to the nearest rotation at once. The
    angle is exact, so the trace never decreases.

    A start counts as an equilibrium where |d| ≤ |λ|, with λ the smallest eigenvalue. Near the nearest rotation of an
    ill-conditioned A there may be a negative eigenvalue too. It is small compared with the torque, and a turn about its
    axis would lead *to* the saddle.

    Args:
        a: The matrices on components, their scale removed.
        q: The start, a unit quaternion on components of the same batch shape.

    Returns:
        A unit quaternion. It is `q` itself at the optimum, for A = 0, and for an axis that A leaves free.

    Cost: about 330 flops, as many as a `newton` step.
    Source: Müller et al. 2016, after eq. (8). Their perturbation is random and may have to be repeated.
    """
    b = mat3.transpose_multiply(quaternion.to_rotation(q), a)
    torque = mat3.axial(b)
    h = mat3.gap_matrix(b)
    _, (_, _, axis) = eigen(h)
    # notation: the best angle φ is atan2(s, c); c is negative, so that |cot(φ/2)| < ½.
    s, c = mat3.dot(torque, axis), mat3.dot(axis, mat3.apply(h, axis))
    zero = _ZERO * float(jnp.finfo(c.dtype).eps) * safe_sqrt(mat3.squared_norm(b))
    leaves = (c < -zero) & (mat3.dot(torque, torque) <= c * c)

    # One quotient holds the angle and the decision, 2 for "stay": XLA computes a quotient once. It would compute
    # a cheap expression again for each component. Where the torque is rounding, w could then leave and x stay.
    two = constant_like(c, 2)
    cotangent = jnp.where(leaves, s, two) / jnp.where(leaves, safe_sqrt(s * s + c * c) - c, jnp.ones_like(c))
    turned = quaternion.normalise(quaternion.product(q, (cotangent, *axis)))
    w, x, y, z = (jnp.where(cotangent < 1, new, old) for new, old in zip(turned, q, strict=True))
    return (w, x, y, z)

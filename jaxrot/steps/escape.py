"""The way out of an equilibrium that is not the nearest rotation."""

import jax.numpy as jnp

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.eigh import eigen
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import safe_sqrt
from jaxrot._algebra.select import constant_like

# An eigenvalue of the gap matrix above −4 eps ‖A‖ is zero.
_ZERO = 4


def leave_equilibrium(a: Mat3, q: Quaternion) -> Quaternion:
    """Turns a rotation away where the torque is zero and tr(RᵀA) not largest; elsewhere it is returned as it is.

    At R turned by 180° about a principal axis of the stretch the torque vanishes: a maximum of ‖A − R‖, or a saddle.
    There H = t·1 − sym B has a negative eigenvalue, and the eigenvector n of the smallest one is that axis: the angle
    about n that is best for tr(RᵀA), 180° from the equilibrium itself, leads to the nearest rotation at once. It is
    exact, so that the trace never gets smaller.

    An equilibrium is where |d| ≤ |λ|, λ the smallest eigenvalue: near the nearest rotation of an ill-conditioned A
    there may be a negative one too, small beside the torque, and to turn about its axis would lead *to* the saddle.

    Args:
        a: The matrices on components, their scale removed.
        q: The start, a unit quaternion on components of the same batch shape.

    Returns:
        A unit quaternion, `q` itself where nothing is to be done: A = 0, the optimum, an axis that A leaves free.

    Source: Müller et al. 2016, after eq. (8), where the perturbation is random and may have to be repeated. About 330
    flops, as many as a `newton` step.
    """
    b = mat3.transpose_multiply(quaternion.to_rotation(q), a)
    torque = mat3.axial(b)
    h = mat3.gap_matrix(b)
    _, (_, _, axis) = eigen(h)
    # notation: the best angle φ is atan2(s, c); c is negative, so that |cot(φ/2)| < ½.
    s, c = mat3.dot(torque, axis), mat3.dot(axis, mat3.apply(h, axis))
    zero = _ZERO * float(jnp.finfo(c.dtype).eps) * safe_sqrt(mat3.squared_norm(b))
    leaves = (c < -zero) & (mat3.dot(torque, torque) <= c * c)

    # XLA computes what is cheap again for each component, where torque is rounding with another result: w might leave
    # and x stay. A quotient it computes once, so that both the angle and the decision, 2 for no, are in one.
    two = constant_like(c, 2)
    cotangent = jnp.where(leaves, s, two) / jnp.where(leaves, safe_sqrt(s * s + c * c) - c, jnp.ones_like(c))
    turned = quaternion.normalise(quaternion.product(q, (cotangent, *axis)))
    w, x, y, z = (jnp.where(cotangent < 1, new, old) for new, old in zip(turned, q, strict=True))
    return (w, x, y, z)

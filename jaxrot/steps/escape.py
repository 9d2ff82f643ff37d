"""The way out of an equilibrium that is not the nearest rotation."""

import jax.numpy as jnp

from jaxrot import _mat3, _quaternion
from jaxrot._choice import is_positive
from jaxrot._jacobi import diagonalising
from jaxrot._mat3 import Mat3, Vec3
from jaxrot._quaternion import Quaternion
from jaxrot._scaling import safe_divide, safe_sqrt

# An eigenvalue of the gap matrix above −4 eps ‖A‖ is zero.
_ZERO = 4

# From 2 Newton's method on the cubic is at rounding after 4 steps in float64: the largest root is within 0.27 of it.
_NEWTON_STEPS = 4


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
    b = _mat3.transpose_multiply(_quaternion.to_rotation(q), a)
    torque = _mat3.axial(b)
    h = _mat3.gap_matrix(b)
    axis = _weakest_axis(h)
    # notation: the best angle φ is atan2(s, c); c is negative, so that |cot(φ/2)| < ½.
    s, c = _mat3.dot(torque, axis), _mat3.dot(axis, _mat3.apply(h, axis))
    zero = _ZERO * float(jnp.finfo(c.dtype).eps) * safe_sqrt(_mat3.squared_norm(b))
    leaves = (c < -zero) & (_mat3.dot(torque, torque) <= c * c)

    # XLA computes what is cheap again for each component, where torque is rounding with another result: w might leave
    # and x stay. A quotient it computes once, so that both the angle and the decision, 2 for no, are in one.
    two = jnp.full_like(c, 2)
    cotangent = jnp.where(leaves, s, two) / jnp.where(leaves, safe_sqrt(s * s + c * c) - c, jnp.ones_like(c))
    turned = _quaternion.normalise(_quaternion.product(q, (cotangent, *axis)))
    w, x, y, z = (jnp.where(cotangent < 1, new, old) for new, old in zip(turned, q, strict=True))
    return (w, x, y, z)


def _weakest_axis(h: Mat3) -> Vec3:
    """A unit eigenvector of a symmetric matrix at its smallest eigenvalue, whatever eigenvalues are equal.

    Of the largest and the smallest eigenvalue the one that is farther from the middle one is a simple root of the
    characteristic cubic, and Newton's method finds it from 2; the largest column of the adjugate is its eigenvector.
    If that is the smallest, it is the result. If not, the result lies in the plane perpendicular to it, where one plane
    rotation finds it: two eigenvalues that are equal or nearly so are never told apart by a difference.

    Source: Eberly, "A robust eigensolver for 3×3 symmetric matrices", 2014, with Newton's method in the place of the
    trigonometric functions.
    """
    mean = _mat3.trace(h) / 3
    deviation = _mat3.add_to_diagonal(h, -mean)
    size = safe_sqrt(_mat3.squared_norm(deviation) / 6)
    # notation: x, the eigenvalues of the deviation over its size, between −2 and 2: x³ − 3x − 2p = 0.
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = deviation
    xx, xy, xz, yy, yz, zz = (safe_divide(entry, size) for entry in (xx, xy, xz, yy, yz, zz))
    scaled: Mat3 = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    p = _mat3.determinant(scaled) * 0.5
    largest_is_simple = is_positive(p)
    p = jnp.minimum(jnp.abs(p), 1)
    root = jnp.full_like(p, 2)
    for _ in range(_NEWTON_STEPS):
        square = root * root
        root = 2 * (square * root + p) / (3 * square - 3)
    root = jnp.where(largest_is_simple, root, -root)
    adjugate = _mat3.cofactor(_mat3.add_to_diagonal(scaled, -root))
    (x, y, z), largest = adjugate[0], jnp.abs(adjugate[0][0])
    for i in (1, 2):
        is_larger = is_positive(jnp.abs(adjugate[i][i]) - largest)
        x, y, z = (jnp.where(is_larger, new, old) for new, old in zip(adjugate[i], (x, y, z), strict=True))
        largest = jnp.maximum(largest, jnp.abs(adjugate[i][i]))
    length = safe_sqrt(_mat3.dot((x, y, z), (x, y, z)))
    x, y, z = x / length, y / length, z / length

    # Two perpendicular axes; the sign keeps the denominator away from 0 (Duff et al. 2017).
    sign = jnp.where(z < 0, -jnp.ones_like(z), jnp.ones_like(z))
    quotient = -1 / (sign + z)
    u: Vec3 = (1 + sign * x * x * quotient, sign * x * y * quotient, -sign * x)
    v: Vec3 = (x * y * quotient, sign + y * y * quotient, -y)
    hu, hv = _mat3.apply(scaled, u), _mat3.apply(scaled, v)
    uu, uv, vv = _mat3.dot(u, hu), _mat3.dot(u, hv), _mat3.dot(v, hv)
    (cosine, sine), t = diagonalising(uu, uv, vv)
    first_is_smaller = is_positive((vv - t * uv) - (uu + t * uv))
    along_u, along_v = jnp.where(first_is_smaller, cosine, -sine), jnp.where(first_is_smaller, sine, cosine)
    in_plane = _mat3.add_vectors(_mat3.scale_vector(u, along_u), _mat3.scale_vector(v, along_v))
    x, y, z = (jnp.where(largest_is_simple, new, old) for new, old in zip(in_plane, (x, y, z), strict=True))
    return (x, y, z)

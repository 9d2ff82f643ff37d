"""Quaternions in the order (w, x, y, z), and their conversions, finite in value and derivative at 0 and π."""

import jax
import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_sqrt
from jaxrot._algebra.select import choose, index_of_largest, is_positive

# notation: a quaternion on components is a tuple (w, x, y, z) of arrays of one batch shape.
Quaternion = tuple[jax.Array, jax.Array, jax.Array, jax.Array]
Columns = tuple[Quaternion, Quaternion, Quaternion, Quaternion]


def components(quaternion_wxyz: jax.Array) -> Quaternion:
    """Splits (..., 4) into (w, x, y, z)."""
    q = quaternion_wxyz
    return q[..., 0], q[..., 1], q[..., 2], q[..., 3]


def stack(q: Quaternion) -> jax.Array:
    """Joins (w, x, y, z) into (..., 4)."""
    return jnp.stack(q, axis=-1)


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """The Hamilton product: R(p∘q) = R(p) R(q)."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def dot(p: Quaternion, q: Quaternion) -> jax.Array:
    """The scalar product."""
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]


def squared_norm(q: Quaternion) -> jax.Array:
    """The squared length."""
    return dot(q, q)


def add(p: Quaternion, q: Quaternion) -> Quaternion:
    """The sum."""
    return (p[0] + q[0], p[1] + q[1], p[2] + q[2], p[3] + q[3])


def with_sign_of(sign: jax.Array, q: Quaternion) -> Quaternion:
    """The quaternion where `sign` ≥ 0, its negative elsewhere: sign(0) counts as +1."""
    return scale(q, 1 - 2 * is_positive(-sign).astype(sign.dtype))


def scale(q: Quaternion, factor: jax.Array) -> Quaternion:
    """The quaternion times a number."""
    return (q[0] * factor, q[1] * factor, q[2] * factor, q[3] * factor)


def normalise(q: Quaternion) -> Quaternion:
    """The unit quaternion; the identity where q is 0."""
    length = safe_sqrt(squared_norm(q))
    is_zero = length == 0
    one = jnp.ones_like(length)
    w, x, y, z = q
    return fusion_barrier((jnp.where(is_zero, one, w), x, y, z), jnp.where(is_zero, one, length))


def renormalise(q: Quaternion) -> Quaternion:
    """The unit quaternion of one whose length is 1 to some eps, by one step of Newton's method.

    Every component of the result uses all four. XLA:CPU therefore stores the four before it joins the result. Without
    this step it evaluates `refine_quaternion_wxyz` once for each component, which takes 10 times as long.
    """
    return scale(q, 1.5 - 0.5 * squared_norm(q))


def with_positive_w(q: Quaternion) -> Quaternion:
    """Of q and −q, which are one rotation, the one with w ≥ 0."""
    return with_sign_of(q[0], q)


def to_rotation(q: Quaternion) -> Mat3:
    """The rotation of a quaternion of any length but 0.

    Dividing by q·q instead of by its root makes the result a rotation to rounding for any length: at most 8.05 eps off
    orthogonality over 6e6 quaternions, against 9.8 eps where the quaternion is normalised first.
    """
    w, x, y, z = q
    s = 2 / squared_norm(q)
    sx, sy, sz = s * x, s * y, s * z
    return (
        (1 - (sy * y + sz * z), sx * y - sz * w, sx * z + sy * w),
        (sx * y + sz * w, 1 - (sx * x + sz * z), sy * z - sx * w),
        (sx * z - sy * w, sy * z + sx * w, 1 - (sx * x + sy * y)),
    )


def to_orthonormal(q: Quaternion) -> Mat3:
    """The rotation of a quaternion of any length but 0, orthogonal to 2 eps.

    `to_rotation` alone is orthogonal to 10 eps, and to 17 eps where quotients are 2 ulp off.
    """
    return mat3.newton_schulz(to_rotation(q))


def to_scaled_rotation(q: Quaternion) -> Mat3:
    """The rotation matrix of q times ‖q‖², for callers that divide by ‖q‖² later or not at all."""
    w, x, y, z = q
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    x2, y2, z2 = x + x, y + y, z + z
    xy, xz, yz, wx, wy, wz = x2 * y, x2 * z, y2 * z, x2 * w, y2 * w, z2 * w
    return (
        ((ww + xx) - (yy + zz), xy - wz, xz + wy),
        (xy + wz, (ww + yy) - (xx + zz), yz - wx),
        (xz - wy, yz + wx, (ww + zz) - (xx + yy)),
    )


def davenport_columns(m: Mat3, shift: jax.Array | float = 1.0) -> Columns:
    """The columns of shift·1 + N(m), N that of Davenport's q-method. For m = R(q) and shift 1 column i is 4 qᵢ q.

    Source: Sarabandi et al. 2020, eq. (27), four times.
    """
    d = mat3.axial(m)
    xx, yy, zz = m[0][0], m[1][1], m[2][2]
    xy, xz, yz = m[1][0] + m[0][1], m[0][2] + m[2][0], m[2][1] + m[1][2]
    return (
        (shift + (xx + yy + zz), d[0], d[1], d[2]),
        (d[0], shift + (xx - yy - zz), xy, xz),
        (d[1], xy, shift + (yy - xx - zz), yz),
        (d[2], xz, yz, shift + (zz - xx - yy)),
    )


def adjugate(columns: Columns) -> Columns:
    """The adjugate of a symmetric 4×4 matrix: where that is singular, each column is a multiple of its null vector.

    By Laplace's expansion, in the 2×2 minors of the upper and of the lower two rows; 110 flops.
    """
    (a, b, c, d), (_, e, f, g), (_, _, h, i), (_, _, _, j) = columns
    u01, u02, u03 = a * e - b * b, a * f - c * b, a * g - d * b
    u12, u13, u23 = b * f - c * e, b * g - d * e, c * g - d * f
    l02, l03 = c * i - h * d, c * j - i * d
    l12, l13, l23 = f * i - h * g, f * j - i * g, h * j - i * i
    ww = e * l23 - f * l13 + g * l12
    wx = c * l13 - b * l23 - d * l12
    wy = g * u23 - i * u13 + j * u12
    wz = h * u13 - f * u23 - i * u12
    xx = a * l23 - c * l03 + d * l02
    xy = i * u03 - d * u23 - j * u02
    xz = c * u23 - h * u03 + i * u02
    yy = d * u13 - g * u03 + j * u01
    yz = f * u03 - c * u13 - i * u01
    zz = c * u12 - f * u02 + h * u01
    return (ww, wx, wy, wz), (wx, xx, xy, xz), (wy, xy, yy, yz), (wz, xz, yz, zz)


def largest_column(columns: Columns) -> Quaternion:
    """Of the columns of a positive semidefinite 4×4 matrix the one with the largest diagonal entry."""
    return _column_with_largest(columns, (columns[0][0], columns[1][1], columns[2][2], columns[3][3]))


def longest(columns: Columns) -> tuple[Quaternion, Quaternion]:
    """The longest of four columns, and the squared lengths of all four."""
    lengths_squared = (
        squared_norm(columns[0]),
        squared_norm(columns[1]),
        squared_norm(columns[2]),
        squared_norm(columns[3]),
    )
    return _column_with_largest(columns, lengths_squared), lengths_squared


def _column_with_largest(columns: Columns, sizes: Quaternion) -> Quaternion:
    index = fusion_barrier(index_of_largest(sizes))
    w, x, y, z = (choose(index, *components) for components in zip(*columns, strict=True))
    return (w, x, y, z)


def from_rotation(m: Mat3) -> Quaternion:
    """The unit quaternion of a rotation, w ≥ 0.

    Column i is 4 qᵢ q, and the largest |qᵢ| is at least ½, so the chosen column has length 2 or more. Nothing cancels,
    and no root of a difference is taken: finite in value and derivative at every rotation, including half turns.

    Source: Shepperd 1978; Markley, "Unit quaternion from rotation matrix", 2008.
    """
    return with_positive_w(normalise(largest_column(davenport_columns(m))))


def exponential(rotation_vector: Vec3) -> Quaternion:
    """The unit quaternion that rotates about `rotation_vector` by its length in radians."""
    square = mat3.dot(rotation_vector, rotation_vector)
    # Below this the series in θ² is exact to rounding, its derivatives included; above it nothing is small.
    is_small = square < jnp.finfo(square.dtype).eps ** 0.25
    angle = safe_sqrt(jnp.where(is_small, jnp.ones_like(square), square))
    half_sinc = jnp.where(is_small, _series(square / 4, _SINC) * 0.5, jnp.sin(angle * 0.5) / angle)
    cosine = jnp.where(is_small, _series(square / 4, _COSINE), jnp.cos(angle * 0.5))
    x, y, z = mat3.scale_vector(rotation_vector, half_sinc)
    return (cosine, x, y, z)


def logarithm(q: Quaternion) -> Vec3:
    """The rotation vector of a quaternion of any length but 0, its angle in [0, π]."""
    w, x, y, z = with_positive_w(q)
    square = x * x + y * y + z * z
    is_small = square < jnp.finfo(square.dtype).eps ** 0.25 * (w * w)
    sine = safe_sqrt(jnp.where(is_small, jnp.ones_like(square), square))
    safe_w = jnp.where(is_small, w, jnp.ones_like(w))
    ratio = jnp.where(is_small, square, jnp.zeros_like(square)) / (safe_w * safe_w)
    factor = jnp.where(is_small, 2 * _series(ratio, _ARCTANGENT) / safe_w, 2 * jnp.arctan2(sine, w) / sine)
    return mat3.scale_vector((x, y, z), factor)


# Coefficients in the square u: sin(√u)/√u, cos(√u), atan(√u)/√u. At u = eps^¼ = 1.2e-4 (float64), 1.9e-2 (float32) the
# first term left out is below eps/10, and it stays below 1e-3 of each derivative up to the fourth.
_SINC = (1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800)
_COSINE = (1.0, -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800)
_ARCTANGENT = (1.0, -1 / 3, 1 / 5, -1 / 7, 1 / 9, -1 / 11)


def _series(u: jax.Array, coefficients: tuple[float, ...]) -> jax.Array:
    total = jnp.full_like(u, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total * u + coefficient
    return total

"""Rotations in a coordinate plane, and what is built of them: eigenvectors and singular value decompositions."""

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_divide, safe_sqrt
from jaxrot._algebra.select import constant_like, sign_of

# notation: a plane rotation is (c, s), cosine and sine; it takes the pair (x, y) to (c x + s y, c y − s x).
PlaneRotation = tuple[jax.Array, jax.Array]

# As many as in Müller et al. 2016, appendix C.
_EIGEN_ROTATIONS = 10


def rotate(r: PlaneRotation, x: jax.Array, y: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The pair (x, y) in the rotated axes."""
    c, s = r
    return c * x + s * y, c * y - s * x


def compose(p: PlaneRotation, q: PlaneRotation) -> PlaneRotation:
    """Both rotations, in either order."""
    return p[0] * q[0] - p[1] * q[1], p[0] * q[1] + p[1] * q[0]


def rotate_rows(r: PlaneRotation, m: Mat3, i: int, j: int) -> Mat3:
    """The rotation in the plane of rows i and j; on a matrix that is kept transposed, of columns."""
    rows = list(m)
    pairs = [rotate(r, x, y) for x, y in zip(m[i], m[j], strict=True)]
    rows[i] = (pairs[0][0], pairs[1][0], pairs[2][0])
    rows[j] = (pairs[0][1], pairs[1][1], pairs[2][1])
    return rows[0], rows[1], rows[2]


def rolled(condition: jax.Array, m: Mat3) -> Mat3:
    """The rows in the order (1, 2, 0) where `condition` holds: a rotation of the frame, whose determinant is +1."""
    return mat3.where(condition, (m[1], m[2], m[0]), m)


def givens(x: jax.Array, y: jax.Array) -> PlaneRotation:
    """The rotation that takes (x, y) to (r, 0), r ≥ 0; the identity where both are negligible beside 1.

    Below √(tiny/eps) the squares lose digits or vanish, one before the other, and (c, s) would be no rotation.
    """
    info = jnp.finfo(x.dtype)
    square = x * x + y * y
    is_negligible = square < float(info.tiny) / float(info.eps)
    inverse = 1 / jnp.sqrt(jnp.where(is_negligible, jnp.ones_like(square), square))
    c = jnp.where(is_negligible, jnp.ones_like(x), x * inverse)
    return c, jnp.where(is_negligible, jnp.zeros_like(y), y * inverse)


def diagonalising(xx: jax.Array, xy: jax.Array, yy: jax.Array) -> tuple[PlaneRotation, jax.Array]:
    """The rotation, by at most 45°, to the axes of the symmetric matrix ((xx, xy), (xy, yy)), and its tangent t.

    There the entries are xx + t xy, 0 and yy − t xy.
    """
    difference = xx - yy
    double = 2 * xy
    # Where the matrix is a multiple of 1 the root has no derivative; 0 stands for it, not NaN.
    root = safe_sqrt(difference * difference + double * double)
    t = safe_divide(jnp.where(difference < 0, -double, double), jnp.abs(difference) + root)
    c = 1 / jnp.sqrt(t * t + 1)
    return (c, t * c), t


def svd_2x2(xx: jax.Array, xy: jax.Array, yx: jax.Array, yy: jax.Array) -> tuple[PlaneRotation, PlaneRotation]:
    """The rotations of the rows and of the columns of ((xx, xy), (yx, yy)) that make it diagonal.

    One rotation of the rows makes it symmetric, its polar decomposition; then both turn to the axes.
    """
    polar = givens(xx + yy, yx - xy)
    (a, c), (b, d) = rotate(polar, xx, yx), rotate(polar, xy, yy)
    right, _ = diagonalising(a, (b + c) * 0.5, d)
    return compose(polar, right), right


def symmetric_eigen(m: Mat3) -> tuple[Vec3, Mat3]:
    """The eigenvalues of a symmetric matrix, in no order, and its eigenvectors as rows, which make a rotation.

    Ten Jacobi rotations, each in the plane of the largest entry off the diagonal. Instead of gathering that entry the
    frame is rolled until it stands at (0, 1). Absolute accuracy: a few eps of the largest eigenvalue.

    Cost: 370 flops, 20 square roots and as many divisions.
    Source: Jacobi 1846; Müller et al. 2016, appendix C, where an entry below 1e-15 ends the loop. Here one below a
    quarter eps of the trace counts as zero: to turn by angles that are nothing but rounding costs twice the error at
    multiples of a rotation.
    """

    def step(_, state: tuple[Vec3, Vec3, Mat3]) -> tuple[Vec3, Vec3, Mat3]:
        (xx, yy, zz), (yz, xz, xy), axes = state
        # Rolled once where the largest is yz, twice where it is xz.
        roll_twice = (jnp.abs(xz) > jnp.abs(xy)) & (jnp.abs(xz) >= jnp.abs(yz))
        roll = roll_twice | (jnp.abs(yz) > jnp.abs(xy))
        diagonal_and_rest: Mat3 = ((xx, yz, zero), (yy, xz, zero), (zz, xy, zero))
        diagonal_and_rest = rolled(roll_twice, rolled(roll, diagonal_and_rest))
        axes = rolled(roll_twice, rolled(roll, axes))
        (xx, yz, _), (yy, xz, _), (zz, xy, _) = diagonal_and_rest
        xy = jnp.where(jnp.abs(xy) <= negligible, zero, xy)
        rotation, t = diagonalising(xx, xy, yy)
        xz, yz = rotate(rotation, xz, yz)
        return (xx + t * xy, yy - t * xy, zz), (yz, xz, zero), rotate_rows(rotation, axes, 0, 1)

    zero = constant_like(m[0][0], 0)
    negligible = float(jnp.finfo(zero.dtype).eps) / 4 * jnp.abs(mat3.trace(m))
    start = ((m[0][0], m[1][1], m[2][2]), (m[1][2], m[0][2], m[0][1]), mat3.identity_like(m))
    values, _, axes = lax.fori_loop(0, _EIGEN_ROTATIONS, step, start)
    return values, axes


def ordered_svd(left: Mat3, diagonal: Vec3, right: Mat3) -> tuple[Mat3, Vec3, Mat3]:
    """Sorts the parts of A = left diag(d) rightᵀ by |d| and leaves one sign, that of det A, in the smallest.

    Args:
        left: A rotation, transposed: its columns as rows.
        diagonal: d in any order and with any signs. It must come out of a loop: what is computed in the open XLA
            computes again for every result, not always with the same rounding, and of two equal singular values left
            and right would put different ones first. (`lax.optimization_barrier` is gone before XLA:CPU fuses.)
        right: A rotation, transposed.

    Returns:
        (left, s, right): rotations, no longer transposed, and s1 ≥ s2 ≥ |s3|.
    """
    d = list(diagonal)
    u, v = list(left), list(right)
    for i, j in ((0, 1), (1, 2), (0, 1)):
        is_smaller = jnp.abs(d[i]) < jnp.abs(d[j])
        d[i], d[j] = jnp.where(is_smaller, d[j], d[i]), jnp.where(is_smaller, d[i], d[j])
        for axes in (u, v):
            # Exchanged by a quarter turn, so that the determinant stays +1.
            opposite = mat3.scale_vector(axes[i], -1.0)
            axes[i], axes[j] = mat3.where(is_smaller, axes[j], axes[i]), mat3.where(is_smaller, opposite, axes[j])
    for i in (0, 1):
        sign = sign_of(d[i])
        d[i], d[2] = d[i] * sign, d[2] * sign
        u[i], u[2] = mat3.scale_vector(u[i], sign), mat3.scale_vector(u[2], sign)
    return mat3.transpose((u[0], u[1], u[2])), (d[0], d[1], d[2]), mat3.transpose((v[0], v[1], v[2]))

"""Plane rotations, and eigenvectors and singular value decompositions by products of them."""

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_divide, safe_sqrt
from jaxrot._algebra.select import constant_like, sign_of

# notation: a plane rotation is (c, s), cosine and sine; it takes the pair (x, y) to (c x + s y, c y − s x).
PlaneRotation = tuple[jax.Array, jax.Array]

# The number in Müller et al. 2016, appendix C.
_EIGEN_ROTATIONS = 10


def rotate(r: PlaneRotation, x: jax.Array, y: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Returns the pair (x, y) in the rotated axes."""
    c, s = r
    return c * x + s * y, c * y - s * x


def compose(p: PlaneRotation, q: PlaneRotation) -> PlaneRotation:
    """Returns the product of two plane rotations, which commute."""
    return p[0] * q[0] - p[1] * q[1], p[0] * q[1] + p[1] * q[0]


def rotate_rows(r: PlaneRotation, m: Mat3, i: int, j: int) -> Mat3:
    """Rotates rows i and j of a matrix. If the matrix is stored transposed, these are its columns."""
    rows = list(m)
    pairs = [rotate(r, x, y) for x, y in zip(m[i], m[j], strict=True)]
    rows[i] = (pairs[0][0], pairs[1][0], pairs[2][0])
    rows[j] = (pairs[0][1], pairs[1][1], pairs[2][1])
    return rows[0], rows[1], rows[2]


def rolled(condition: jax.Array, m: Mat3) -> Mat3:
    """Permutes the rows to the order (1, 2, 0) where `condition` holds: a cyclic permutation, of determinant +1."""
    return mat3.where(condition, (m[1], m[2], m[0]), m)


def givens(x: jax.Array, y: jax.Array) -> PlaneRotation:
    """The rotation that takes (x, y) to (r, 0), r ≥ 0. It is the identity where both are negligible compared with 1.

    Below √(tiny/eps) the squares lose digits or underflow, the smaller one first, and (c, s) would not be a rotation.
    """
    info = jnp.finfo(x.dtype)
    square = x * x + y * y
    is_negligible = square < float(info.tiny) / float(info.eps)
    inverse = 1 / jnp.sqrt(jnp.where(is_negligible, jnp.ones_like(square), square))
    c = jnp.where(is_negligible, jnp.ones_like(x), x * inverse)
    return c, jnp.where(is_negligible, jnp.zeros_like(y), y * inverse)


def diagonalising(xx: jax.Array, xy: jax.Array, yy: jax.Array) -> tuple[PlaneRotation, jax.Array]:
    """The rotation by at most 45° that diagonalises the symmetric matrix ((xx, xy), (xy, yy)), and its tangent t.

    The diagonal entries are then xx + t xy and yy − t xy.
    """
    difference = xx - yy
    double = 2 * xy
    # The root has no derivative where the matrix is a multiple of 1. `safe_sqrt` gives 0 there instead of NaN.
    root = safe_sqrt(difference * difference + double * double)
    t = safe_divide(jnp.where(difference < 0, -double, double), jnp.abs(difference) + root)
    c = 1 / jnp.sqrt(t * t + 1)
    return (c, t * c), t


def svd_2x2(xx: jax.Array, xy: jax.Array, yx: jax.Array, yy: jax.Array) -> tuple[PlaneRotation, PlaneRotation]:
    """The rotations of the rows and of the columns that make ((xx, xy), (yx, yy)) diagonal.

    First a rotation of the rows makes the matrix symmetric (its polar decomposition). Then rows and columns are rotated
    to the eigenvectors.
    """
    polar = givens(xx + yy, yx - xy)
    (a, c), (b, d) = rotate(polar, xx, yx), rotate(polar, xy, yy)
    right, _ = diagonalising(a, (b + c) * 0.5, d)
    return compose(polar, right), right


def symmetric_eigen(m: Mat3) -> tuple[Vec3, Mat3]:
    """Returns the eigenvalues of a symmetric matrix, in no order, and its eigenvectors as rows of a rotation.

    Ten Jacobi rotations, each in the plane of the largest off-diagonal entry. Instead of a gather, the rows are
    permuted until that entry is at (0, 1). The absolute error is a few eps of the largest eigenvalue.

    Cost: 370 flops, 20 square roots and as many divisions.
    Source: Jacobi 1846; Müller et al. 2016, appendix C, where an entry below 1e-15 ends the loop. Here an entry below a
    quarter eps of the trace counts as zero. Rotating by angles that are only rounding doubles the error at multiples
    of a rotation.
    """

    def step(_, state: tuple[Vec3, Vec3, Mat3]) -> tuple[Vec3, Vec3, Mat3]:
        (xx, yy, zz), (yz, xz, xy), axes = state
        # Permute once if the largest entry is yz, twice if it is xz.
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
    """Sorts A = left diag(d) rightᵀ by |d|, and moves all signs to the smallest entry: the sign of det A.

    Args:
        left: A rotation, transposed: its columns as rows.
        diagonal: d in any order and with any signs. It must be the result of a loop. XLA recomputes other expressions
            for every result, not always with the same rounding. For two equal singular values left and right could then
            be sorted differently. (`lax.optimization_barrier` does not help: it is removed before XLA:CPU fuses.)
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
            # Exchange by a quarter turn: the determinant stays +1.
            opposite = mat3.scale_vector(axes[i], -1.0)
            axes[i], axes[j] = mat3.where(is_smaller, axes[j], axes[i]), mat3.where(is_smaller, opposite, axes[j])
    for i in (0, 1):
        sign = sign_of(d[i])
        d[i], d[2] = d[i] * sign, d[2] * sign
        u[i], u[2] = mat3.scale_vector(u[i], sign), mat3.scale_vector(u[2], sign)
    return mat3.transpose((u[0], u[1], u[2])), (d[0], d[1], d[2]), mat3.transpose((v[0], v[1], v[2]))

"""3×3 algebra on components: nine arrays, sums and products only.

Written out on components, XLA fuses the whole algorithm into few passes over memory. `einsum` and `@` on small matrices
do not fuse, and an accelerator may compute them in TF32 or bfloat16.
"""

import functools
from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra.platform import platform
from jaxrot._algebra.select import constant_like

# notation: a matrix is a tuple of rows, each a tuple of three arrays of one batch shape; a vector is such a row.
Vec3 = tuple[jax.Array, jax.Array, jax.Array]
Mat3 = tuple[Vec3, Vec3, Vec3]
_Tree = TypeVar("_Tree", Vec3, Mat3)


def components(matrix: jax.Array) -> Mat3:
    """Splits (..., 3, 3) into its nine entries.

    In reverse mode a split becomes one concatenation. Nine indices `matrix[..., i, j]` become nine padded arrays and
    their sum.
    """
    x, y, z = (vector_components(lax.squeeze(row, [row.ndim - 2])) for row in lax.split(matrix, (1, 1, 1), -2))
    return x, y, z


def vector_components(vector: jax.Array) -> Vec3:
    """Splits (..., 3) into its three entries."""
    x, y, z = (lax.squeeze(entry, [vector.ndim - 1]) for entry in lax.split(vector, (1, 1, 1), -1))
    return x, y, z


def stack(m: Mat3) -> jax.Array:
    """Joins nine entries into (..., 3, 3).

    On GPUs and TPUs a barrier stands before. Without it the kernel that joins the entries computes them nine times.
    """
    if platform() != "cpu":
        m = lax.optimization_barrier(m)
    return jnp.stack([jnp.stack(row, axis=-1) for row in m], axis=-2)


def scale(m: Mat3, factor: jax.Array | float) -> Mat3:
    """The matrix times a number."""
    return jax.tree.map(lambda x: x * factor, m)


def add(a: Mat3, b: Mat3) -> Mat3:
    """The sum of two matrices."""
    return (add_vectors(a[0], b[0]), add_vectors(a[1], b[1]), add_vectors(a[2], b[2]))


def subtract(a: _Tree, b: _Tree) -> _Tree:
    """The difference of two matrices or two vectors."""
    return jax.tree.map(lambda x, y: x - y, a, b)


def add_vectors(u: Vec3, v: Vec3) -> Vec3:
    """The sum of two vectors."""
    return (u[0] + v[0], u[1] + v[1], u[2] + v[2])


def scale_vector(v: Vec3, factor: jax.Array | float) -> Vec3:
    """The vector times a number."""
    return (v[0] * factor, v[1] * factor, v[2] * factor)


def multiply_entries(u: Vec3, v: Vec3) -> Vec3:
    """The products of the entries of two vectors, a diagonal matrix times a vector."""
    return (u[0] * v[0], u[1] * v[1], u[2] * v[2])


def add_to_diagonal(m: Mat3, number: jax.Array) -> Mat3:
    """The matrix m + number·1."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    return ((xx + number, xy, xz), (yx, yy + number, yz), (zx, zy, zz + number))


def transpose(m: Mat3) -> Mat3:
    """The transpose."""
    (a, b, c), (d, e, f), (g, h, i) = m
    return ((a, d, g), (b, e, h), (c, f, i))


def dot(u: Vec3, v: Vec3) -> jax.Array:
    """The scalar product of two vectors."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Vec3, v: Vec3) -> Vec3:
    """The vector product u × v."""
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def apply(m: Mat3, v: Vec3) -> Vec3:
    """The matrix times a column vector."""
    return (dot(m[0], v), dot(m[1], v), dot(m[2], v))


def multiply(a: Mat3, b: Mat3) -> Mat3:
    """The matrix product a b."""
    columns = transpose(b)
    return (apply(columns, a[0]), apply(columns, a[1]), apply(columns, a[2]))


def transpose_multiply(a: Mat3, b: Mat3) -> Mat3:
    """The matrix product aᵀ b."""
    return multiply(transpose(a), b)


def gram(m: Mat3) -> tuple[Vec3, Vec3]:
    """The entries xx, yy, zz and yz, xz, xy of mᵀm."""
    x, y, z = transpose(m)
    return (dot(x, x), dot(y, y), dot(z, z)), (dot(y, z), dot(x, z), dot(x, y))


def trace(m: Mat3) -> jax.Array:
    """The trace."""
    return m[0][0] + m[1][1] + m[2][2]


def cofactor(m: Mat3) -> Mat3:
    """The cofactor matrix: the transpose of the adjugate; for det m ≠ 0 it is det(m) m⁻ᵀ."""
    return (cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1]))


def determinant(m: Mat3) -> jax.Array:
    """The determinant."""
    return dot(m[0], cross(m[1], m[2]))


def squared_norm(m: Mat3) -> jax.Array:
    """The squared Frobenius norm."""
    return dot(m[0], m[0]) + dot(m[1], m[1]) + dot(m[2], m[2])


def symmetric(m: Mat3) -> Mat3:
    """The symmetric part (m + mᵀ)/2."""
    xy, xz, yz = (m[0][1] + m[1][0]) * 0.5, (m[0][2] + m[2][0]) * 0.5, (m[1][2] + m[2][1]) * 0.5
    return ((m[0][0], xy, xz), (xy, m[1][1], yz), (xz, yz, m[2][2]))


def axial(m: Mat3) -> Vec3:
    """The vector d = vee(m − mᵀ) = (m32−m23, m13−m31, m21−m12)."""
    return (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1])


def skew(v: Vec3) -> Mat3:
    """The matrix [v]× with [v]× u = v × u."""
    x, y, z = v
    zero = x - x  # derived from the input, so that it carries the input's sharding; a NaN stays a NaN
    return ((zero, -z, y), (z, zero, -x), (-y, x, zero))


def multiply_skew(m: Mat3, v: Vec3) -> Mat3:
    """The product m [v]×: its rows are the vector products of the rows of m with v."""
    return (cross(m[0], v), cross(m[1], v), cross(m[2], v))


def largest_entry(m: object) -> jax.Array:
    """The largest absolute value of an entry; NaN where there is one."""
    return functools.reduce(jnp.maximum, map(jnp.abs, jax.tree.leaves(m)))


def gap_matrix(b: Mat3) -> Mat3:
    """The matrix H = tr(b)·1 − sym(b); at the nearest rotation its eigenvalues are the sums s1+s2, s1+s3, s2+s3.

    The diagonal is formed from the two entries it is the sum of: subtracting b_ii from the trace loses what matters
    where the gap is small.
    """
    xy, xz, yz = (b[0][1] + b[1][0]) * -0.5, (b[0][2] + b[2][0]) * -0.5, (b[1][2] + b[2][1]) * -0.5
    return (
        (b[1][1] + b[2][2], xy, xz),
        (xy, b[0][0] + b[2][2], yz),
        (xz, yz, b[0][0] + b[1][1]),
    )


def newton_schulz(r: Mat3) -> Mat3:
    """One Newton–Schulz step r(3 − rᵀr)/2: takes a matrix that is orthogonal to a few eps to 2 eps.

    A quaternion turned into a matrix is off by up to 12 eps in 1e6 tries; the contract allows 10.
    """
    (xx, yy, zz), (yz, xz, xy) = gram(r)
    # The defect is formed before it is halved and multiplied: 3 − rᵀr would round it away.
    xx, yy, zz, yz, xz, xy = (xx - 1) * 0.5, (yy - 1) * 0.5, (zz - 1) * 0.5, yz * 0.5, xz * 0.5, xy * 0.5
    return subtract(r, multiply(r, ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))))


def where(condition: jax.Array, a: _Tree, b: _Tree) -> _Tree:
    """Chooses whole matrices, or vectors, by a batch-shaped condition."""
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)


def identity_like(m: Mat3) -> Mat3:
    """The identity for each matrix of the batch, carrying the batch's sharding."""
    zero, one = constant_like(m[0][0], 0), constant_like(m[0][0], 1)
    return ((one, zero, zero), (zero, one, zero), (zero, zero, one))

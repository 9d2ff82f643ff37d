"""Higham and Noferini's algorithm: the dominant eigenvalue, then inverse iteration with a pivoted LDLᵀ."""

import jax
import jax.numpy as jnp

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Columns, Quaternion
from jaxrot._algebra.scaling import safe_divide, unit_scaled
from jaxrot._algebra.select import constant_like
from jaxrot.steps.quest import largest_root

# Each iteration multiplies the error of the eigenvector by the error of the eigenvalue over its gap.
_INVERSE_ITERATIONS = 2

# The exchanges of rows and columns that bring the largest pivot to the top: three candidates, then two, then one.
_ORDER = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))


def solve(a: Mat3) -> Mat3:
    """The rotation of the eigenvector of Davenport's N(A) for its largest eigenvalue f.

    Newton's method on the quartic gives f. f·1 − N = P L D Lᵀ Pᵀ is factorised with diagonal pivoting. If f is exact,
    the start P L⁻ᵀ e₄ is already the eigenvector. Inverse iteration corrects the error of an inexact f.

    Returns:
        Rotations, for det A ≤ 0 too.

    Cost: about 550 flops with 14 Newton steps (float32), 720 with 28 (float64), and 30 or 44 divisions.
    Source: Higham and Noferini, "An algorithm to compute the polar decomposition of a 3×3 matrix", 2016: [27] of
    Sarabandi et al. 2020. The source uses the closed form of the quartic if that is well-conditioned. Otherwise it
    iterates in a two-dimensional subspace. Here Newton's method and single vectors serve both cases, without branches.
    N is that of the source, so its dominant eigenvalue is the algebraically largest.
    """
    a = unit_scaled(a)
    cofactor = mat3.cofactor(a)
    square = mat3.squared_norm(a)
    f = largest_root(cofactor, square, mat3.dot(a[0], cofactor[0]), jnp.sqrt(3 * square))
    q = null_vector(quaternion.davenport_columns(mat3.scale(a, -1.0), f))
    return quaternion.to_orthonormal(q)


def null_vector(columns: Columns) -> Quaternion:
    """The eigenvector of a positive semidefinite 4×4 matrix for its eigenvalue next to 0, of any length but 0."""
    m = [list(column) for column in columns]
    trace = m[0][0] + m[1][1] + m[2][2] + m[3][3]
    # A smaller pivot is rounding. The bound is 1 where A = 0.
    smallest = jnp.where(trace > 0, float(jnp.finfo(trace.dtype).eps) * trace, jnp.ones_like(trace))
    exchanges: list[jax.Array] = []
    for k in range(3):
        for j in range(k + 1, 4):
            is_larger = m[j][j] > m[k][k]
            exchanges.append(is_larger)
            m[k], m[j] = _exchanged(is_larger, m[k], m[j])
            for row in m:
                (row[k],), (row[j],) = _exchanged(is_larger, [row[k]], [row[j]])
        for i in range(k + 1, 4):
            # If the pivot is 0, its column is 0 up to rounding.
            factor = safe_divide(m[i][k], m[k][k])
            for j in range(k + 1, 4):
                m[i][j] = m[i][j] - factor * m[k][j]
            m[i][k] = factor
    pivots = [jnp.maximum(m[k][k], smallest) for k in range(4)]
    zero, one = constant_like(trace, 0), constant_like(trace, 1)
    x = _backward(m, [zero, zero, zero, one])
    for _ in range(_INVERSE_ITERATIONS):
        x = _forward(m, x)
        # Multiply by the last and smallest pivot: the length does not matter, but it must not overflow.
        x = _backward(m, [value * (pivots[3] / pivot) for value, pivot in zip(x, pivots, strict=True)])
    for (k, j), is_larger in reversed(list(zip(_ORDER, exchanges, strict=True))):
        (x[k],), (x[j],) = _exchanged(is_larger, [x[k]], [x[j]])
    return x[0], x[1], x[2], x[3]


def _forward(m: list[list[jax.Array]], x: list[jax.Array]) -> list[jax.Array]:
    """L⁻¹ x, L the part of m below the diagonal and ones on it."""
    x = list(x)
    for i in range(4):
        for k in range(i):
            x[i] = x[i] - m[i][k] * x[k]
    return x


def _backward(m: list[list[jax.Array]], x: list[jax.Array]) -> list[jax.Array]:
    """L⁻ᵀ x."""
    x = list(x)
    for i in reversed(range(4)):
        for k in range(i + 1, 4):
            x[i] = x[i] - m[k][i] * x[k]
    return x


def _exchanged(condition: jax.Array, a: list[jax.Array], b: list[jax.Array]) -> tuple[list, list]:
    return (
        [jnp.where(condition, y, x) for x, y in zip(a, b, strict=True)],
        [jnp.where(condition, x, y) for x, y in zip(a, b, strict=True)],
    )

"""Horn's closed form: the largest root of a quartic, then a column of an adjugate."""

import jax

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.scaling import safe_divide, safe_sqrt, unit_scaled
from jaxrot.solvers.smith_franca import smith_eigenvalues


def solve(a: Mat3) -> Mat3:
    """The rotation of the eigenvector of Davenport's N(A) for its largest eigenvalue f, all in closed form.

    The eigenvector is the largest column of adj(f·1 − N), of the Davenport matrix of f and A.

    Returns:
        Rotations, for det A ≤ 0 too; the identity for A = 0. The root loses digits as it becomes double, s2+s3 → 0. The
        adjugate loses digits where two gaps are small, near −R.

    Cost: about 430 flops, six square roots, an arc tangent, a sine and a cosine.
    Source: Horn, "Closed-form solution of absolute orientation using unit quaternions", 1987: [25] of Sarabandi et al.
    2020, whose "dominant" eigenvalue, largest in modulus, must be the algebraically largest.
    """
    a = unit_scaled(a)
    columns = quaternion.davenport_columns(mat3.scale(a, -1.0), quartic_root(a))
    q = quaternion.normalise(quaternion.largest_column(quaternion.adjugate(columns)))
    return quaternion.to_orthonormal(q)


def quartic_root(a: Mat3) -> jax.Array:
    """The largest root f = s1+s2+s3 of (f²−I)² − 8Jf − 4‖cof A‖² by Euler's formula √z1 + √z2 ± √z3.

    The z are the roots of its resolvent cubic, here the eigenvalues of AᵀA. The last term is computed as J/√(z1 z2).
    That has the right sign, and takes no root of a rounded difference.
    """
    z1, z2, _ = smith_eigenvalues(mat3.transpose_multiply(a, a))
    s1, s2 = safe_sqrt(z1), safe_sqrt(z2)
    return s1 + s2 + safe_divide(mat3.determinant(a), s1 * s2)

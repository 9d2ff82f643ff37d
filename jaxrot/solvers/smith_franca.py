"""The closed form A (AᵀA)^(−1/2) with Smith's eigenvalues and Franca's square root."""

import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_sqrt


def solve(a: Mat3) -> Mat3:
    """The nearest rotation of a matrix with det A > 0 whose singular values are not far apart.

    The square root of C = AᵀA follows from its eigenvalues by Cayley–Hamilton, without eigenvectors. For det A < 0 the
    formula gives the nearest *reflection*. For det A = 0 it divides by zero. Both results are returned unchanged.

    Returns:
        Rotations. In float32 the error is 4e-2 rad at singular values (1, 1, 1e-3): the eigenvalues of C are accurate
        to eps s1², and the formula divides by the small one.

    Cost: about 250 flops, three square roots, one arc tangent, a sine and a cosine.
    Source: Sarabandi et al. 2020, eq. (8)–(19), where (9) and (10) must read m − √p(cos θ ± √3 sin θ) (Smith 1961); as
    printed the eigenvalues do not add up to the trace. Franca 1989.
    """
    # notation: a0..a2 and b0..b2 are those of the paper.
    c = mat3.transpose_multiply(a, a)
    s1, s2, s3 = (safe_sqrt(eigenvalue) for eigenvalue in smith_eigenvalues(c))
    a2, a1, a0 = s1 + s2 + s3, s1 * s2 + s1 * s3 + s2 * s3, s1 * s2 * s3
    denominator = a0 * (a2 * a1 - a0)
    b2 = a2 / denominator
    b1 = (a0 + a2 * (a2 * a2 - 2 * a1)) / denominator
    b0 = (a2 * a1 * a1 - a0 * (a2 * a2 + a1)) / denominator
    polynomial = mat3.add(mat3.scale(mat3.multiply(c, c), b2), mat3.scale(c, -b1))
    polynomial = mat3.add(polynomial, mat3.scale(mat3.identity_like(c), b0))
    return mat3.multiply(a, polynomial)


def smith_eigenvalues(c: Mat3) -> Vec3:
    """The eigenvalues of a symmetric 3×3 matrix by the trigonometric formula, the largest first, the smallest last.

    Absolute accuracy: eps times the largest, and √eps times their spread where two of them are equal.
    """
    # notation: m, q, p and theta are those of the paper.
    m = mat3.trace(c) / 3
    deviator = mat3.add(c, mat3.scale(mat3.identity_like(c), -m))
    q = mat3.determinant(deviator) / 2
    p = mat3.squared_norm(deviator) / 6
    # If two eigenvalues are equal, rounding can make the discriminant negative.
    theta = jnp.arctan2(safe_sqrt(p * p * p - q * q), q) / 3
    root_p = safe_sqrt(p)
    cosine, sine = root_p * jnp.cos(theta), root_p * jnp.sin(theta) * 3**0.5
    return m + 2 * cosine, m - (cosine - sine), m - (cosine + sine)

"""The closed form A (AᵀA)^(−1/2) through the eigenvectors of AᵀA."""

import jax.numpy as jnp

from jaxrot._algebra import jacobi, mat3
from jaxrot._algebra.mat3 import Mat3


def solve(a: Mat3) -> Mat3:
    """The nearest rotation of a matrix with det A > 0 whose singular values are not far apart.

    (AᵀA)^(−1/2) = V diag(λ^(−1/2)) Vᵀ with Jacobi's eigenvectors V. `smith_franca` forms the same product without them.
    For det A < 0 the formula gives the nearest *reflection*. For det A = 0 it divides by zero: NaN or infinite.

    Returns:
        Rotations. The error grows like eps (s1/s3)², because λ3 is accurate to eps s1² and the formula divides by it.

    Cost: about 540 flops, 23 square roots and as many divisions.
    Source: Wessner 1966, in Müller et al. 2016, section 2; Sarabandi et al. 2020, eq. (2), (6) and (7), where V holds
    the columns of what is printed as Vᵀ.
    """
    eigenvalues, axes = jacobi.symmetric_eigen(mat3.transpose_multiply(a, a))
    weighted = [mat3.scale_vector(axis, 1 / jnp.sqrt(x)) for axis, x in zip(axes, eigenvalues, strict=True)]
    root = mat3.transpose_multiply((weighted[0], weighted[1], weighted[2]), axes)
    return mat3.multiply(a, root)

"""The fast optimal attitude matrix (FOAM): the largest root of a quartic, then a polynomial in A."""

import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.scaling import unit_scaled
from jaxrot.steps.quest import largest_root


def solve(a: Mat3) -> Mat3:
    """The nearest rotation R = [(f²+I)A − 2A AᵀA + 2f cof A] / [f(f²−I) − 2J].

    f = s1+s2+s3 is the largest root of (f²−I)² − 8Jf − 4‖cof A‖² = 0, with I = ‖A‖² and J = det A. No inverse, right
    for det A ≤ 0. The denominator is 2(s1+s2)(s2+s3)(s3+s1): where R is not unique the result is 0/0, returned as such.

    Returns:
        In float32 good to κ ≈ 10: the root loses digits as it becomes double.

    Cost: about 150 flops and 14 (float32) or 28 (float64) Newton steps of 10.
    Source: Markley, "Attitude determination using vector observations: a fast optimal matrix algorithm", 1993; again,
    as Cauchy–Green invariants, Lin et al. 2022.
    """
    # notation: f, I (`square`) and J (`determinant`) as above.
    a = unit_scaled(a)
    cofactor = mat3.cofactor(a)
    square = mat3.squared_norm(a)
    determinant = mat3.dot(a[0], cofactor[0])
    f = largest_root(cofactor, square, determinant, jnp.sqrt(3 * square))
    gram = mat3.transpose_multiply(a, a)
    numerator = mat3.add(mat3.scale(a, f * f + square), mat3.scale(mat3.multiply(a, gram), -2.0))
    numerator = mat3.add(numerator, mat3.scale(cofactor, 2 * f))
    return mat3.scale(numerator, 1 / (f * (f * f - square) - 2 * determinant))

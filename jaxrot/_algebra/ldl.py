"""Linear systems with symmetric positive semidefinite 3×3 matrices.

LDLᵀ without pivoting is backward stable for a semidefinite matrix, so no rows are selected or exchanged. Each unknown
is the result of a division. XLA:CPU does not recompute divisions, so every use of an unknown sees the same rounding.
"""

import jax.numpy as jnp

from jaxrot._algebra.mat3 import Mat3, Vec3


def solve(h: Mat3, v: Vec3) -> Vec3:
    """Returns h⁻¹ v for a positive definite h. A pivot below eps·tr h is rounding, and is replaced by eps·tr h."""
    (h00, h01, h02), (_, h11, h12), (_, _, h22) = h
    v0, v1, v2 = v
    smallest = float(jnp.finfo(h00.dtype).eps) * (h00 + h11 + h22)
    l1, l2 = h01 / h00, h02 / h00
    s11, s12 = jnp.maximum(h11 - l1 * h01, smallest), h12 - l1 * h02
    l12 = s12 / s11
    s22 = jnp.maximum(h22 - l2 * h02 - l12 * s12, smallest)
    y1 = v1 - l1 * v0
    x2 = (v2 - l2 * v0 - l12 * y1) / s22
    x1 = (y1 - s12 * x2) / s11
    x0 = (v0 - h01 * x1 - h02 * x2) / h00
    return x0, x1, x2

"""Symmetric positive semidefinite 3×3 matrices: solving with them, and the direction that they nearly annihilate.

LDLᵀ without pivoting is backward stable where the matrix is semidefinite, so that nothing is chosen or exchanged. The
unknowns end in quotients: what is rounding in one of them is then the same rounding wherever it is used.
"""

import jax
import jax.numpy as jnp

from jaxrot._choice import choose, computed_once, constant_like, index_of_largest
from jaxrot._mat3 import Mat3, Vec3

# A minor below 16 eps tr(h)² is rounding. Where two eigenvalues are below it the choice is left to the third one.
_NOISE = 16


def solve(h: Mat3, v: Vec3) -> Vec3:
    """h⁻¹ v for a positive definite h; a pivot below eps·tr h is rounding and taken for that."""
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


def null_vector(h: Mat3) -> Vec3:
    """The direction n in which |h n| is smallest, by one solve: exact where h is singular, any length but 0.

    With n_k = 1 the other two components solve a 2×2 system. k belongs to the largest diagonal entry of the adjugate of
    h + τ·1, τ of the size of rounding: without the shift k would be arbitrary where two eigenvalues are small, and the
    solution not even orthogonal to the axis of the large one.

    Args:
        h: Semidefinite to rounding, or off by one eigenvalue small beside the others. Its squares must
            neither overflow nor underflow.

    Returns:
        n, finite for every finite h; the first axis for 0.
    """
    (h00, h01, h02), (_, h11, h12), (_, _, h22) = h
    eps, tiny = float(jnp.finfo(h00.dtype).eps), float(jnp.finfo(h00.dtype).tiny)
    size = jnp.abs(h00) + jnp.abs(h11) + jnp.abs(h22) + tiny**0.5
    shift = _NOISE * eps * size
    a0, a1, a2 = h00 + shift, h11 + shift, h22 + shift
    minors = (jnp.abs(a1 * a2 - h12 * h12), jnp.abs(a0 * a2 - h02 * h02), jnp.abs(a0 * a1 - h01 * h01))
    k = computed_once(index_of_largest(minors))

    # The remaining two, i and j, follow k in the cyclic order, so that one formula serves all three.
    hii, hij, hjj = choose(k, h11, h22, h00), choose(k, h12, h02, h01), choose(k, h22, h00, h11)
    hki, hkj = choose(k, h01, h12, h02), choose(k, h02, h01, h12)
    hii = _away_from_zero(hii, 2 * eps * size)
    factor = hij / hii
    nj = (factor * hki - hkj) / _away_from_zero(hjj - factor * hij, 2 * eps * size)
    ni = -(hki + hij * nj) / hii
    one = constant_like(ni, 1)
    return choose(k, one, nj, ni), choose(k, ni, one, nj), choose(k, nj, ni, one)


def _away_from_zero(x: jax.Array, distance: jax.Array) -> jax.Array:
    return jnp.where(jnp.abs(x) < distance, jnp.where(x < 0, -distance, distance), x)

"""Zhang's step: Newton's equation, shifted, with the Cayley map."""

import jax
import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import nonzero_sqrt, safe_sqrt
from jaxrot.steps.damped import damped_solve


def correction(b: Mat3) -> Quaternion:
    """The Cayley map of z = [(t + √(t² + ‖d‖²))·1 − (B + Bᵀ)]⁻¹ d, with B = QᵀA, t = tr B and d = vee(B − Bᵀ).

    Cubic. The angle is 2 atan ‖z‖, which is right near the solution only: from beyond 90° it may run to a saddle.

    Args:
        b: QᵀA on components, its scale removed by a power of two.

    Returns:
        The correction (1, z) as a quaternion, to be multiplied from the right; the identity where d = 0, A = 0
        included. It does not turn about an axis that A leaves free.

    Source: Zhang 2021, and the shift Zhang adds to Newton's matrix 2(t·1 − sym B). About 190 flops.
    """
    b = fusion_barrier(b)
    return cayley_map(b, zhang_shift(b))


def zhang_shift(b: Mat3) -> jax.Array:
    """√(t² + ‖d‖²) − t ≥ 0: half of ‖d‖²/t near the solution, so that the order stays cubic; large beyond 90°."""
    t, d = mat3.trace(b), mat3.axial(b)
    return nonzero_sqrt(t * t + mat3.dot(d, d)) - t


def cayley_map(b: Mat3, shift: jax.Array) -> Quaternion:
    """The quaternion (1, z) with (2H + shift·1) z = d, H = tr(B)·1 − sym B, damped where that matrix is singular."""
    h = mat3.add_to_diagonal(mat3.gap_matrix(b), shift * 0.5)
    x, y, z = mat3.scale_vector(damped_solve(h, resolved_gap(b), mat3.axial(b)), 0.5)
    return (jnp.ones_like(x), x, y, z)


def resolved_gap(b: Mat3) -> jax.Array:
    """The gap δ below which an axis is not turned about, ¼√eps ‖B‖; 1 where B = 0, so that nothing is 0/0.

    Not a few eps: the gap of a free axis is rounding ±eps, along it the torque is too, and their quotient eps²/δ² must
    be as small as eps: with 8 eps the free angle of a matrix of rank 1 turned by up to 3e-4. With this δ a gap of δ is
    twice as slow as it should be: κ ≈ 1e4 in float32.
    """
    norm = safe_sqrt(mat3.squared_norm(b))
    return jnp.where(norm == 0, jnp.ones_like(norm), 0.25 * float(jnp.finfo(norm.dtype).eps) ** 0.5 * norm)

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

    Convergence is cubic. The angle 2 atan ‖z‖ is right near the solution only: from beyond 90° the step may run to a
    saddle.

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
    """The shift √(t² + ‖d‖²) − t ≥ 0. It is about ‖d‖²/2t near the solution, which keeps the order cubic."""
    t, d = mat3.trace(b), mat3.axial(b)
    return nonzero_sqrt(t * t + mat3.dot(d, d)) - t


def cayley_map(b: Mat3, shift: jax.Array) -> Quaternion:
    """The quaternion (1, z) with (2H + shift·1) z = d and H = tr(B)·1 − sym B. A singular matrix is damped."""
    h = mat3.add_to_diagonal(mat3.gap_matrix(b), shift * 0.5)
    x, y, z = mat3.scale_vector(damped_solve(h, resolved_gap(b), mat3.axial(b)), 0.5)
    return (jnp.ones_like(x), x, y, z)


def resolved_gap(b: Mat3) -> jax.Array:
    """The gap δ = ¼√eps ‖B‖ below which a step does not turn about an axis; 1 where B = 0, which avoids 0/0.

    A few eps would be too small. The gap and the torque of a free axis are rounding, ±eps, and the step turns by
    eps²/δ², which must not exceed eps. With δ = 8 eps the free angle of a matrix of rank 1 turned by up to 3e-4. The
    price: where the gap is δ, at κ ≈ 1e4 in float32, convergence is half as fast.
    """
    norm = safe_sqrt(mat3.squared_norm(b))
    return jnp.where(norm == 0, jnp.ones_like(norm), 0.25 * float(jnp.finfo(norm.dtype).eps) ** 0.5 * norm)

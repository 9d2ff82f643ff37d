"""The step that is exact: QUEST's equation with the largest eigenvalue of Davenport's matrix."""

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import safe_divide, safe_sqrt
from jaxrot.steps.cayley import cayley_map

# As many as the quartic needs near its double root, where Newton's method only halves the distance; see `solvers.foam`.
_NEWTON_STEPS = {"float32": 14, "float64": 28}


def correction(b: Mat3) -> Quaternion:
    """The Cayley map of z = [(t + f)·1 − (B + Bᵀ)]⁻¹ d, with B = QᵀA, t = tr B, d = vee(B − Bᵀ) and f = s1+s2+s3.

    (1, z) is the eigenvector of Davenport's matrix of B at its largest eigenvalue f: one step is exact from any start
    but those half a turn off, where (0, z) would be. There d = 0 and the step stands still; near there it loses digits,
    which the next step returns.

    Args:
        b: QᵀA on components, its scale removed by a power of two.

    Returns:
        The correction (1, z) as a quaternion, to be multiplied from the right; the identity where d = 0, A = 0
        included. It does not turn about an axis that A leaves free.

    Accuracy: that of f, a root that becomes double as s2+s3 → 0, triple at −R: a step leaves a share eps κ² of the
    error or more, and at rank 1 f has half the digits, so that the angle about the free axis is kept to √eps. Outside
    the contract after 5 steps from 45° off, of 20,000 with κ < 1e3: 0.3 % in float32, none in float64.

    Source: Shuster and Oh, "Three-axis attitude determination from vector observations" (QUEST), 1981. About 250 flops
    and 14 (float32) or 28 (float64) Newton steps of 12.
    """
    b = fusion_barrier(b)
    # f is at least the trace of any rotation of A; less is rounding.
    shift = sum_of_singular_values(b) - mat3.trace(b)
    return cayley_map(b, jnp.where(shift < 0, jnp.zeros_like(shift), shift))


def sum_of_singular_values(a: Mat3) -> jax.Array:
    """The sum f = s1+s2+s3, signed, by Newton's method from the upper bound √(3I).

    It is the largest root of ((f² − I)/2)² = K + 2Jf with I = ‖A‖², K = ‖cof A‖² and J = det A. The same without
    cancellation in f, f = √(I + 2√(K + 2Jf)) for J ≥ 0, is no better: to rank 1 both are off by 25 eps s1 at s2 = 1e-3,
    from the rounding in J.
    """
    cofactor = mat3.cofactor(a)
    square = mat3.squared_norm(a)
    squared_cofactor = mat3.squared_norm(cofactor)
    determinant = mat3.dot(a[0], cofactor[0])

    def newton(_, f: jax.Array) -> jax.Array:
        excess = (f * f - square) * 0.5
        value = excess * excess - squared_cofactor - 2 * determinant * f
        return f - safe_divide(value, 2 * (f * excess - determinant))

    return lax.fori_loop(0, _NEWTON_STEPS[square.dtype.name], newton, safe_sqrt(3 * square))

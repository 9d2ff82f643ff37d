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

# Newton's method descends from the upper bound. At the double root, s2+s3 → 0, each step only halves the distance, and
# rounding stops it after these counts.
_NEWTON_STEPS = {"float32": 14, "float64": 28}


def correction(b: Mat3) -> Quaternion:
    """The Cayley map of z = [(t + f)·1 − (B + Bᵀ)]⁻¹ d, with B = QᵀA, t = tr B, d = vee(B − Bᵀ) and f = s1+s2+s3.

    (1, z) is the eigenvector of Davenport's matrix of B for its largest eigenvalue f. So one step is exact from any
    start that is not half a turn off. Half a turn off the eigenvector is (0, z); there d = 0 and the step stands still.
    Near there it loses digits, which the next step recovers.

    Args:
        b: QᵀA on components, its scale removed by a power of two.

    Returns:
        The correction (1, z) as a quaternion, to be multiplied from the right; the identity where d = 0, A = 0
        included. It does not turn about an axis that A leaves free.

    Accuracy: that of f, a root that becomes double as s2+s3 → 0 and triple at −R. A step leaves at least a share eps κ²
    of the error. At rank 1 f has half the digits, and the angle about the free axis is kept to √eps. Of 20,000 matrices
    with κ < 1e3, 0.3 % are outside the contract in float32 after 5 steps from 45° off, none in float64.

    Cost: about 250 flops and 14 (float32) or 28 (float64) Newton steps of 12.
    Source: Shuster and Oh, "Three-axis attitude determination from vector observations" (QUEST), 1981.
    """
    b = fusion_barrier(b)
    # f is at least the trace of any rotation of A. A smaller value is rounding.
    shift = sum_of_singular_values(b) - mat3.trace(b)
    return cayley_map(b, jnp.where(shift < 0, jnp.zeros_like(shift), shift))


def sum_of_singular_values(a: Mat3) -> jax.Array:
    """The sum s1+s2+s3, signed."""
    cofactor, square = mat3.cofactor(a), mat3.squared_norm(a)
    return largest_root(cofactor, square, mat3.dot(a[0], cofactor[0]), safe_sqrt(3 * square))


def largest_root(cofactor: Mat3, square: jax.Array, determinant: jax.Array, start: jax.Array) -> jax.Array:
    """The sum f = s1+s2+s3, signed, by Newton's method, which descends from the upper bound √(3I), the start.

    It is the largest root of ((f² − I)/2)² = K + 2Jf with I = ‖A‖², K = ‖cof A‖² and J = det A. A form without
    cancellation in f, f = √(I + 2√(K + 2Jf)) for J ≥ 0, is no better: near rank 1 both are off by 25 eps s1 at
    s2 = 1e-3, because J is rounded.
    """
    squared_cofactor = mat3.squared_norm(cofactor)

    def newton(_, f: jax.Array) -> jax.Array:
        excess = (f * f - square) * 0.5
        value = excess * excess - squared_cofactor - 2 * determinant * f
        return f - safe_divide(value, 2 * (f * excess - determinant))

    return lax.fori_loop(0, _NEWTON_STEPS[square.dtype.name], newton, start)

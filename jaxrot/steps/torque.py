"""The torque step of Müller et al. 2016."""

import jax.numpy as jnp

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import safe_divide, safe_sqrt


def correction(b: Mat3) -> Quaternion:
    """The rotation by the vector d / (|t| + ε), with B = QᵀA, d = vee(B − Bᵀ) and t = tr B.

    The torque Σ rᵢ×aᵢ is d in the body frame of Q, so no rotation matrix is multiplied. The step decreases ‖A − Q‖ near
    the solution. It converges linearly, at the rate of the largest eigenvalue of S/tr S in modulus.

    Args:
        b: QᵀA on components, its scale removed by a power of two.

    Returns:
        The correction as a unit quaternion, to be multiplied from the right; the identity where d = 0, A = 0 included.

    Cost: about 90 flops.
    Source: Müller et al. 2016, eq. (7), with three corrections. The absolute value is demanded by its text; without it
    144 of 2,000 random starts fail for A = 1. The product is r×a as in (4), not a×r as in (5). ε is inside the
    reciprocal and relative to ‖A‖; the paper's 1e-9 outside it (appendix D) gives NaN for A = 0 and is wrong at other
    scales.
    """
    epsilon = jnp.finfo(b[0][0].dtype).eps * safe_sqrt(mat3.squared_norm(b))
    inverse = safe_divide(jnp.ones_like(epsilon), jnp.abs(mat3.trace(b)) + epsilon)
    return quaternion.exponential(mat3.scale_vector(mat3.axial(b), inverse))

"""The torque step of Müller et al. 2016."""

import jax.numpy as jnp

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import safe_divide, safe_sqrt


def correction(b: Mat3) -> Quaternion:
    """The rotation by the vector d / (|t| + ε), with B = QᵀA, d = vee(B − Bᵀ) and t = tr B.

    In the body frame of Q the torque Σ rᵢ×aᵢ is d, so that no rotation matrix is multiplied. The step decreases
    ‖A − Q‖ near the solution; it converges linearly, at the rate of the largest eigenvalue of S/tr S in modulus.

    Args:
        b: QᵀA on components, its scale removed by a power of two.

    Returns:
        The correction as a unit quaternion, to be multiplied from the right; the identity where d = 0, A = 0 included.

    Source: Müller et al. 2016, eq. (7), with the absolute value that its text demands (without it 144 of 2,000 random
    starts fail for A = 1), with r×a as in (4), not a×r as in (5), and with ε inside the reciprocal and relative to ‖A‖
    instead of 1e-9 outside it (appendix D), which is NaN for A = 0 and wrong at other scales. About 90 flops.
    """
    epsilon = jnp.finfo(b[0][0].dtype).eps * safe_sqrt(mat3.squared_norm(b))
    inverse = safe_divide(jnp.ones_like(epsilon), jnp.abs(mat3.trace(b)) + epsilon)
    return quaternion.exponential(mat3.scale_vector(mat3.axial(b), inverse))

"""The torque's axis with the best angle about it."""

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot.steps.exact_angle import turn_about


def correction(b: Mat3) -> Quaternion:
    """The turn about d = vee(B − Bᵀ), B = QᵀA, by the angle that makes tr(RᵀA) largest.

    It converges linearly like Müller's step, in about half as many steps, and in one step where A is a multiple of a
    rotation. It has no ε, and the trace never decreases.

    Args:
        b: QᵀA on components, its scale removed by a power of two.

    Returns:
        The correction as a quaternion, to be multiplied from the right; the identity where d = 0, A = 0 included.

    Cost: about 70 flops.
    Source: Müller et al. 2016, eq. (4), for the axis; `exact_angle.turn_about` for the angle.
    """
    torque = mat3.axial(b)
    return turn_about(mat3.gap_matrix(b), torque, torque)

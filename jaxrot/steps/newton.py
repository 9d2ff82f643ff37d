"""Newton's axis with the best angle about it."""

from jaxrot._algebra import mat3
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot.steps.ascent import ascent
from jaxrot.steps.cayley import zhang_shift
from jaxrot.steps.exact_angle import turn_about


def correction(b: Mat3) -> Quaternion:
    """The turn about w = |t·1 − sym B + ½(√(t² + ‖d‖²) − t)·1|⁻¹ d, B = QᵀA, by the angle that makes tr(RᵀA) largest.

    Convergence is cubic from any start. Newton's own axis, (t·1 − sym B)⁻¹ d, leads to a saddle where the matrix is
    indefinite. Two changes prevent that, and both vanish at the solution:

    - Zhang's shift, the term with the root.
    - The absolute values |…| of the pivots of LDLᵀ. They make w a direction of ascent, so saddles repel.

    The share of matrices with κ < 1e3 outside the contract, in float64, after 5 steps from 45° off and after 8 steps
    from any start: 4.6 % and 1 % with Newton's own axis, 0.04 % and 0.3 % with the shift, 0.05 % and 2 of 340,000 with
    both.

    Args:
        b: QᵀA on components, its scale removed by a power of two.

    Returns:
        The correction as a quaternion, to be multiplied from the right; the identity where d = 0, A = 0 included. It
        does not turn about an axis that A leaves free.

    Cost: about 240 flops.
    Source: Kugelstadt et al. 2018 (analytic polar decomposition) for Newton's axis; Zhang 2021 for the shift.
    """
    b = fusion_barrier(b)
    h, torque = mat3.gap_matrix(b), mat3.axial(b)
    shifted = mat3.add_to_diagonal(h, zhang_shift(b) * 0.5)
    return turn_about(h, torque, ascent(shifted, b, torque))

"""The torque iteration of Müller et al. 2016 from a cold start."""

from jaxrot._algebra import quaternion
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.scaling import unit_scaled
from jaxrot.steps import torque
from jaxrot.steps.iteration import iterate

# As many as the longest run in the paper's figure 4. The iteration is linear: no fixed count makes it exact.
_ITERATIONS = 20


def solve(a: Mat3) -> Mat3:
    """An approximation of the nearest rotation: 20 torque steps from the quaternion of A itself.

    Returns:
        Rotations. The error shrinks by max|sᵢ| / |Σsᵢ| a step: .333 for a multiple of a rotation, .9 for
        (1, .1, .01).

    Cost: about 150 flops, a sine, a cosine and two square roots a step.
    Source: Müller et al. 2016, section 3 and appendix D. Their start Quat(A)/|Quat(A)| depends on the scale of A, by
    its "+1" terms; here the scale is removed first.
    """
    a = unit_scaled(a)
    q = iterate(torque.correction, a, quaternion.from_rotation(a), _ITERATIONS)
    return quaternion.to_orthonormal(q)

"""The torque iteration of Müller et al. 2016 from a cold start."""

import jax

from jaxrot import _mat3, _quaternion
from jaxrot._scaling import unit_scaled
from jaxrot.steps import torque
from jaxrot.steps.iteration import iterate

# As many as the longest run in the paper's figure 4. The iteration is linear: no fixed count makes it exact.
_ITERATIONS = 20


def solve(matrix: jax.Array) -> jax.Array:
    """An approximation of the nearest rotation: 20 torque steps from the quaternion of A itself.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3) rotations. The error shrinks by max|sᵢ| / |Σsᵢ| a step: .333 for a multiple of a rotation, .9 for
        (1, .1, .01).

    Cost: about 150 flops, a sine, a cosine and two square roots a step.
    Source: Müller et al. 2016, section 3 and appendix D. Their start Quat(A)/|Quat(A)| depends on the scale of A, by
    its "+1" terms; here the scale is removed first.
    """
    a = unit_scaled(_mat3.components(matrix))
    q = iterate(torque.correction, a, _quaternion.from_rotation(a), _ITERATIONS)
    return _quaternion.to_matrix(q)

"""Warm-start steps, one a file, and their registry.

How the steps converge to the nearest rotation, for the signed singular values sᵢ of A:

- `torque`: linear. The error shrinks by max|sᵢ| / |Σsᵢ| a step. It is enough if the sᵢ are of similar size and the
  rotation changes little. It follows a rod that turns by 5° a frame with a lag of 6 to 13°, or loses it.
- `torque_exact_angle`: linear, with about half the steps, and one step for a multiple of a rotation. tr(RᵀA) never
  decreases.
- `newton`: cubic from any start. tr(RᵀA) never decreases.
- `cayley`: cubic from within 90°.
- `quest`: one step, except near a half turn. It is as exact as the sum of the sᵢ that it computes.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._frozen import FrozenMapping
from jaxrot.steps import cayley, newton, quest, torque, torque_exact_angle


class Step(NamedTuple):
    """A step of `refine_rotation`: it moves a rotation Q towards the rotation nearest to A.

    Attributes:
        correction: From the components of B = QᵀA, scaled by a power of two, to the quaternion of the rotation that Q
            is multiplied by from the right.
        source: The publication.
    """

    correction: Callable[[Mat3], Quaternion]
    source: str


STEPS: Mapping[str, Step] = FrozenMapping(
    {
        "torque": Step(torque.correction, source="Müller et al. 2016, eq. (7)"),
        "torque_exact_angle": Step(torque_exact_angle.correction, source="Müller et al. 2016, eq. (4)"),
        "newton": Step(newton.correction, source="Kugelstadt et al. 2018; Zhang 2021"),
        "cayley": Step(cayley.correction, source="Zhang 2021"),
        "quest": Step(quest.correction, source="Shuster and Oh 1981 (QUEST)"),
    }
)

"""Warm-start steps, one a file, and their registry."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._frozen import FrozenMapping
from jaxrot.steps import cayley, newton, quest, torque, torque_exact_angle


class Step(NamedTuple):
    """A step of `refine_rotation`.

    Attributes:
        correction: From B = QᵀA, on components and scale removed, to the quaternion of the rotation to append to Q.
        source: Where it is from.
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

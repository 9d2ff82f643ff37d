"""Warm-start steps, one a file, and their registry."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from jaxrot._mat3 import Mat3
from jaxrot._quaternion import Quaternion
from jaxrot.steps import torque


class Step(NamedTuple):
    """A step of `refine_rotation`.

    Attributes:
        correction: From B = QᵀA, on components and scale removed, to the quaternion of the rotation to append to Q.
        convergence: Its order near the solution.
        source: Where it is from.
    """

    correction: Callable[[Mat3], Quaternion]
    convergence: str
    source: str


STEPS: Mapping[str, Step] = MappingProxyType(
    {"torque": Step(torque.correction, "linear, max|sᵢ| / |Σsᵢ|", "Müller et al. 2016, eq. (7)")}
)

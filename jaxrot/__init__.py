"""jaxrot: the rotation in a 3×3 matrix, in batches, differentiable to any order, right for every finite input."""

from jaxrot import families as families
from jaxrot._blocks import in_blocks as in_blocks
from jaxrot._nearest import nearest_quaternion_wxyz as nearest_quaternion_wxyz
from jaxrot._nearest import nearest_rotation as nearest_rotation
from jaxrot._refine import refine_quaternion_wxyz as refine_quaternion_wxyz
from jaxrot._refine import refine_rotation as refine_rotation
from jaxrot.solvers import DEFAULT_METHOD as DEFAULT_METHOD
from jaxrot.solvers import METHODS as METHODS
from jaxrot.solvers import Method as Method
from jaxrot.steps import STEPS as STEPS
from jaxrot.steps import Step as Step

__version__ = "0.1.0"

__all__ = [
    "DEFAULT_METHOD",
    "METHODS",
    "STEPS",
    "Method",
    "Step",
    "families",
    "in_blocks",
    "nearest_quaternion_wxyz",
    "nearest_rotation",
    "refine_quaternion_wxyz",
    "refine_rotation",
]

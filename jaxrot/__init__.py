"""jaxrot: the rotation in a 3×3 matrix, in batches, differentiable to any order, right for every finite input."""

from jaxrot import _startup as _startup  # the first: it handles Ctrl-C while the rest is imported
from jaxrot import families as families
from jaxrot._blocks import in_blocks as in_blocks
from jaxrot._conditioning import rotation_gap as rotation_gap
from jaxrot._dense import TwistModes as TwistModes
from jaxrot._dense import arap_hessian as arap_hessian
from jaxrot._dense import rotation_jacobian as rotation_jacobian
from jaxrot._dense import twist_modes as twist_modes
from jaxrot._isotropic import isotropic_energy as isotropic_energy
from jaxrot._isotropic import isotropic_map as isotropic_map
from jaxrot._nearest import nearest_quaternion_wxyz as nearest_quaternion_wxyz
from jaxrot._nearest import nearest_rotation as nearest_rotation
from jaxrot._polar import PolarDecomposition as PolarDecomposition
from jaxrot._polar import polar_decomposition as polar_decomposition
from jaxrot._recommend import recommend as recommend
from jaxrot._recommendation import Recommendation as Recommendation
from jaxrot._refine import refine_quaternion_wxyz as refine_quaternion_wxyz
from jaxrot._refine import refine_rotation as refine_rotation
from jaxrot._svd import RotationVariantSVD as RotationVariantSVD
from jaxrot._svd import rotation_variant_svd as rotation_variant_svd
from jaxrot._svd import signed_singular_values as signed_singular_values
from jaxrot.solvers import DEFAULT_METHOD as DEFAULT_METHOD
from jaxrot.solvers import METHODS as METHODS
from jaxrot.solvers import Method as Method
from jaxrot.steps import STEPS as STEPS
from jaxrot.steps import Step as Step

__version__ = "0.2.0"

__all__ = [
    "DEFAULT_METHOD",
    "METHODS",
    "STEPS",
    "Method",
    "PolarDecomposition",
    "Recommendation",
    "RotationVariantSVD",
    "Step",
    "TwistModes",
    "arap_hessian",
    "families",
    "in_blocks",
    "isotropic_energy",
    "isotropic_map",
    "nearest_quaternion_wxyz",
    "nearest_rotation",
    "polar_decomposition",
    "recommend",
    "refine_quaternion_wxyz",
    "refine_rotation",
    "rotation_gap",
    "rotation_jacobian",
    "rotation_variant_svd",
    "signed_singular_values",
    "twist_modes",
]

"""jaxrot: nearest rotations of 3×3 matrices in JAX, in batches, differentiable to any order, for every finite input."""

import importlib
from typing import TYPE_CHECKING

from jaxrot import _startup as _startup  # first: it handles Ctrl-C while the rest is imported
from jaxrot import families as families
from jaxrot._blocks import in_blocks as in_blocks
from jaxrot._gap import rotation_gap as rotation_gap
from jaxrot._isotropic import isotropic_energy as isotropic_energy
from jaxrot._isotropic import isotropic_map as isotropic_map
from jaxrot._jacobian import TwistModes as TwistModes
from jaxrot._jacobian import arap_hessian as arap_hessian
from jaxrot._jacobian import rotation_jacobian as rotation_jacobian
from jaxrot._jacobian import twist_modes as twist_modes
from jaxrot._nearest import nearest_quaternion_wxyz as nearest_quaternion_wxyz
from jaxrot._nearest import nearest_rotation as nearest_rotation
from jaxrot._polar import PolarDecomposition as PolarDecomposition
from jaxrot._polar import polar_decomposition as polar_decomposition
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

if TYPE_CHECKING:
    from jaxrot._recommend.recommend import recommend as recommend
    from jaxrot._recommend.result import Recommendation as Recommendation

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

# These load the code that measures, so they are imported on first use.
_LAZY = {"Recommendation": "jaxrot._recommend.result", "recommend": "jaxrot._recommend.recommend"}


def __getattr__(name: str) -> object:
    """A public name that is imported on first use."""
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_LAZY[name]), name)

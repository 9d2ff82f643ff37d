"""The bounds of the contract, and the domain on which each method declares that it keeps it."""

import numpy as np

from jaxrot.evaluation.ground_truth import Judged
from jaxrot.solvers import Method

# Bounds in units of eps; the forward error's is per (1 + κ), the last two are relative to s1.
FORWARD_BOUND = 8
ORTHOGONALITY_BOUND = 10
LOST_TRACE_BOUND = 16
TORQUE_BOUND = 128


def in_domain(method: Method, judged: Judged) -> np.ndarray:
    """Whether each matrix lies in the domain on which the method declares that it keeps the contract."""
    dtype = judged.matrices.dtype.name
    limit = method.condition_limit[dtype]
    # A limit this high includes matrices with a NaN or without a unique R.
    inside = np.full(len(judged.matrices), limit >= largest_condition(dtype)) | (judged.condition <= limit)
    if not method.handles_inversion:
        inside = inside & (~judged.is_inverted)
    return inside


def largest_condition(dtype: str) -> float:
    """The condition number from which on the contract does not bound the forward error."""
    return 1 / (8 * float(np.finfo(dtype).eps))


def describe_domain(method: Method, dtype: str) -> str:
    """The declared domain as a short text for a table."""
    limit = method.condition_limit[dtype]
    words = ["exact" if method.exact else "approximation"]
    if not method.handles_inversion:
        words.append("det ≥ 0")
    if method.exact and limit < largest_condition(dtype):
        words.append(f"κ ≤ {limit:.2g}".replace("e+0", "e").replace("e+", "e") if limit > 0 else "κ: none")
    return ", ".join(words)

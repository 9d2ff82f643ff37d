"""The contract of the default method, in numbers, and the part of it that each method declares its own."""

import numpy as np

from jaxrot.evaluation.ground_truth import Judged
from jaxrot.solvers import Method

# Bounds in units of eps; the forward error's is per (1 + κ), the last two are relative to s1.
FORWARD_BOUND = 8
ORTHOGONALITY_BOUND = 10
LOST_TRACE_BOUND = 16
TORQUE_BOUND = 128


def in_domain(method: Method, judged: Judged) -> np.ndarray:
    """Which matrices a method declares it keeps the contract on.

    Args:
        method: A record of `jaxrot.METHODS`.
        judged: The matrices, with their condition number and what else a domain speaks of.

    Returns:
        One boolean a matrix. All false for a method that promises nothing in units of eps.
    """
    dtype = judged.matrices.dtype.name
    limit = method.condition_limit[dtype]
    # At a limit this high nothing is left out, matrices without a unique R and those with a NaN included.
    inside = np.full(len(judged.matrices), limit >= largest_condition(dtype)) | (judged.condition <= limit)
    if not method.handles_inversion:
        inside = inside & (~judged.is_inverted)
    return inside


def largest_condition(dtype: str) -> float:
    """κ from which on the contract does not speak of the forward error."""
    return 1 / (8 * float(np.finfo(dtype).eps))


def describe_domain(method: Method, dtype: str) -> str:
    """The declared domain in a few words, for a table's column."""
    limit = method.condition_limit[dtype]
    words = ["exact" if method.exact else "approximation"]
    if not method.handles_inversion:
        words.append("det ≥ 0")
    if method.exact and limit < largest_condition(dtype):
        words.append(f"κ ≤ {limit:.2g}".replace("e+0", "e").replace("e+", "e") if limit > 0 else "κ: none")
    return ", ".join(words)

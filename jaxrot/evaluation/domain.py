"""The bounds of the contract, and the domain on which each method declares that it keeps it."""

import numpy as np

from jaxrot.evaluation.ground_truth import Judged
from jaxrot.solvers import Method

# Bounds in units of eps; the forward error's is per (1 + κ), the last two are relative to s1.
FORWARD_BOUND = 8
ORTHOGONALITY_BOUND = 10
LOST_TRACE_BOUND = 16
TORQUE_BOUND = 128


# The largest κ for an approximation: s2 + s3 ≥ s1. Approximations are for matrices near a rotation, κ = ½. They declare
# no limit in units of eps, because their error is not rounding.
APPROXIMATION_LIMIT = 1.0


def condition_limit(method: Method, dtype: str) -> float:
    """The largest κ that a method is for; infinite if it is for matrices with a NaN or without a unique R too."""
    if not method.exact:
        return APPROXIMATION_LIMIT
    declared = method.condition_limit[dtype]
    return float("inf") if declared >= largest_condition(dtype) else declared


def is_within(condition: np.ndarray | float, limit: float, dtype: str) -> np.ndarray:
    """Whether κ is at most the limit, up to rounding: the κ of a rounded rotation is ½ only to a few eps."""
    return np.isinf(limit) | (np.asarray(condition) <= limit * (1 + 8 * float(np.finfo(dtype).eps)))


def in_domain(method: Method, judged: Judged) -> np.ndarray:
    """Whether each matrix lies in the domain on which the method declares that it keeps the contract.

    An approximation declares that for no matrix.
    """
    dtype = judged.matrices.dtype.name
    inside = is_within(judged.condition, condition_limit(method, dtype), dtype) & method.exact
    return inside if method.handles_inversion else inside & ~judged.is_inverted


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

"""How right a method's rotations are, judged against a wider arithmetic."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from jaxrot.evaluation import domain, reference
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.solvers import Method


class Accuracy(NamedTuple):
    """How one method did on one set of matrices in one dtype.

    Errors are None where the set holds no matrix they are defined on: the forward error is judged where
    κ < 1/(8 eps), the others on every finite matrix, and none but orthogonality where subnormal entries carry R.

    Attributes:
        method: The method's name.
        dtype: "float32" or "float64".
        group: "input" or "families".
        set_name: The set's name within the group; "whole input" for all of it.
        matrices: Matrices in the set.
        not_finite: Of these, matrices with a NaN or an infinity: left out of every error.
        judged: Of these, matrices whose forward error is judged.
        forward_median: Median of ‖R - R*‖_F.
        forward_99th: Its 99th percentile.
        forward_max: Its maximum.
        forward_units_median: Median of ‖R - R*‖_F / (eps (1 + κ)).
        forward_units_max: Its maximum.
        orthogonality_max: Largest ‖RᵀR - 1‖_F / eps; infinite where det R < 0.
        lost_trace_max: Largest (tr(R*ᵀA) - tr(RᵀA)) / (eps s1).
        torque_max: Largest ‖RᵀA - AᵀR‖_F / (eps s1).
        outside: Matrices on which the contract is broken.
        in_domain: Matrices on which the method declares that it keeps the contract.
        outside_in_domain: Of these, matrices on which it does not.
    """

    method: str
    dtype: str
    group: str
    set_name: str
    matrices: int
    not_finite: int
    judged: int
    forward_median: float | None
    forward_99th: float | None
    forward_max: float | None
    forward_units_median: float | None
    forward_units_max: float | None
    orthogonality_max: float | None
    lost_trace_max: float | None
    torque_max: float | None
    outside: int
    in_domain: int
    outside_in_domain: int


class Errors(NamedTuple):
    """The errors of one method's rotations, one entry a matrix; NaN where not defined, inf where R is no number."""

    forward: np.ndarray
    forward_units: np.ndarray
    orthogonality: np.ndarray
    lost_trace: np.ndarray
    torque: np.ndarray
    is_outside: np.ndarray

    @property
    def over_bounds(self) -> dict[str, np.ndarray]:
        """Each error as a multiple of what the contract allows, by the name of what it bounds."""
        return {
            "rotation": self.forward_units / domain.FORWARD_BOUND,
            "orthogonality": self.orthogonality / domain.ORTHOGONALITY_BOUND,
            "trace": self.lost_trace / domain.LOST_TRACE_BOUND,
            "torque": self.torque / domain.TORQUE_BOUND,
        }


def run_in_chunks(call: Callable[..., np.ndarray], matrices: np.ndarray, chunk: int, *starts: np.ndarray) -> np.ndarray:
    """Applies a function compiled for one batch size to any number of matrices; the last chunk is filled up.

    Args:
        call: Of as many arrays (chunk, 3, 3) as are given.
        matrices: Shape (n, 3, 3), n > 0.
        chunk: Matrices in a call.
        *starts: Further arrays of the same shape.
    """
    results = []
    for begin in range(0, len(matrices), chunk):
        parts = [array[begin : begin + chunk] for array in (matrices, *starts)]
        missing = chunk - len(parts[0])
        filled = [np.concatenate([part, np.broadcast_to(part[:1], (missing, 3, 3))]) for part in parts]
        results.append(np.asarray(call(*filled))[: len(parts[0])])
    return np.concatenate(results)


def measure_errors(rotation: np.ndarray, judged: Judged) -> Errors:
    """Every error of the rotations of `judged.matrices`."""
    matrices, solution = judged.matrices, judged.solution
    eps = float(np.finfo(matrices.dtype).eps)
    is_number = np.isfinite(rotation).all(axis=(1, 2))
    is_scored = judged.is_finite & judged.is_normal
    is_unique = is_scored & (judged.condition < domain.largest_condition(matrices.dtype.name))

    def errors(values: np.ndarray, where: np.ndarray) -> np.ndarray:
        # A rotation that is no number is infinitely wrong.
        return np.where(where, np.where(is_number, values, np.inf), np.nan)

    forward = errors(reference.forward_error(rotation, matrices, reference=solution), is_unique)
    forward_units = forward / (eps * (1 + np.where(is_unique, judged.condition, 0)))
    orthogonality = errors(reference.orthogonality_error(rotation) / eps, judged.is_finite)
    lost_trace = errors(reference.lost_trace(rotation, matrices, reference=solution) / eps, is_scored)
    torque = errors(reference.torque(rotation, matrices, reference=solution) / eps, is_scored)
    is_outside = (
        (forward_units > domain.FORWARD_BOUND)
        | (orthogonality > domain.ORTHOGONALITY_BOUND)
        | (lost_trace > domain.LOST_TRACE_BOUND)
        | (torque > domain.TORQUE_BOUND)
        # The promise for a matrix that is not finite: NaN, and nothing but NaN.
        | (~judged.is_finite & ~np.isnan(rotation).all(axis=(1, 2)))
    )
    return Errors(forward, forward_units, orthogonality, lost_trace, torque, is_outside)


def summarise(name: str, method: Method, errors: Errors, judged: Judged, group: str) -> Iterator[Accuracy]:
    """One `Accuracy` a set of the batch."""
    inside = domain.in_domain(method, judged)
    for set_name, part in judged.sets.items():
        yield Accuracy(
            method=name,
            dtype=judged.matrices.dtype.name,
            group=group,
            set_name=set_name,
            matrices=len(judged.matrices[part]),
            not_finite=int(np.sum(~judged.is_finite[part])),
            judged=int(np.sum(~np.isnan(errors.forward[part]))),
            forward_median=_statistic(np.median, errors.forward[part]),
            forward_99th=_statistic(_99th_percentile, errors.forward[part]),
            forward_max=_statistic(np.max, errors.forward[part]),
            forward_units_median=_statistic(np.median, errors.forward_units[part]),
            forward_units_max=_statistic(np.max, errors.forward_units[part]),
            orthogonality_max=_statistic(np.max, errors.orthogonality[part]),
            lost_trace_max=_statistic(np.max, errors.lost_trace[part]),
            torque_max=_statistic(np.max, errors.torque[part]),
            outside=int(np.sum(errors.is_outside[part])),
            in_domain=int(np.sum(inside[part])),
            outside_in_domain=int(np.sum(errors.is_outside[part] & inside[part])),
        )


def _99th_percentile(values: np.ndarray) -> float:
    # "higher" interpolates nothing: between a number and an infinity there is no number.
    return np.quantile(values, 0.99, method="higher")


def _statistic(function: Callable[[np.ndarray], float], values: np.ndarray) -> float | None:
    values = values[~np.isnan(values)]
    return float(function(values)) if values.size else None

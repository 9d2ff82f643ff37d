"""Errors of a method's rotations, relative to a reference in wider arithmetic."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from jaxrot.evaluation import domain, reference
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.solvers import Method


class Accuracy(NamedTuple):
    """Errors of one method on one set of matrices in one dtype.

    An error is None if no matrix of the set defines it. The forward error is defined where κ < 1/(8 eps), and
    the others on every finite matrix. If R depends on subnormal entries, only the orthogonality is defined.
    """

    method: str  # Its name
    dtype: str  # "float32" or "float64"
    group: str  # "input" or "families"
    set_name: str  # The set's name within the group; "whole input" for all of it
    matrices: int  # Matrices in the set
    not_finite: int  # Of these, matrices with a NaN or an infinity, which are left out of every error
    judged: int  # Of these, matrices whose forward error is judged
    forward_median: float | None  # Median of ‖R - R*‖_F
    forward_99th: float | None  # Its 99th percentile
    forward_max: float | None  # Its maximum
    forward_units_median: float | None  # Median of ‖R - R*‖_F / (eps (1 + κ))
    forward_units_max: float | None  # Its maximum
    orthogonality_max: float | None  # Largest ‖RᵀR - 1‖_F / eps; infinite if det R < 0
    lost_trace_max: float | None  # Largest (tr(R*ᵀA) - tr(RᵀA)) / (eps s1)
    torque_max: float | None  # Largest ‖RᵀA - AᵀR‖_F / (eps s1)
    outside: int  # Matrices on which the contract is broken
    in_domain: int  # Matrices on which the method declares that it keeps the contract
    outside_in_domain: int  # Of these, matrices on which it does not


_MAXIMA = ("forward", "forward_units", "orthogonality", "lost_trace", "torque")


class Errors(NamedTuple):
    """The errors of one method's rotations, one entry for each matrix: NaN if not defined, inf if R is not finite."""

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
    """Applies a function compiled for `chunk` matrices to any number of matrices, and to starts if it takes them."""
    results = []
    for begin in range(0, len(matrices), chunk):
        # The last matrix fills up the last chunk.
        indices = np.minimum(np.arange(begin, begin + chunk), len(matrices) - 1)
        results.append(np.asarray(call(*(array[indices] for array in (matrices, *starts)))))
    return np.concatenate(results)[: len(matrices)]


def measure_errors(rotation: np.ndarray, judged: Judged) -> Errors:
    """Every error of the rotations of `judged.matrices`."""
    matrices, solution = judged.matrices, judged.solution
    eps = float(np.finfo(matrices.dtype).eps)
    is_finite = np.isfinite(rotation).all(axis=(1, 2))
    is_scored = judged.is_finite & judged.is_normal
    is_unique = is_scored & (judged.condition < domain.largest_condition(matrices.dtype.name))

    def errors(values: np.ndarray, where: np.ndarray) -> np.ndarray:
        # The error of a rotation that is not finite is infinite.
        return np.where(where, np.where(is_finite, values, np.inf), np.nan)

    forward = errors(reference.forward_error(rotation, matrices, reference=solution), is_unique)
    forward_units = forward / (eps * (1 + np.where(is_unique, judged.condition, 0)))
    orthogonality = errors(reference.orthogonality_error(rotation) / eps, judged.is_finite)
    lost_trace = errors(reference.lost_trace(rotation, matrices, reference=solution) / eps, is_scored)
    torque = errors(reference.torque(rotation, matrices, reference=solution) / eps, is_scored)
    # The promise for a matrix that is not finite is NaN in every entry.
    is_outside = ~judged.is_finite & ~np.isnan(rotation).all(axis=(1, 2))
    found = Errors(forward, forward_units, orthogonality, lost_trace, torque, is_outside)
    return found._replace(is_outside=is_outside | (np.array(list(found.over_bounds.values())) > 1).any(axis=0))


def summarise(name: str, method: Method, errors: Errors, judged: Judged, group: str) -> Iterator[Accuracy]:
    """One `Accuracy` for each set of the batch."""
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
            forward_units_median=_statistic(np.median, errors.forward_units[part]),
            **{f"{name}_max": _statistic(np.max, getattr(errors, name)[part]) for name in _MAXIMA},
            outside=int(np.sum(errors.is_outside[part])),
            in_domain=int(np.sum(inside[part])),
            outside_in_domain=int(np.sum(errors.is_outside[part] & inside[part])),
        )


def _99th_percentile(values: np.ndarray) -> float:
    # "higher" does not interpolate: between a finite number and infinity the result would be NaN.
    return np.quantile(values, 0.99, method="higher")


def _statistic(function: Callable[[np.ndarray], float], values: np.ndarray) -> float | None:
    values = values[~np.isnan(values)]
    return float(function(values)) if values.size else None

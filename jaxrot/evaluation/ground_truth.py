"""Matrices with their reference solution and everything else that does not depend on the method."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxrot.evaluation import reference


class Judged(NamedTuple):
    """A batch of matrices in one dtype. All arrays have one entry for each matrix."""

    matrices: np.ndarray  # Shape (n, 3, 3), float32 or float64
    sets: dict[str, slice]  # The named parts of the batch; they may overlap
    # Nearest rotation and signed singular values in the reference's wider dtype; NaN if the matrix is not finite.
    solution: reference.Reference
    condition: np.ndarray  # κ = s1/(s2+s3); inf if R is not unique, NaN if the matrix is not finite
    size: np.ndarray  # ‖A‖_F/√3, which is 1 for a rotation
    is_inverted: np.ndarray  # det A < 0
    is_finite: np.ndarray  # No NaN and no infinity in the matrix
    is_normal: np.ndarray  # Flushing subnormal entries to zero, as XLA on CPU does, would not change R beyond eps


def judge(sets: Mapping[str, np.ndarray], dtype: str, whole: str | None = None) -> Judged:
    """Returns sets of matrices, shape (n, 3, 3), rounded to a dtype, as one batch with their nearest rotations.

    Rounding to float32 may overflow to infinity. `whole` is a name for the set of all matrices, if wanted.
    """
    with np.errstate(over="ignore", under="ignore"):
        parts = [array.astype(dtype) for array in sets.values()]
    matrices = np.concatenate(parts)
    ends = np.cumsum([len(part) for part in parts]).tolist()
    slices = {name: slice(end - len(part), end) for name, part, end in zip(sets, parts, ends, strict=True)}
    if whole is not None:
        slices = {whole: slice(0, len(matrices))} | slices
    solution = reference.solve(matrices)
    magnitude = np.abs(matrices)
    largest = magnitude.max(axis=(1, 2))
    limits = np.finfo(dtype)
    is_subnormal = ((magnitude != 0) & (magnitude < limits.smallest_normal)).any(axis=(1, 2))
    return Judged(
        matrices=matrices,
        sets=slices,
        solution=solution,
        condition=reference.condition(matrices, reference=solution),
        size=np.sqrt(np.mean(solution.singular_values**2, axis=1)),
        is_inverted=solution.singular_values[:, 2] < 0,
        is_finite=np.all(np.isfinite(matrices), axis=(1, 2)),
        is_normal=~is_subnormal | (largest >= limits.smallest_normal / limits.eps),
    )

"""The sample of the user's matrices that `recommend` measures on, and a survey of all of them.

notation: A a matrix; R* its nearest rotation; s1 ≥ s2 ≥ |s3| the signed singular values; κ = s1/(s2+s3).
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import core
from jax.typing import ArrayLike, DTypeLike

from jaxrot._inputs import check_matrix, check_start, computing
from jaxrot.evaluation import domain
from jaxrot.evaluation.ground_truth import Judged, judge

# A larger sample would not change the result, and the reference takes 20 µs a matrix.
MOST_MATRICES = 10_000
# The number of extreme matrices of each kind, which a random sample could miss: the largest κ and the smallest s3/s1.
EXTREMES = 100

# A batch has the size of the sample within these limits. In smaller batches the overhead of a call dominates.
SMALLEST_BATCH, LARGEST_BATCH = 10_000, 100_000
# A start with a larger ‖RᵀR − 1‖_F is not a rotation that has drifted, but a mistake of the caller.
_FARTHEST_FROM_ROTATION = 0.1
_CHUNK = 100_000


class Sample(NamedTuple):
    """The sample, and a survey of all matrices."""

    judged: Judged  # The sample in the computing dtype, with its reference
    starts: np.ndarray | None  # The rotations to start from, one a matrix of the sample
    given: int  # Number of matrices given
    not_finite: int  # Number of matrices left out because they or their starts hold NaN or inf
    n_inverted: int  # Number of finite matrices with det A < 0, or 0 up to rounding
    largest_condition: float  # Largest κ of the finite matrices; inf if an R* is not unique up to rounding

    @property
    def dtype(self) -> str:
        """The computing dtype: "float32" or "float64"."""
        return self.judged.matrices.dtype.name

    @property
    def finite(self) -> int:
        """The number of matrices that are not left out."""
        return self.given - self.not_finite

    @property
    def batch(self) -> int:
        """The number of matrices in a timed call."""
        return min(max(self.finite, SMALLEST_BATCH), LARGEST_BATCH)


def take_sample(matrices: ArrayLike, previous: ArrayLike | None, dtype: DTypeLike | None) -> Sample:
    """Validates the arguments of `recommend`, surveys every matrix and draws the sample."""
    checked = computing(jnp.asarray(check_matrix(matrices, "matrices"))).value
    for name, array in (("matrices", checked), ("previous", previous)):
        if isinstance(array, core.Tracer):
            raise TypeError(
                f"{name} must be concrete, for recommend measures on it; got a traced array:"
                " call recommend outside jit, vmap and grad, and its apply inside"
            )
    checked = checked.astype(_check_dtype(dtype) if dtype is not None else checked.dtype)
    starts = None
    if previous is not None:
        starts = check_start(previous, "previous", (3, 3), checked).astype(checked.dtype)
        batch = jnp.broadcast_shapes(checked.shape, starts.shape)
        checked, starts = jnp.broadcast_to(checked, batch), jnp.broadcast_to(starts, batch)
    if checked.size == 0:
        raise ValueError(f"matrices must hold at least one matrix; got shape {checked.shape}")
    a = np.asarray(checked).reshape(-1, 3, 3)
    is_finite = np.isfinite(a).all(axis=(1, 2))
    if starts is not None:
        starts = np.asarray(starts).reshape(-1, 3, 3)
        _check_rotations(starts)
        is_finite &= np.isfinite(starts).all(axis=(1, 2))
        starts = starts[is_finite]
    if not is_finite.any():
        raise ValueError(
            f"matrices must hold a finite one, with a finite start in previous; got none of {len(a):,} in {a.dtype}"
        )
    given, a = len(a), a[is_finite]
    condition, relative_s3 = _survey(a)
    kept = _draw(condition, relative_s3, a.dtype)
    return Sample(
        judged=judge({"sample": a[kept]}, a.dtype.name),
        starts=None if starts is None else starts[kept],
        given=given,
        not_finite=given - len(a),
        # Below this the sign of the determinant is rounding, and so is the result of a method for det A > 0.
        n_inverted=int(np.sum(relative_s3 <= 8 * float(np.finfo(a.dtype).eps))),
        largest_condition=float(condition.max()),
    )


def _check_dtype(dtype: DTypeLike) -> np.dtype:
    try:
        wanted = np.dtype(dtype)
    except TypeError:
        raise TypeError(f"dtype must be float32 or float64; got {dtype!r}") from None
    if wanted.name not in ("float32", "float64"):
        raise ValueError(f"dtype must be float32 or float64; got {wanted.name}")
    if wanted.name == "float64" and jnp.asarray(0.0).dtype != wanted:
        raise ValueError(
            "dtype float64 needs jax.config.update('jax_enable_x64', True) at the start of the program; it is off"
        )
    return wanted


def _check_rotations(starts: np.ndarray) -> None:
    r = starts.astype(np.float64)
    is_finite = np.asarray(np.isfinite(r).all(axis=(1, 2)))
    with np.errstate(all="ignore"):
        defect = np.linalg.norm(np.swapaxes(r, 1, 2) @ r - np.eye(3), axis=(1, 2))
        # Give LAPACK no NaN: it does not define the result.
        is_upright = np.linalg.det(np.where(is_finite[:, None, None], r, 0)) > 0
    wrong = int(np.sum(is_finite & ~((defect <= _FARTHEST_FROM_ROTATION) & is_upright)))
    if wrong:
        raise ValueError(
            f"previous must hold rotations, ‖RᵀR - 1‖_F ≤ {_FARTHEST_FROM_ROTATION} and det R > 0;"
            f" got {wrong:,} of {len(r):,} that are none"
        )


def _survey(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns κ and s3/s1 of every matrix, to float64 rounding, which is coarser than that of the reference."""
    parts = [_survey_chunk(matrices[begin : begin + _CHUNK]) for begin in range(0, len(matrices), _CHUNK)]
    condition, relative_s3 = map(np.concatenate, zip(*parts, strict=True))
    return condition, relative_s3


def _survey_chunk(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a = matrices.astype(np.float64)
    # Scale by a power of two, which is exact. Unscaled, the determinant could overflow or underflow.
    _, exponent = np.frexp(np.abs(a).max(axis=(1, 2)))
    a = np.ldexp(a, -exponent[:, None, None])
    s = np.linalg.svd(a, compute_uv=False)
    s = s / np.where(s[:, :1] == 0, 1, s[:, :1])
    s3 = s[:, 2] * np.sign(np.linalg.det(a))
    gap = s[:, 1] + s3
    unresolved = gap <= 8 * float(np.finfo(np.float64).eps)
    return np.where(unresolved, np.inf, 1 / np.where(unresolved, 1, gap)), s3


def _draw(condition: np.ndarray, relative_s3: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Returns the indices of the sample: the extremes and random others."""
    if len(condition) <= MOST_MATRICES:
        return np.arange(len(condition))
    # Take the largest κ among the matrices whose R* is determined: the others have no error to measure.
    judged_condition = np.where(condition < domain.largest_condition(dtype.name), condition, 0)
    extremes = np.union1d(np.argsort(-judged_condition)[:EXTREMES], np.argsort(relative_s3)[:EXTREMES])
    others = np.setdiff1d(np.arange(len(condition)), extremes)
    drawn = np.random.default_rng(0).choice(others, MOST_MATRICES - len(extremes), replace=False)
    return np.sort(np.concatenate([extremes, drawn]))

"""The specification as assertions: what a rotation must be to be the nearest one, measured in higher precision."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxrot import METHODS
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES

# The contract of the default method, in units of eps.
FORWARD = 8  # times (1 + kappa), for kappa < 1/(8 eps)
ORTHOGONALITY = 10
LOST_TRACE = 16
TORQUE = 128


class Batch(NamedTuple):
    """All families in one batch, so that a method compiles once; `families` names each matrix's."""

    matrices: np.ndarray
    singular_values: np.ndarray
    families: np.ndarray
    condition: np.ndarray
    nearest: np.ndarray


@functools.lru_cache
def family_batch(dtype: str, count: int = 24, seed: int = 0) -> Batch:
    """`count` matrices of every family, with their reference rotations."""
    samples = {name: family.sample(count, dtype=np.dtype(dtype), seed=seed) for name, family in FAMILIES.items()}
    matrices = np.concatenate([sample.matrices for sample in samples.values()])
    return Batch(
        matrices,
        np.asarray(reference.signed_singular_values(matrices)),
        np.repeat(np.array(list(samples), object), count),
        np.asarray(reference.condition(matrices)),
        np.asarray(reference.reference_rotation(matrices)),
    )


def in_families(batch: Batch, names: Sequence[str]) -> np.ndarray:
    """Which matrices of the batch belong to these families; a name that is none fails."""
    assert set(names) <= set(FAMILIES), f"no families: {set(names) - set(FAMILIES)}"
    return np.isin(batch.families, names)


def assert_within(measured: np.ndarray, bound: np.ndarray | float, families: np.ndarray, promise: str) -> None:
    """Fails, naming the worst family, where `measured` is above `bound` or not a number."""
    measured = np.asarray(measured, np.float64)
    ratio = np.where(np.isfinite(measured), measured, np.inf) / bound
    if ratio.size and not (ratio <= 1).all():
        worst = np.argmax(ratio)
        broken = sorted(set(families[~(ratio <= 1)].tolist()))
        raise AssertionError(
            f"{promise}: {ratio[worst]:.3g} times the bound in family {families[worst]!r} (matrix {worst}); "
            f"broken in {', '.join(broken)}"
        )


def assert_forward_error(rotation: np.ndarray, batch: Batch, where: np.ndarray, bound: float = FORWARD) -> None:
    """‖R−R*‖ ≤ bound·eps (1+κ) for the matrices chosen by `where`."""
    eps = np.finfo(batch.matrices.dtype).eps
    error = np.linalg.norm(np.asarray(np.asarray(rotation)[where] - batch.nearest[where], np.float64), axis=(-2, -1))
    assert_within(error, bound * eps * (1 + batch.condition[where]), batch.families[where], "forward error")


def assert_rotations(rotation: np.ndarray, families: np.ndarray, bound: float = ORTHOGONALITY) -> None:
    """Finite, orthogonal to `bound` eps, determinant +1."""
    rotation = np.asarray(rotation)
    eps = np.finfo(rotation.dtype).eps
    assert_within(reference.orthogonality_error(rotation), bound * eps, families, "orthogonality")
    determinant = np.linalg.det(rotation.astype(np.float64))
    assert_within(np.abs(determinant - 1), 2 * bound * eps, families, "determinant +1")


def assert_contract(rotation: np.ndarray, batch: Batch) -> None:
    """Every numerical line of the contract of the default method."""
    rotation = np.asarray(rotation)
    eps = np.finfo(batch.matrices.dtype).eps
    assert rotation.dtype == batch.matrices.dtype
    assert_rotations(rotation, batch.families)
    assert_forward_error(rotation, batch, resolved(batch))
    normal = survives_flushing(batch)
    r, a, names = rotation[normal], batch.matrices[normal], batch.families[normal]
    assert_within(reference.lost_trace(r, a), LOST_TRACE * eps, names, "lost trace")
    assert_within(reference.torque(r, a), TORQUE * eps, names, "torque")


def survives_flushing(batch: Batch) -> np.ndarray:
    """Which matrices hold nothing subnormal that matters: XLA may flush that to zero before a method sees it.

    Flushing an entry moves A by less than `tiny`, harmless where s1 eps is above it.
    """
    info = np.finfo(batch.matrices.dtype)
    entries = np.abs(batch.matrices)
    harmless = (entries >= info.tiny) | (entries == 0) | (batch.singular_values[:, :1, None] * info.eps > info.tiny)
    return harmless.all(axis=(-2, -1))


def resolved(batch: Batch, limit: float | None = None) -> np.ndarray:
    """Which matrices have κ below the limit, 1/(8 eps) when absent, and survive flushing."""
    limit = 1 / (8 * np.finfo(batch.matrices.dtype).eps) if limit is None else limit
    return (batch.condition < limit) & survives_flushing(batch)


def within_domain(method: str, batch: Batch) -> np.ndarray:
    """The matrices for which the method's record promises 8 eps (1+κ)."""
    record = METHODS[method]
    where = resolved(batch, record.condition_limit[batch.matrices.dtype.name])
    if not record.handles_inversion:
        where &= batch.singular_values[:, 2] > 0
    return where


def analytic_jacobian(matrices, damping=0.0):
    """The 9×9 Jacobians by the singular vectors: Ṙ = U Ω Vᵀ, Ω_ij = (M_ij − M_ji)/(s_i+s_j), M = UᵀȦV."""
    solved = reference.solve(matrices)
    left, right = np.asarray(solved.left), np.asarray(solved.right)
    sums = np.asarray(solved.singular_values)[..., :, None] + np.asarray(solved.singular_values)[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = sums / (sums**2 + (damping * np.asarray(solved.singular_values).sum(-1))[..., None, None] ** 2)
    inverse[..., range(3), range(3)] = 0
    # M for the unit tangents E_kl: M_ij = U_ki V_lj.
    m = np.einsum("...ki,...lj->...ijkl", left, right)
    omega = inverse[..., None, None] * (m - m.swapaxes(-4, -3))
    jacobian = np.einsum("...mi,...ijkl,...nj->...mnkl", left, omega, right)
    return jacobian.reshape(*jacobian.shape[:-4], 9, 9)

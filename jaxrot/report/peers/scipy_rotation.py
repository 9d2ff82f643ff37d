"""SciPy's `Rotation`, which computes in float64 on one thread and has no derivative."""

import warnings
from collections.abc import Callable

import numpy as np

from jaxrot.report.peers.peer import Peer


def from_matrix(dtype: str) -> Peer:
    """`Rotation.from_matrix`, which orthogonalises, and raises for a whole batch if one determinant is ≤ 0."""
    from scipy.spatial.transform import Rotation

    def is_accepted(matrix: np.ndarray) -> bool:
        try:
            Rotation.from_matrix(matrix)
        except (ValueError, np.linalg.LinAlgError):
            return False
        return True

    def accepts(matrices: np.ndarray) -> np.ndarray:
        return np.array([is_accepted(matrix) for matrix in matrices.astype(np.float64)], dtype=bool)

    return _peer(dtype, lambda matrices: Rotation.from_matrix(matrices).as_matrix(), accepts)


def align_vectors(dtype: str) -> Peer:
    """`Rotation.align_vectors` of the columns of A with the axes: Kabsch's method, one matrix a call."""
    from scipy.spatial.transform import Rotation

    axes = np.eye(3)

    def rotations(matrices: np.ndarray) -> np.ndarray:
        return np.stack([Rotation.align_vectors(matrix.T, axes)[0].as_matrix() for matrix in matrices])

    return _peer(dtype, rotations, lambda matrices: np.ones(len(matrices), bool))


def _peer(
    dtype: str, rotations: Callable[[np.ndarray], np.ndarray], accepts: Callable[[np.ndarray], np.ndarray]
) -> Peer:
    def load(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The accepted matrices, and whether each is accepted."""
        places = accepts(matrices)
        return matrices[places].astype(np.float64), places

    def value(accepted: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        matrices, places = accepted
        # SciPy warns if the rotation is not unique. The report judges such matrices itself.
        with warnings.catch_warnings(action="ignore"):
            return rotations(matrices) if len(matrices) else matrices, places

    def unload(result: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        found, places = result
        whole = np.full((len(places), 3, 3), np.nan)
        whole[places] = found
        return whole.astype(dtype)

    return Peer(load, value, None, unload, threads=1, computes_in="float64", accepts=accepts)

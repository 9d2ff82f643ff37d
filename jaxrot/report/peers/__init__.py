"""Other packages to compare with: one in each file, and their registry."""

from collections.abc import Mapping
from types import MappingProxyType

from jaxrot.report.peers import jax_linalg, paper_code, roma_procrustes, scipy_rotation, warp_svd
from jaxrot.report.peers.peer import Source

PEERS: Mapping[str, Source] = MappingProxyType(
    {
        "jnp.linalg.svd": Source("with the sign of the last singular vector corrected", ("jax",), jax_linalg.svd),
        "jax polar": Source("jax.scipy.linalg.polar, which may return a reflection", ("jax",), jax_linalg.polar),
        "jnp.linalg.eigh": Source("of Davenport's matrix, 4 by 4", ("jax",), jax_linalg.eigh),
        "SciPy from_matrix": Source(
            "scipy Rotation.from_matrix, for det A > 0 only", ("scipy",), scipy_rotation.from_matrix, 10_000
        ),
        "SciPy align_vectors": Source(
            "scipy Rotation.align_vectors, one matrix a call", ("scipy",), scipy_rotation.align_vectors, 500
        ),
        "RoMa svd": Source(
            "roma.special_procrustes(method='svd'); its derivative is damped by an absolute 1e-5",
            ("torch", "roma"),
            roma_procrustes.svd,
        ),
        "RoMa horn": Source(
            "roma.special_procrustes(method='horn'), likewise", ("torch", "roma"), roma_procrustes.horn
        ),
        "Warp svd3": Source("warp.svd3 on the CPU; its derivative has absolute thresholds", ("warp",), warp_svd.on_cpu),
        "Warp svd3, CUDA": Source("warp.svd3 on the GPU, likewise", ("warp",), warp_svd.on_cuda),
        "C++ Irving (paper)": Source("Müller et al. 2016, appendix C, with Eigen", (), paper_code.irving),
        "C++ torque (paper)": Source(
            "Müller et al. 2016, appendix D, 20 iterations from Quat(A), with Eigen", (), paper_code.torque
        ),
        "C++ JacobiSVD (Eigen)": Source("Eigen's, with the sign corrected", (), paper_code.jacobi_svd),
    }
)

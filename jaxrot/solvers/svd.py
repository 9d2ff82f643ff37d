"""The singular value decomposition of LAPACK: slow, trusted, the control."""

import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3
from jaxrot.solvers._lapack import finite_only


@finite_only
def solve(a: Mat3) -> Mat3:
    """The nearest rotation U diag(1, 1, det UVᵀ) Vᵀ.

    Source: Kabsch 1976; Sarabandi et al. 2020, eq. (5), which as printed, diag(1, 1, −1), is right for det < 0 alone.
    """
    left, _, right = jnp.linalg.svd(mat3.stack(a), full_matrices=False)
    product = lax.Precision.HIGHEST
    sign = jnp.sign(jnp.linalg.det(jnp.matmul(left, right, precision=product)))
    right = jnp.concatenate([right[..., :2, :], right[..., 2:, :] * sign[..., None, None]], axis=-2)
    return mat3.components(jnp.matmul(left, right, precision=product))

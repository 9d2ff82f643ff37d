"""Cayley's factorisation: each quaternion component from the length of a column."""

import jax
import jax.numpy as jnp

from jaxrot import _mat3, _quaternion
from jaxrot._scaling import safe_sqrt, unit_scaled


def solve(matrix: jax.Array) -> jax.Array:
    """An approximation of the nearest rotation: always a rotation.

    The i-th column of 1 + N(A) has, for a rotation, the length 4|qᵢ|; the signs are those of the longest column.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3) rotations, exact for multiples of a rotation.

    Cost: about 130 flops and five square roots.
    Source: Sarabandi et al. 2020, eq. (31) and Table I; Sarabandi, Pérez-Gracia and Thomas 2019. The scale, which the
    formula takes to be 1, is removed first; sign(0) counts as +1.
    """
    columns = _quaternion.davenport_columns(unit_scaled(_mat3.components(matrix)))
    signs, lengths_squared = _quaternion.longest(columns)
    w, x, y, z = (
        jnp.where(sign < 0, -length, length)
        for sign, length in zip(signs, map(safe_sqrt, lengths_squared), strict=True)
    )
    return _quaternion.to_matrix((w, x, y, z))

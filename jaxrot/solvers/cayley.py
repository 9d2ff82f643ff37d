"""Cayley's factorisation: each quaternion component from the length of a column."""

import jax.numpy as jnp

from jaxrot._algebra import quaternion
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.scaling import safe_sqrt, unit_scaled


def solve(a: Mat3) -> Mat3:
    """An approximation of the nearest rotation: always a rotation.

    For a rotation column i of 1 + N(A) has the length 4|qᵢ|. The signs are those of the longest column.

    Returns:
        Rotations, exact for multiples of a rotation.

    Cost: about 130 flops and five square roots.
    Source: Sarabandi et al. 2020, eq. (31) and Table I; Sarabandi, Pérez-Gracia and Thomas 2019. The formula
    assumes the scale 1; the scale is removed first. sign(0) counts as +1.
    """
    columns = quaternion.davenport_columns(unit_scaled(a))
    signs, lengths_squared = quaternion.longest(columns)
    w, x, y, z = (
        jnp.where(sign < 0, -length, length)
        for sign, length in zip(signs, map(safe_sqrt, lengths_squared), strict=True)
    )
    return quaternion.to_orthonormal((w, x, y, z))

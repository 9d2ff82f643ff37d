"""The average of the four quaternions that a noisy rotation matrix contains, with and without their signs."""

import functools

import jax
import jax.numpy as jnp

from jaxrot._algebra import quaternion
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.quaternion import Columns, Quaternion
from jaxrot._algebra.scaling import unit_scaled
from jaxrot._algebra.select import choose, constant_like, index_of_largest


def solve(a: Mat3) -> Mat3:
    """An approximation of the nearest rotation: always a rotation, by few multiplications.

    For a rotation the columns of 1 + N(A) are multiples of its quaternion. For a noisy one the columns get equal signs
    and are then averaged.

    Returns:
        Rotations, exact for multiples of a rotation.

    Cost: about 150 flops and one square root, for the scale.
    Source: Sarabandi et al. 2020, eq. (27) and (30). They assume unit scale: on exact c·R the mean error is 6.5° at
    c = 1.5, so the scale is removed here. sign(0) counts as +1: it must not drop a column.
    """
    columns = quaternion.davenport_columns(unit_scaled(a))
    index = index_of_largest(tuple(quaternion.squared_norm(column) for column in columns))
    w, x, y, z = (choose(index, *components) for components in zip(*columns, strict=True))
    # One barrier for all signs in one number. A barrier for each sign would take 1.3 times as long.
    products = (quaternion.dot((w, x, y, z), column) for column in columns)
    zero = constant_like(w, 0)
    weights = (jnp.where(product < 0, 2.0**i, zero) for i, product in enumerate(products))
    # The conversion truncates, and an inexact quotient may lie below the integer.
    signs = (fusion_barrier(functools.reduce(jnp.add, weights)) + 0.5).astype(jnp.int32)
    w, x, y, z = (_signed((signs >> i & 1) == 1, column) for i, column in enumerate(columns))
    # The sum is never 0: its product with the longest column is the sum of |u_j·u_i|, and not all columns are 0.
    return quaternion.to_orthonormal(_sum((w, x, y, z)))


def solve_simply(a: Mat3) -> Mat3:
    """The average without the signs: it fails where the components of the quaternion add up to zero.

    For a rotation with the quaternion q the sum of the columns is 4 (w + x + y + z) q. A small bracket loses digits,
    and noise dominates near 0. A bracket of 0 gives NaN.

    Returns:
        Rotations, or NaN.

    Cost: 115 flops and one square root, for the scale.
    Source: Sarabandi et al. 2020, eq. (29), given there as what not to do. The scale is removed as in `solve`.
    """
    return quaternion.to_orthonormal(_sum(quaternion.davenport_columns(unit_scaled(a))))


def _sum(columns: Columns) -> Quaternion:
    return functools.reduce(quaternion.add, columns)


def _signed(negative: jax.Array, q: Quaternion) -> Quaternion:
    w, x, y, z = (jnp.where(negative, -component, component) for component in q)
    return (w, x, y, z)

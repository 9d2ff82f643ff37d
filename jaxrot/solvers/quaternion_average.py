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

    The columns of 1 + N(A) are, for a rotation, multiples of one quaternion; for a noisy one they are averaged after
    their signs have been made alike.

    Returns:
        Rotations, exact for multiples of a rotation.

    Cost: about 150 flops and one square root, for the scale.
    Source: Sarabandi et al. 2020, eq. (27) and (30). They assume unit scale: on exact c·R the mean error is 6.5° at
    c = 1.5, so the scale is removed here. sign(0) counts as +1: it must not drop a column.
    """
    columns = quaternion.davenport_columns(unit_scaled(a))
    index = index_of_largest(tuple(quaternion.squared_norm(column) for column in columns))
    w, x, y, z = (choose(index, *components) for components in zip(*columns, strict=True))
    # All signs in one number, and that computed once: once for the index and for each sign takes 1.3 times as long.
    products = (quaternion.dot((w, x, y, z), column) for column in columns)
    zero = constant_like(w, 0)
    weights = (jnp.where(product < 0, 2.0**i, zero) for i, product in enumerate(products))
    # The conversion truncates, and an inexact quotient may lie below the whole number.
    signs = (fusion_barrier(functools.reduce(jnp.add, weights)) + 0.5).astype(jnp.int32)
    w, x, y, z = (_signed((signs >> i & 1) == 1, column) for i, column in enumerate(columns))
    # Never 0: its product with the longest column is the sum of |u_j·u_i|, and the columns are not all 0.
    return quaternion.to_orthonormal(_sum((w, x, y, z)))


def solve_simply(a: Mat3) -> Mat3:
    """What the average is without the signs: it fails where the components of the quaternion add up to zero.

    For a rotation with the quaternion q the sum of the columns is 4 (w + x + y + z) q: digits are lost as the bracket
    gets small, NaN where it is 0, and noise decides near it.

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

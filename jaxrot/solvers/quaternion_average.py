"""The average of the four quaternions that a noisy rotation matrix contains, with and without their signs."""

import functools

import jax
import jax.numpy as jnp

from jaxrot import _mat3, _quaternion
from jaxrot._choice import choose, computed_once, constant_like, index_of_largest
from jaxrot._quaternion import Columns, Quaternion
from jaxrot._scaling import unit_scaled


def solve(matrix: jax.Array) -> jax.Array:
    """An approximation of the nearest rotation: always a rotation, by few multiplications.

    The columns of 1 + N(A) are, for a rotation, multiples of one quaternion; for a noisy one they are averaged after
    their signs have been made alike.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3) rotations, exact for multiples of a rotation.

    Cost: about 150 flops and one square root, for the scale.
    Source: Sarabandi et al. 2020, eq. (27) and (30). They assume unit scale: on exact c·R the mean error is 6.5° at
    c = 1.5, so the scale is removed here. sign(0) counts as +1: it must not drop a column.
    """
    columns = _quaternion.davenport_columns(unit_scaled(_mat3.components(matrix)))
    index = index_of_largest(tuple(_quaternion.squared_norm(column) for column in columns))
    w, x, y, z = (choose(index, *components) for components in zip(*columns, strict=True))
    # All signs in one number, and that computed once: once for the index and for each sign takes 1.3 times as long.
    products = (_quaternion.dot((w, x, y, z), column) for column in columns)
    zero = constant_like(w, 0)
    weights = (jnp.where(product < 0, 2.0**i, zero) for i, product in enumerate(products))
    # The conversion truncates, and an inexact quotient may lie below the whole number.
    signs = (computed_once(functools.reduce(jnp.add, weights)) + 0.5).astype(jnp.int32)
    w, x, y, z = (_signed((signs >> i & 1) == 1, column) for i, column in enumerate(columns))
    # Never 0: its product with the longest column is the sum of |u_j·u_i|, and the columns are not all 0.
    return _quaternion.to_matrix(_sum((w, x, y, z)))


def solve_simply(matrix: jax.Array) -> jax.Array:
    """What the average is without the signs: it fails where the components of the quaternion add up to zero.

    For a rotation with the quaternion q the sum of the columns is 4 (w + x + y + z) q: digits are lost as the bracket
    gets small, NaN where it is 0, and noise decides near it.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3) rotations, or NaN.

    Cost: 115 flops and one square root, for the scale.
    Source: Sarabandi et al. 2020, eq. (29), given there as what not to do. The scale is removed as in `solve`.
    """
    return _quaternion.to_matrix(_sum(_quaternion.davenport_columns(unit_scaled(_mat3.components(matrix)))))


def _sum(columns: Columns) -> Quaternion:
    return functools.reduce(_quaternion.add, columns)


def _signed(negative: jax.Array, q: Quaternion) -> Quaternion:
    w, x, y, z = (jnp.where(negative, -component, component) for component in q)
    return (w, x, y, z)

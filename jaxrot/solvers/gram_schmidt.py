"""Gram–Schmidt orthogonalisation of the columns."""

import jax
import jax.numpy as jnp

from jaxrot import _mat3
from jaxrot._mat3 import Vec3
from jaxrot._scaling import scaled


def solve(matrix: jax.Array) -> jax.Array:
    """A rotation, not the nearest one: the columns made orthonormal in the order 0, 1, 2.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3) rotations whatever the sign of det A: the last column of A has no influence. NaN where the first
        is zero or the second parallel to it.

    Cost: 54 flops, two square roots, two divisions.
    Source: Müller et al. 2016, section 2; Sarabandi et al. 2020, section I.
    """
    return orthogonalised(matrix, order=(0, 1, 2))


def orthogonalised(matrix: jax.Array, *, order: tuple[int, int, int]) -> jax.Array:
    """The columns made orthonormal in any order; the result depends on it.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.
        order: A static permutation of (0, 1, 2): the first column keeps its direction, the second its plane with the
            first, the last is their vector product.

    Returns:
        (..., 3, 3) rotations.
    """
    a = scaled(_mat3.components(matrix))
    columns = _mat3.transpose(a)
    first = _unit(columns[order[0]])
    second = columns[order[1]]
    overlap = _mat3.dot(first, second)
    second = _unit(_mat3.add_vectors(second, _mat3.scale_vector(first, -overlap)))
    is_even = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    third = _mat3.cross(first, second) if is_even else _mat3.cross(second, first)
    made = (first, second, third)
    x, y, z = (made[order.index(column)] for column in range(3))
    return _mat3.stack(_mat3.transpose((x, y, z)))


def _unit(v: Vec3) -> Vec3:
    return _mat3.scale_vector(v, 1 / jnp.sqrt(_mat3.dot(v, v)))

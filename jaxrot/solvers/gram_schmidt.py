"""Gram–Schmidt orthogonalisation of the columns."""

import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3


def solve(a: Mat3) -> Mat3:
    """A rotation, not the nearest one: the columns made orthonormal in the order 0, 1, 2.

    Returns:
        Rotations for either sign of det A, because the last column of A has no influence. NaN if the first column is
        zero, or if the second is parallel to it.

    Cost: 54 flops, two square roots, two divisions.
    Source: Müller et al. 2016, section 2; Sarabandi et al. 2020, section I.
    """
    return orthogonalised(a, order=(0, 1, 2))


def orthogonalised(a: Mat3, *, order: tuple[int, int, int]) -> Mat3:
    """The columns made orthonormal in any order; the result depends on it.

    Args:
        a: The scaled matrix.
        order: A static permutation of (0, 1, 2): the first column keeps its direction, the second its plane with the
            first, the last is their vector product.

    Returns:
        Rotations.
    """
    columns = mat3.transpose(a)
    first = _unit(columns[order[0]])
    second = columns[order[1]]
    overlap = mat3.dot(first, second)
    second = _unit(mat3.add_vectors(second, mat3.scale_vector(first, -overlap)))
    is_even = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    third = mat3.cross(first, second) if is_even else mat3.cross(second, first)
    made = (first, second, third)
    x, y, z = (made[order.index(column)] for column in range(3))
    return mat3.transpose((x, y, z))


def _unit(v: Vec3) -> Vec3:
    return mat3.scale_vector(v, 1 / jnp.sqrt(mat3.dot(v, v)))

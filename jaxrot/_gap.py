"""How well a matrix determines its nearest rotation."""

import functools

import jax
from jax.typing import ArrayLike

from jaxrot._algebra import mat3
from jaxrot._algebra.scaling import safe_divide
from jaxrot._compiled import compiled
from jaxrot._derivative.overflow import normalising_factor, saturate
from jaxrot._inputs import check_matrix
from jaxrot._svd import decomposed, reciprocal_gaps, tangent_in_axes


def rotation_gap(matrix: ArrayLike) -> jax.Array:
    """The relative gap (s2+s3)/s1 of the nearest rotation: 0 where that is not unique, 2 for a multiple of a rotation.

    It is 1/κ, κ = s1/(s2+s3): an error of ε s1 in A moves R by up to 2 ε κ, both measured by ‖·‖_F.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.

    Returns:
        The gap in [0, 2], shape (...), dtype of `matrix`, to 32 eps. 0 for A = 0; NaN for a matrix with NaN or inf.

    Raises:
        ValueError: Wrong shape.
        TypeError: Complex or non-numeric matrix.

    Uniqueness:
        Unique. Below some 32 eps the gap is rounding, and R one of several nearest rotations.

    Derivative:
        Forward and reverse, to any order, finite for every finite matrix, 0 at A = 0; as for `signed_singular_values`.

    Source: Higham, "Functions of matrices", 2008, theorem 8.9 (the condition of the unitary polar factor of a real
    matrix is 2/(σ₂+σ₃)), with signed singular values.
    """
    return _rotation_gap(check_matrix(matrix))


@compiled
def _rotation_gap(matrix: jax.Array) -> jax.Array:
    return _gap(matrix, 0)


@functools.partial(jax.custom_jvp, nondiff_argnums=(1,))
def _gap(matrix: jax.Array, order: int) -> jax.Array:
    """The gap; `order` counts the derivatives taken, see `overflow.saturate`."""
    _, _, s, _ = decomposed(matrix, order)
    return safe_divide(s[..., 1] + s[..., 2], s[..., 0])


@_gap.defjvp
def _gap_jvp(order: int, primals, tangents):
    (matrix,), (matrix_dot,) = primals, tangents
    gap = _gap(matrix, order + 1)
    left, s, normalised, right = decomposed(matrix, order + 1)
    m = tangent_in_axes(left, matrix_dot, right)
    factor = normalising_factor(mat3.components(matrix))
    norm = reciprocal_gaps(s, normalised, factor, order + 1).norm
    return gap, safe_divide(m[1][1] + m[2][2] - gap * m[0][0], normalised[..., 0]) * saturate(factor, norm, order)

"""The relative gap: how well a matrix determines its nearest rotation."""

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
    """Returns the relative gap (s2+s3)/s1: how well a 3×3 matrix determines its nearest rotation.

    s1 ≥ s2 ≥ |s3| are the signed singular values. The gap is 0 where the nearest rotation is not unique, and 2 for a
    multiple of a rotation. It is 1/κ, where κ = s1/(s2+s3) is the sensitivity of R to A (half its condition number): an
    error of Frobenius norm ε s1 in A changes R by up to 2 ε κ.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.

    Returns:
        The gap in [0, 2], shape (...), dtype of `matrix`. 0 for A = 0, NaN for a matrix with NaN or inf.

    Raises:
        ValueError: Wrong shape.
        TypeError: Complex or non-numeric matrix.

    Uniqueness:
        The gap is unique. A gap below about 32 eps is rounding, and R is one of several nearest rotations.

    Derivative:
        Forward and reverse, to any order, finite for every finite matrix, 0 at A = 0; as for `signed_singular_values`.

    Accuracy:
        32 eps.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> matrices = jnp.stack([jnp.eye(3), jnp.diag(jnp.array([1.0, 1.0, -1.0]))])
        >>> [round(x, 3) for x in jaxrot.rotation_gap(matrices).tolist()]
        [2.0, 0.0]

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

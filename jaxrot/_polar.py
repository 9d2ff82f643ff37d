"""The polar decomposition: the nearest rotation and the stretch."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from jaxrot._algebra import mat3
from jaxrot._algebra.scaling import scaled, unscaled
from jaxrot._compiled import compiled, exportable
from jaxrot._derivative.rule import stretch_tangent
from jaxrot._inputs import check_choice, check_matrix
from jaxrot._nearest import nearest
from jaxrot.solvers import DEFAULT_METHOD, METHODS


@exportable
class PolarDecomposition(NamedTuple):
    """The polar decomposition A = R S.

    Attributes:
        rotation: R, shape (..., 3, 3), det R = +1.
        stretch: S, shape (..., 3, 3), symmetric, with the eigenvalues s1, s2, s3.
    """

    rotation: jax.Array
    stretch: jax.Array


def polar_decomposition(matrix: ArrayLike, *, method: str = DEFAULT_METHOD) -> PolarDecomposition:
    """Returns the polar decomposition A = R S of a 3×3 matrix: the nearest rotation R and the symmetric stretch S.

    R = argmax tr(RᵀA) over the rotations, and S = RᵀA. In textbooks R is a reflection for det A < 0. Here R is a
    rotation, and S then has one negative eigenvalue, the smallest in modulus.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        method: A name in `METHODS`, for R. Static.

    Returns:
        (rotation, stretch). R is that of `nearest_rotation`. S is exactly symmetric, in the unit of A, and inf where it
        exceeds the dtype. A matrix with NaN or inf gives NaN.

    Raises:
        ValueError: Wrong shape, unknown method.
        TypeError: Complex or non-numeric matrix, traced method.

    Uniqueness:
        R is unique iff s2+s3 > 0 for the signed singular values s1 ≥ s2 ≥ |s3|, the eigenvalues of S.
        If s3 ≥ 0, S = √(AᵀA), unique even if R is not. If s3 < 0, S is unique iff R is.

    Derivative:
        R as in `nearest_rotation`, Ṙ = R[ω]×, and Ṡ = RᵀȦ − [ω]× S. To any order, exact at equal singular values. Both
        use the same ω. It is damped to 0 about an axis with a gap sᵢ+sⱼ below about 64 eps tr S. Ṡ does not depend on
        the scale of A, and is at most a few κ = s1/(s2+s3) times Ȧ.

    Accuracy:
        A = R S to 32 eps s1 by the default method, if 32 eps s1 is a normal number.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> A = jnp.diag(jnp.array([3.0, 2.0, -1.0]))
        >>> jaxrot.polar_decomposition(A).stretch.diagonal().round().astype(int).tolist()
        [3, 2, -1]

    Source: Higham 1986; for R see `nearest_rotation`.
    """
    return _polar_decomposition(check_matrix(matrix), method=check_choice(method, "method", METHODS))


@compiled
def _polar_decomposition(matrix: jax.Array, *, method: str) -> PolarDecomposition:
    rotation = nearest(matrix, method, 0.0, 0)
    return PolarDecomposition(rotation, _stretch(matrix, rotation, 0))


@functools.partial(jax.custom_jvp, nondiff_argnums=(2,))
def _stretch(matrix: jax.Array, rotation: jax.Array, order: int) -> jax.Array:
    """S = RᵀA, as a function of A alone: the rule includes R's tangent. `order`: see `stretch_tangent`."""
    m = mat3.components(matrix)
    # The product of the scaled matrix does not overflow. Unscaled, a sum of three products could, even if S does not.
    product = mat3.stack(mat3.transpose_multiply(mat3.components(rotation), scaled(m)))
    # Symmetrise whole arrays: an entry and its mirror image then add the same two stored numbers, so S is exactly
    # symmetric. On components XLA could round the two differently.
    symmetric = 0.5 * (product + jnp.swapaxes(product, -1, -2))
    return mat3.stack(unscaled(mat3.components(symmetric), m))


@_stretch.defjvp
def _stretch_jvp(order: int, primals, tangents):
    (matrix, rotation), (matrix_dot, _) = primals, tangents
    tangent = stretch_tangent(*map(mat3.components, (matrix, rotation, matrix_dot)), order=order)
    return _stretch(matrix, rotation, order + 1), mat3.stack(tangent)

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
    """A = R S.

    Attributes:
        rotation: R, shape (..., 3, 3), det R = +1.
        stretch: S, shape (..., 3, 3), symmetric; with the eigenvalues s1, s2, s3.
    """

    rotation: jax.Array
    stretch: jax.Array


def polar_decomposition(matrix: ArrayLike, *, method: str = DEFAULT_METHOD) -> PolarDecomposition:
    """The rotation R and the symmetric stretch S with A = R S.

    R = argmax tr(RᵀA) over the rotations, S = RᵀA. Unlike that of textbooks R is a rotation for det A < 0 too; S then
    has one negative eigenvalue, the smallest in modulus.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale. float16 and bfloat16 are computed in float32, integers in the
            default floating dtype.
        method: A name in `METHODS`, for R. Static.

    Returns:
        R as from `nearest_rotation`, and S in the unit of A, exactly symmetric; by the default method A = R S to 32 eps
        s1, while that is a normal number. inf where S exceeds the dtype; a matrix with NaN or inf gives NaN.

    Raises:
        ValueError: Wrong shape, unknown method.
        TypeError: Complex or non-numeric matrix, traced method.

    Uniqueness:
        R is unique iff s2+s3 > 0, and so is S. The eigenvalues of S are always unique. Where s3 ≥ 0 S is the square
        root of AᵀA, unique whatever R is.

    Derivative:
        That of the nearest rotation for R, Ṡ = RᵀȦ − [ω]× S for S, to any order. Exact at equal singular values; along
        an axis of R whose gap sᵢ+sⱼ is not resolved ω is damped to 0, in both. Ṡ does not depend on the scale of A, and
        is at most some κ times Ȧ.

    Source: Higham 1986; for R see `nearest_rotation`.
    """
    return _polar_decomposition(check_matrix(matrix), method=check_choice(method, "method", METHODS))


@compiled
def _polar_decomposition(matrix: jax.Array, *, method: str) -> PolarDecomposition:
    rotation = nearest(matrix, method, 0.0, 0)
    return PolarDecomposition(rotation, _stretch(matrix, rotation, 0))


@functools.partial(jax.custom_jvp, nondiff_argnums=(2,))
def _stretch(matrix: jax.Array, rotation: jax.Array, order: int) -> jax.Array:
    """S = RᵀA, a function of A alone: R's tangent is part of the rule. `order`: see `stretch_tangent`."""
    m = mat3.components(matrix)
    # Scaled, a sum of three products does not overflow where S does not.
    product = mat3.stack(mat3.transpose_multiply(mat3.components(rotation), scaled(m)))
    # Of whole arrays: an entry and its mirror image then add the same two stored numbers, and S is exactly symmetric.
    symmetric = 0.5 * (product + jnp.swapaxes(product, -1, -2))
    return mat3.stack(unscaled(mat3.components(symmetric), m))


@_stretch.defjvp
def _stretch_jvp(order: int, primals, tangents):
    (matrix, rotation), (matrix_dot, _) = primals, tangents
    tangent = stretch_tangent(*map(mat3.components, (matrix, rotation, matrix_dot)), order=order)
    return _stretch(matrix, rotation, order + 1), mat3.stack(tangent)

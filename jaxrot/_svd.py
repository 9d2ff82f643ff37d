"""The singular value decomposition with rotations as factors: the last singular value has the sign of det A.

The singular vectors are the eigenvectors of the stretch, by `eigh.eigen`.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from jaxrot._algebra import mat3
from jaxrot._algebra.complex import Complex, multiply, reciprocal, square, times
from jaxrot._algebra.eigh import eigen
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import scaled, unscaled
from jaxrot._compiled import compiled, exportable
from jaxrot._derivative.overflow import apply_scaled, normalising_factor, saturate, split_scale
from jaxrot._derivative.rule import resolved_gap
from jaxrot._inputs import check_matrix
from jaxrot.solvers import DEFAULT_METHOD, METHODS


@exportable
class RotationVariantSVD(NamedTuple):
    """The singular value decomposition A = left · diag(singular_values) · rightᵀ with rotations left and right.

    Attributes:
        left: U, shape (..., 3, 3), det U = +1.
        singular_values: (s1, s2, s3), shape (..., 3), s1 ≥ s2 ≥ |s3|, in the unit of A; s3 has the sign of det A.
        right: V, shape (..., 3, 3), det V = +1.
    """

    left: jax.Array
    singular_values: jax.Array
    right: jax.Array


def rotation_variant_svd(matrix: ArrayLike) -> RotationVariantSVD:
    """Returns the singular value decomposition A = U diag(s1, s2, s3) Vᵀ with rotations U and V.

    U Vᵀ is the nearest rotation, V diag(s) Vᵀ the stretch. s3 has the sign of det A, so U and V stay rotations when a
    finite element inverts.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.

    Returns:
        (left, singular_values, right). s is inf where it exceeds the dtype. A matrix with NaN or inf gives NaN.

    Raises:
        ValueError: Wrong shape.
        TypeError: Complex or non-numeric matrix.

    Uniqueness:
        s is unique. U and V are unique up to the signs of two columns if the |sᵢ| differ. Where two are equal, their
        vectors may turn in a plane. One compiled program returns the same U and V for the same matrix.

    Derivative:
        Forward and reverse, to any order, finite for every finite matrix. ṡᵢ = uᵢᵀ Ȧ vᵢ for the returned U and V.
        U̇ and V̇ divide by sᵢ−sⱼ and sᵢ+sⱼ, and are damped to 0 if these are below about 64 eps (s1+s2+s3). So
        U diag(φ(s)) Vᵀ and V diag(φ(s)) Vᵀ have a wrong derivative at equal and nearly equal singular values: use
        `isotropic_map` or `polar_decomposition`.

    Accuracy:
        A = U diag(s) Vᵀ to 32 eps s1 and s to 16 eps s1, if these are normal numbers. U and V are orthogonal to 10 eps.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> A = jnp.diag(jnp.array([1.0, -3.0, 2.0]))
        >>> jaxrot.rotation_variant_svd(A).singular_values.round().astype(int).tolist()
        [3, 2, -1]

    Source: Müller et al. 2016, section 2, and Irving, Teran and Fedkiw 2004 (the convention).
    """
    return _rotation_variant_svd(check_matrix(matrix))


@compiled
def _rotation_variant_svd(matrix: jax.Array) -> RotationVariantSVD:
    left, singular_values, _, right = decomposed(matrix, 0)
    return RotationVariantSVD(left, singular_values, right)


def signed_singular_values(matrix: ArrayLike) -> jax.Array:
    """Returns the singular values s1 ≥ s2 ≥ |s3| of a 3×3 matrix, with the sign of det A in s3.

    They are those of `rotation_variant_svd`.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.

    Returns:
        s, shape (..., 3), dtype and unit of `matrix`. A matrix with NaN or inf gives NaN.

    Raises:
        ValueError: Wrong shape.
        TypeError: Complex or non-numeric matrix.

    Uniqueness:
        Unique.

    Derivative:
        ṡᵢ = uᵢᵀ Ȧ vᵢ, see `rotation_variant_svd`. The gradient of a symmetric function of s is right. Its Hessian
        exists but is wrong at equal and nearly equal singular values: use `isotropic_energy`.

    Accuracy:
        16 eps s1.

    Cost:
        Under `jit` the program computes U and V only where their derivative needs them.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> A = jnp.diag(jnp.array([1.0, -3.0, 2.0]))
        >>> jaxrot.signed_singular_values(A).round().astype(int).tolist()
        [3, 2, -1]

    Source: as for `rotation_variant_svd`.
    """
    return _signed_singular_values(check_matrix(matrix))


@compiled
def _signed_singular_values(matrix: jax.Array) -> jax.Array:
    return decomposed(matrix, 0)[1]


@functools.partial(jax.custom_jvp, nondiff_argnums=(1,))
def decomposed(matrix: jax.Array, order: int) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Returns U, s, s of the normalised A, and V; `order` counts the derivatives taken, see `overflow.saturate`.

    Derivatives divide by the normalised s. The derivative of the normalised s is saturated, that of s is not.
    """
    m = mat3.components(matrix)
    a = scaled(m)
    rotation = METHODS[DEFAULT_METHOD].solve(a)
    values, axes = eigen(fusion_barrier(mat3.symmetric(mat3.transpose_multiply(rotation, a))))
    right = mat3.newton_schulz(mat3.transpose(axes))
    left = mat3.newton_schulz(mat3.multiply(rotation, right))
    # Restore the order, which rounding may have broken: s2 may be a few eps below |s3|, or negative.
    s2 = jnp.maximum(values[1], jnp.abs(values[2]))
    s = fusion_barrier((jnp.maximum(values[0], s2), s2, values[2]))
    return mat3.stack(left), jnp.stack(unscaled(s, m), axis=-1), jnp.stack(s, axis=-1), mat3.stack(right)


@decomposed.defjvp
def _decomposed_jvp(order: int, primals, tangents):
    (matrix,), (matrix_dot,) = primals, tangents
    left, s, normalised, right = decomposed(matrix, order + 1)
    m = tangent_in_axes(left, matrix_dot, right)
    s_dot = jnp.stack((m[0][0], m[1][1], m[2][2]), axis=-1)

    # notation: U̇ = U [p+w]×/2, V̇ = V [p−w]×/2: w is the angular velocity of U Vᵀ, in the axes V.
    factor = normalising_factor(mat3.components(matrix))
    gaps = reciprocal_gaps(s, normalised, factor, order + 1)
    scale = saturate(factor, gaps.norm, order)
    mirrored = (m[2][1] + m[1][2], m[0][2] + m[2][0], m[1][0] + m[0][1])
    w = apply_scaled(functools.partial(mat3.multiply_entries, gaps.over_sums), mat3.axial(m), scale)
    p = apply_scaled(functools.partial(mat3.multiply_entries, gaps.over_differences), mirrored, scale)
    left_dot = _axes_tangent(left, mat3.scale_vector(mat3.add_vectors(p, w), 0.5))
    right_dot = _axes_tangent(right, mat3.scale_vector(mat3.add_vectors(p, mat3.scale_vector(w, -1.0)), 0.5))
    normalised_dot = s_dot * saturate(factor, gaps.norm, order + 1)[..., None]
    return (left, s, normalised, right), (left_dot, s_dot, normalised_dot, right_dot)


def tangent_in_axes(left: jax.Array, matrix_dot: jax.Array, right: jax.Array) -> Mat3:
    """UᵀȦV on components; its diagonal is ṡ."""
    product = mat3.multiply(mat3.components(matrix_dot), mat3.components(right))
    return mat3.transpose_multiply(mat3.components(left), product)


class ReciprocalGaps(NamedTuple):
    """1/(g+iδ) of the sums and differences g of the normalised singular values.

    Attributes:
        of_sums: Of s2+s3, s3+s1, s1+s2.
        of_differences: Of s2−s3, s3−s1, s1−s2.
        norm: The largest modulus of the six. It has no derivative.
    """

    of_sums: tuple[Complex, ...]
    of_differences: tuple[Complex, ...]
    norm: jax.Array

    @property
    def over_sums(self) -> Vec3:
        """The damped reciprocals of the sums: g/(g²+δ²)."""
        return _real_parts(self.of_sums)

    @property
    def over_differences(self) -> Vec3:
        """The damped reciprocals of the differences."""
        return _real_parts(self.of_differences)


@functools.partial(jax.custom_jvp, nondiff_argnums=(3,))
def reciprocal_gaps(s: jax.Array, normalised: jax.Array, factor: jax.Array, order: int) -> ReciprocalGaps:
    """Returns the reciprocals of the sums and differences of the normalised singular values.

    Args:
        s: The singular values. The derivative uses their tangent, not that of the normalised ones.
        normalised: The singular values of the normalised A, shape (..., 3).
        factor: The power of two that normalises A.
        order: The number of derivatives taken before that of the reciprocals, see `overflow.saturate`.
    """
    sums, differences, total = _sums_and_differences(normalised)
    delta = resolved_gap(total)
    of_sums, of_differences = (tuple(reciprocal((gap, delta)) for gap in gaps) for gaps in (sums, differences))
    norm = jnp.sqrt(functools.reduce(jnp.maximum, (square(x) for x in (*of_sums, *of_differences))))
    return ReciprocalGaps(of_sums, of_differences, norm)


@reciprocal_gaps.defjvp
def _reciprocal_gaps_jvp(order: int, primals, tangents):
    s, normalised, factor = primals
    s_dot, _, _ = tangents
    gaps = reciprocal_gaps(s, normalised, factor, order + 1)
    before, after = split_scale(saturate(factor, gaps.norm, order))
    sums_dot, differences_dot, total_dot = _sums_and_differences(s_dot * before[..., None])
    delta_dot = resolved_gap(jnp.ones_like(total_dot)) * total_dot

    def tangent(inverse: Complex, gap_dot: jax.Array) -> Complex:
        # Apply half of the scale on each side of the product, as in `rule`: reverse mode then meets one half
        # before the square that would overflow.
        return multiply(times(inverse, -after), multiply(inverse, (gap_dot, delta_dot)))

    of_sums, of_differences = (
        tuple(map(tangent, inverses, dots))
        for inverses, dots in ((gaps.of_sums, sums_dot), (gaps.of_differences, differences_dot))
    )
    return gaps, ReciprocalGaps(of_sums, of_differences, jnp.zeros_like(gaps.norm))


def _sums_and_differences(s: jax.Array) -> tuple[Vec3, Vec3, jax.Array]:
    s1, s2, s3 = s[..., 0], s[..., 1], s[..., 2]
    return (s2 + s3, s3 + s1, s1 + s2), (s2 - s3, s3 - s1, s1 - s2), s1 + s2 + s3


def _real_parts(numbers: tuple[Complex, ...]) -> Vec3:
    (x, _), (y, _), (z, _) = numbers
    return x, y, z


def _axes_tangent(axes: jax.Array, angular_velocity: Vec3) -> jax.Array:
    return mat3.stack(mat3.multiply_skew(mat3.components(axes), angular_velocity))

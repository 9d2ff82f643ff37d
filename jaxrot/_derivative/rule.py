"""The one derivative rule of the nearest rotation, whatever algorithm found it.

With S = RᵀA and H = tr(S)·1 − S the tangent is Ṙ = R[ω]×, ω = H⁻¹ vee(RᵀȦ − ȦᵀR): the symmetry of S, differentiated.
The eigenvalues of H are sums of singular values, s1+s2, s1+s3 and s2+s3. So nothing is singular at equal ones. The
derivative of U and V of a singular value decomposition divides by differences instead (jax#2311).

H⁻¹ is always computed as H(H²+δ²)⁻¹ = Re (H+iδ)⁻¹, with δ = 64 eps·tr S, or more by `damping`. It equals H⁻¹ along axes
whose gap is much larger than δ, tends to 0 along an axis whose gap tends to 0, and is at most 1/(2δ) anywhere.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxrot._algebra import mat3
from jaxrot._algebra.complex import add, multiply, reciprocal, square, subtract, times
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._derivative.overflow import apply_scaled, normalising_factor, saturate, split_scale

# The smallest damping δ, in units of eps·tr S: a gap well below it counts as rounding. The relative error of the rule
# is at most 32 eps κ up to κ = 1/(128 eps). There that bound is 0.25, and the damping alone causes 0.2.
_RESOLVED = 64


def rotation_tangent(
    matrix: jax.Array, rotation: jax.Array, matrix_dot: jax.Array, *, damping: float = 0.0, order: int = 0
) -> jax.Array:
    """The tangent Ṙ = R[ω]× of the nearest rotation, for three arrays (..., 3, 3); see `angular_tangent`."""
    r = mat3.components(rotation)
    omega = angular_tangent(mat3.components(matrix), r, mat3.components(matrix_dot), damping=damping, order=order)
    return mat3.stack(mat3.multiply_skew(r, omega))


def angular_tangent(matrix: Mat3, rotation: Mat3, matrix_dot: Mat3, *, damping: float = 0.0, order: int = 0) -> Vec3:
    """The angular velocity ω, in the body frame, of the nearest rotation R of A along Ȧ; linear in Ȧ.

    Args:
        matrix: A, any scale.
        rotation: R, the nearest rotation of A.
        matrix_dot: Ȧ.
        damping: δ/tr S. A value below 64 eps counts as 64 eps.
        order: How many derivatives have been taken before this one. It only decides where saturation begins, see
            `overflow.saturate`.

    Returns:
        ω on components. Finite for every finite A, and its derivatives too.
    """
    torque = mat3.axial(mat3.transpose_multiply(rotation, matrix_dot))
    gaps = _inverse_gaps(matrix, rotation, damping, order + 1)
    return apply_scaled(functools.partial(mat3.apply, gaps.inverse), torque, saturate(gaps.factor, gaps.norm, order))


def stretch_tangent(matrix: Mat3, rotation: Mat3, matrix_dot: Mat3, *, order: int = 0) -> Mat3:
    """The tangent Ṡ = RᵀȦ − [ω]× S of the stretch S = RᵀA; arguments as for `angular_tangent`.

    It does not depend on the scale of A, so that it is right at every scale: ω and S are those of the normalised A.
    """
    along = mat3.transpose_multiply(rotation, matrix_dot)
    gaps = _inverse_gaps(matrix, rotation, 0.0, order + 1)
    omega = mat3.apply(gaps.inverse, mat3.axial(along))
    # −[ω]× S is the transpose of Sᵀ[ω]×, and a transpose does not change the symmetric part.
    return mat3.symmetric(mat3.add(along, mat3.multiply_skew(mat3.transpose(gaps.stretch), omega)))


def inverse_gap_matrix(matrix: Mat3, rotation: Mat3, *, damping: float = 0.0) -> Mat3:
    """H⁻¹ on components, damped and saturated as in `angular_tangent`, whose arguments it takes."""
    gaps = _inverse_gaps(matrix, rotation, damping, 1)
    return mat3.scale(gaps.inverse, saturate(gaps.factor, gaps.norm, 0))


class _InverseGaps(NamedTuple):
    """(H+iδ)⁻¹ = `inverse` − i·`unresolved`, about its norm, and the stretch S, all for the normalised A·`factor`."""

    inverse: Mat3
    unresolved: Mat3
    norm: jax.Array
    stretch: Mat3
    factor: jax.Array


@functools.partial(jax.custom_jvp, nondiff_argnums=(2, 3))
def _inverse_gaps(matrix: Mat3, rotation: Mat3, damping: float, order: int) -> _InverseGaps:
    """Differentiated with respect to A only: its rule includes the tangent of R. `order` is as in `saturate`."""
    factor = normalising_factor(matrix)
    stretch = mat3.transpose_multiply(rotation, mat3.scale(matrix, factor))
    # Without the barrier XLA:CPU computes the stretch again for each entry of the inverse: the reverse mode then takes
    # 1.2 times as long.
    gaps, delta = fusion_barrier((mat3.gap_matrix(stretch), resolved_gap(mat3.trace(stretch), damping)))
    inverse = damped_inverse(gaps, delta)
    return _InverseGaps(*inverse, stretch, factor)


@_inverse_gaps.defjvp
def _inverse_gaps_jvp(damping: float, order: int, primals, tangents):
    (matrix, rotation), (matrix_dot, _) = primals, tangents
    gaps = _inverse_gaps(matrix, rotation, damping, order + 1)
    stretch_dot = stretch_tangent(matrix, rotation, matrix_dot, order=order)
    # Apply half of the scale before the product and half after it. Reverse mode visits the factors in the opposite
    # order; with all of the scale on one side an intermediate value overflows.
    scale = saturate(gaps.factor, gaps.norm, order)
    before, after = split_scale(scale)
    halved_dot = mat3.scale(stretch_dot, before)
    # δ is linear in |tr S|.
    delta_dot = resolved_gap(jnp.ones_like(gaps.norm), damping) * mat3.trace(halved_dot)
    delta_dot = jnp.where(mat3.trace(gaps.stretch) < 0, -delta_dot, delta_dot)

    # notation: with P − iQ for (H+iδ)⁻¹, X + iY = (Ḣ+iδ̇)(P−iQ), and the tangent is −(P−iQ)(X+iY).
    h_dot = mat3.gap_matrix(halved_dot)
    x = mat3.add(mat3.multiply(h_dot, gaps.inverse), mat3.scale(gaps.unresolved, delta_dot))
    y = mat3.subtract(mat3.scale(gaps.inverse, delta_dot), mat3.multiply(h_dot, gaps.unresolved))
    p, q = mat3.scale(gaps.inverse, after), mat3.scale(gaps.unresolved, after)
    tangent = _InverseGaps(
        mat3.symmetric(mat3.scale(mat3.add(mat3.multiply(p, x), mat3.multiply(q, y)), -1.0)),
        mat3.symmetric(mat3.subtract(mat3.multiply(p, y), mat3.multiply(q, x))),
        jnp.zeros_like(gaps.norm),
        mat3.scale(stretch_dot, scale),
        jnp.zeros_like(gaps.factor),
    )
    return gaps, tangent


def damped_inverse(h: Mat3, delta: jax.Array) -> tuple[Mat3, Mat3, jax.Array]:
    """H(H²+δ²)⁻¹ and δ(H²+δ²)⁻¹, the parts of (H+iδ)⁻¹, and about its largest singular value.

    By LDLᵀ of the complex symmetric H+iδ. Its real and imaginary parts are both semidefinite, so no pivoting is
    needed (Higham, "Factorizing complex symmetric matrices with positive definite real and imaginary parts",
    1998). The closed form through the adjugate is shorter and loses eps κ² where two gaps are small (near −R): the
    Jacobian was off by 7e3 eps κ there, with LDLᵀ by a few eps κ.

    Args:
        h: Symmetric, positive semidefinite to rounding.
        delta: Positive.

    Returns:
        The real part and minus the imaginary one, symmetric, and the largest modulus on the diagonal: at least a third
        of the norm.
    """
    (h00, h01, h02), (_, h11, h12), (_, _, h22) = h
    r0 = reciprocal((h00, delta))
    l1, l2 = times(r0, h01), times(r0, h02)
    s12 = (h12 - l1[0] * h02, -l1[1] * h02)
    r1 = reciprocal((h11 - l1[0] * h01, delta - l1[1] * h01))
    l12 = multiply(s12, r1)
    r2 = reciprocal(subtract((h22 - l2[0] * h02, delta - l2[1] * h02), multiply(l12, s12)))

    # notation: the columns of L⁻ᵀ are (1, 0, 0), (−l1, 1, 0), (c, −l12, 1).
    c = subtract(multiply(l1, l12), l2)
    last = multiply(l12, r2)
    m00 = add(r0, add(multiply(l1, multiply(l1, r1)), multiply(c, multiply(c, r2))))
    m01 = add(multiply(l1, r1), multiply(c, last))
    m02, m11 = multiply(c, r2), add(r1, multiply(l12, last))
    largest = jnp.maximum(jnp.maximum(square(m00), square(m11)), square(r2))
    real, imaginary = (
        ((m00[part], -m01[part], m02[part]), (-m01[part], m11[part], -last[part]), (m02[part], -last[part], r2[part]))
        for part in (0, 1)
    )
    return real, mat3.scale(imaginary, -1.0), jnp.sqrt(largest)


def resolved_gap(total: jax.Array, damping: float = 0.0) -> jax.Array:
    """δ: the gap below which an axis is damped, 64 eps·tr S or more; `total`, tr S, lies between s1 and 3 s1.

    Where A = 0 it is 1, so that the rule reads 0/1 there and not 0/0.
    """
    total = jnp.abs(total)
    delta = max(_RESOLVED * float(jnp.finfo(total.dtype).eps), damping) * total
    return jnp.where(total == 0, jnp.ones_like(total), delta)

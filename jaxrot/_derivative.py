"""The one derivative rule of the nearest rotation, whatever algorithm found it.

With S = RᵀA and H = tr(S)·1 − S the tangent is Ṙ = R[ω]×, ω = H⁻¹ vee(RᵀȦ − ȦᵀR): the symmetry of S, differentiated.
H has the eigenvalues s1+s2, s1+s3, s2+s3, sums of singular values and never differences, so that nothing is singular at
equal ones. Differentiating U and V of a singular value decomposition instead divides by differences (jax#2311).

Where s2+s3 is not resolved, H⁻¹ is replaced by H(H²+δ²)⁻¹ = Re (H+iδ)⁻¹ with δ = 64 eps·tr S: equal to H⁻¹ along every
resolved axis, 0 along an axis without a gap, at most 1/(2δ) anywhere.
"""

import functools

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot import _mat3
from jaxrot._complex import add, multiply, reciprocal, square, subtract, times
from jaxrot._mat3 import Mat3, Vec3
from jaxrot._scaling import power_of_two_factor

# The damping that separates an axis from one that rounding made, in units of eps·tr S. With it the rule is within
# 32 eps κ of the exact derivative up to κ = 1/(128 eps), where the damping itself takes 0.2 of the 0.25 allowed.
_RESOLVED = 64


def rotation_tangent(
    matrix: jax.Array, rotation: jax.Array, matrix_dot: jax.Array, *, damping: float = 0.0, order: int = 0
) -> jax.Array:
    """The tangent Ṙ = R[ω]× of the nearest rotation; arguments as for `angular_tangent`, result of A's shape."""
    omega = angular_tangent(matrix, rotation, matrix_dot, damping=damping, order=order)
    return _mat3.stack(_mat3.multiply(_mat3.components(rotation), _mat3.skew(omega)))


def angular_tangent(
    matrix: jax.Array, rotation: jax.Array, matrix_dot: jax.Array, *, damping: float = 0.0, order: int = 0
) -> Vec3:
    """The angular velocity ω, in the body frame, of the nearest rotation R of A along Ȧ; linear in Ȧ.

    Args:
        matrix: A, shape (..., 3, 3), any scale.
        rotation: R, the nearest rotation of A, same shape and dtype.
        matrix_dot: Ȧ, same shape and dtype.
        damping: δ/tr S where that is more than the 64 eps that are always there.
        order: How many derivatives have been taken before this one. It only decides where saturation begins, see
            `_gain`.

    Returns:
        ω on components. Finite for every finite A, and its derivatives too.
    """
    r = _mat3.components(rotation)
    stretch = _mat3.transpose_multiply(r, _mat3.components(_normalised(matrix, rotation, order + 1)))
    factor = _factor(matrix)
    # The factor is applied in two halves, before and after: at once it could overflow or underflow on one side. Both
    # are divisions, because XLA:CPU stores quotients and forms products again in each entry of the result; the
    # transpose, the reverse mode, has them in the other order. With products it took 1.7 times as long.
    first_half = power_of_two_factor(lax.rsqrt(jnp.where(factor > 0, factor, jnp.ones_like(factor))))
    inverse, norm = damped_inverse(_mat3.gap_matrix(stretch), resolved_gap(stretch, damping))
    torque = _divided(_mat3.axial(_mat3.transpose_multiply(r, _mat3.components(matrix_dot))), 1 / first_half)
    return _divided(_mat3.apply(inverse, torque), first_half / _gain(factor, norm, order))


def damped_inverse(h: Mat3, delta: jax.Array) -> tuple[Mat3, jax.Array]:
    """H(H²+δ²)⁻¹ = Re (H+iδ)⁻¹, and about the largest singular value of (H+iδ)⁻¹.

    By LDLᵀ of the complex symmetric H+iδ. Its real and imaginary parts are both semidefinite, so that nothing need be
    exchanged (Higham, "Factorizing complex symmetric matrices with positive definite real and imaginary parts",
    1998). The closed form through the adjugate is shorter and loses eps κ² where two gaps are small (near −R): the
    Jacobian was off by 7e3 eps κ there, with LDLᵀ by a few eps κ.

    Args:
        h: Symmetric, positive semidefinite to rounding.
        delta: Positive.

    Returns:
        The symmetric matrix, and the largest modulus on the diagonal of (H+iδ)⁻¹: at least a third of its norm.
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
    inverse = ((m00[0], -m01[0], m02[0]), (-m01[0], m11[0], -last[0]), (m02[0], -last[0], r2[0]))
    return inverse, jnp.sqrt(largest)


def resolved_gap(stretch: Mat3, damping: float = 0.0) -> jax.Array:
    """δ: the gap below which an axis is damped, 64 eps·tr S or more; tr S lies between s1 and 3 s1.

    Where A = 0 it is 1, so that the rule reads 0/1 there and not 0/0.
    """
    total = jnp.abs(_mat3.trace(stretch))
    delta = max(_RESOLVED * float(jnp.finfo(total.dtype).eps), damping) * total
    return jnp.where(total == 0, jnp.ones_like(total), delta)


def _factor(matrix: jax.Array) -> jax.Array:
    """The power of two that normalises A; 0 where A = 0, which makes every derivative there 0."""
    magnitude = _mat3.largest_entry(_mat3.components(lax.stop_gradient(matrix)))
    return jnp.where(magnitude == 0, jnp.zeros_like(magnitude), power_of_two_factor(magnitude))


@functools.partial(jax.custom_jvp, nondiff_argnums=(2,))
def _normalised(matrix: jax.Array, rotation: jax.Array, order: int) -> jax.Array:
    """A times its power of two; the derivative saturates with the order at which it is taken."""
    return matrix * _factor(matrix)[..., None, None]


@_normalised.defjvp
def _normalised_jvp(order: int, primals, tangents):
    (matrix, rotation), (matrix_dot, _) = primals, tangents
    value = _normalised(matrix, rotation, order + 1)
    stretch = _mat3.transpose_multiply(
        _mat3.components(lax.stop_gradient(rotation)), _mat3.components(lax.stop_gradient(value))
    )
    _, norm = damped_inverse(_mat3.gap_matrix(stretch), resolved_gap(stretch))
    return value, matrix_dot * _gain(_factor(matrix), norm, order)[..., None, None]


def _gain(factor: jax.Array, norm: jax.Array, order: int) -> jax.Array:
    """The factor, saturated so that the derivatives up to this order stay finite where they would overflow.

    The n-th derivative grows like gⁿ, g = factor·‖(H+iδ)⁻¹‖: at |A| = 1e-20 the second one is 1e40. Beyond what the
    dtype holds the product of the factors is held constant, with a margin of 2¹⁰ an order for the number of terms.
    """
    norm = lax.stop_gradient(norm)
    largest = 2.0 ** (jnp.finfo(factor.dtype).maxexp - 3)
    limit = largest * 2.0 ** (-10 * order)
    growth = factor * norm
    lower_orders = 1.0 if order == 0 else jnp.minimum(growth**order, largest * 2.0 ** (-10 * (order - 1)))
    return jnp.where(growth <= limit ** (1 / (order + 1)), factor, limit / lower_orders / norm)


def _divided(v: Vec3, divisor: jax.Array) -> Vec3:
    # The maximum keeps XLA from turning x/(y/z) into (x z)/y, which overflows.
    divisor = jnp.maximum(divisor, float(jnp.finfo(divisor.dtype).tiny))
    return (v[0] / divisor, v[1] / divisor, v[2] / divisor)

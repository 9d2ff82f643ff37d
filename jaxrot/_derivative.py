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
from jaxrot._mat3 import Mat3, Vec3
from jaxrot._scaling import is_positive, power_of_two_factor

# The damping that separates an axis from one that rounding made, in units of eps·tr S. With it the rule is within
# 32 eps κ of the exact derivative up to κ = 1/(128 eps), where the damping itself takes 0.2 of the 0.25 allowed.
_RESOLVED = 64

_Complex = tuple[jax.Array, jax.Array]  # real and imaginary part: the pairs fuse like everything else


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
    # The factor is applied in two halves, before and after: at once it could overflow or underflow on one side.
    first_half = power_of_two_factor(lax.rsqrt(jnp.where(factor > 0, factor, jnp.ones_like(factor))))
    a_dot = _mat3.scale(_mat3.components(matrix_dot), first_half)
    torque = _mat3.axial(_mat3.transpose_multiply(r, a_dot))
    omega, last_pivot = damped_solve(_mat3.gap_matrix(stretch), resolved_gap(stretch, damping), torque)
    return _mat3.scale_vector(omega, _gain(factor, last_pivot, order) / first_half)


def damped_solve(h: Mat3, delta: jax.Array, v: Vec3) -> tuple[Vec3, jax.Array]:
    """H(H²+δ²)⁻¹ v = Re[(H+iδ)⁻¹ v], and the size of the last pivot.

    The factorisation is LDLᵀ of the complex symmetric H+iδ with diagonal pivoting. The closed form through the adjugate
    is shorter and loses eps κ² where two gaps are small (near −R): the Jacobian was off by 7e3 eps κ there, with this
    one by 5.9 eps κ.

    Args:
        h: Symmetric, positive semidefinite to rounding.
        delta: Positive.
        v: The right-hand side.

    Returns:
        The solution and the modulus of the last pivot, within a small factor of the smallest singular value of H+iδ.
    """
    (h00, h01, h02), (_, h11, h12), (_, _, h22) = h
    v0, v1, v2 = v
    # The largest diagonal entry comes first. What is exchanged here is exchanged back, in reverse, at the end.
    first = is_positive(h11 - h00)
    h00, h11 = _exchange(first, h00, h11)
    h02, h12 = _exchange(first, h02, h12)
    v0, v1 = _exchange(first, v0, v1)
    second = is_positive(h22 - h00)
    h00, h22 = _exchange(second, h00, h22)
    h01, h12 = _exchange(second, h01, h12)
    v0, v2 = _exchange(second, v0, v2)

    inverse0 = _reciprocal((h00, delta))
    l1, l2 = _times(inverse0, h01), _times(inverse0, h02)
    s11 = (h11 - l1[0] * h01, delta - l1[1] * h01)
    s12 = (h12 - l1[0] * h02, -l1[1] * h02)
    s22 = (h22 - l2[0] * h02, delta - l2[1] * h02)
    y1 = (v1 - l1[0] * v0, -l1[1] * v0)
    y2 = (v2 - l2[0] * v0, -l2[1] * v0)
    third = is_positive(s22[0] - s11[0])
    s11, s22 = _exchange_complex(third, s11, s22)
    y1, y2 = _exchange_complex(third, y1, y2)
    l1, l2 = _exchange_complex(third, l1, l2)

    l12 = _divide(s12, s11)
    pivot = _subtract(s22, _multiply(l12, s12))
    # Quotients, not products with reciprocals: along an unresolved axis these are rounding, and XLA computes a quotient
    # once for all components of the result, a product again and differently for each.
    x2 = _divide(_subtract(y2, _multiply(l12, y1)), pivot)
    x1 = _divide(_subtract(y1, _multiply(s12, x2)), s11)
    x0 = inverse0[0] * v0 - _multiply(l1, x1)[0] - _multiply(l2, x2)[0]

    x1, x2 = _exchange(third, x1[0], x2[0])
    x0, x2 = _exchange(second, x0, x2)
    x0, x1 = _exchange(first, x0, x1)
    return (x0, x1, x2), jnp.sqrt(pivot[0] * pivot[0] + pivot[1] * pivot[1])


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
    zero = jnp.zeros_like(stretch[0][0])
    _, last_pivot = damped_solve(_mat3.gap_matrix(stretch), resolved_gap(stretch), (zero, zero, zero))
    return value, matrix_dot * _gain(_factor(matrix), last_pivot, order)[..., None, None]


def _gain(factor: jax.Array, last_pivot: jax.Array, order: int) -> jax.Array:
    """The factor, saturated so that the derivatives up to this order stay finite where they would overflow.

    The n-th derivative grows like gⁿ, g = factor / gap: at |A| = 1e-20 the second one is 1e40. Beyond what the dtype
    holds the product of the factors is held constant, with a margin of 2¹⁰ an order for the number of terms.
    """
    last_pivot = lax.stop_gradient(last_pivot)
    largest = 2.0 ** (jnp.finfo(factor.dtype).maxexp - 3)
    limit = largest * 2.0 ** (-10 * order)
    growth = factor / last_pivot
    lower_orders = 1.0 if order == 0 else jnp.minimum(growth**order, largest * 2.0 ** (-10 * (order - 1)))
    return jnp.where(growth <= limit ** (1 / (order + 1)), factor, last_pivot * (limit / lower_orders))


def _exchange(condition: jax.Array, a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    return jnp.where(condition, b, a), jnp.where(condition, a, b)


def _exchange_complex(condition: jax.Array, a: _Complex, b: _Complex) -> tuple[_Complex, _Complex]:
    real_a, real_b = _exchange(condition, a[0], b[0])
    imaginary_a, imaginary_b = _exchange(condition, a[1], b[1])
    return (real_a, imaginary_a), (real_b, imaginary_b)


def _times(a: _Complex, real: jax.Array) -> _Complex:
    return a[0] * real, a[1] * real


def _multiply(a: _Complex, b: _Complex) -> _Complex:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _subtract(a: _Complex, b: _Complex) -> _Complex:
    return a[0] - b[0], a[1] - b[1]


def _divide(a: _Complex, b: _Complex) -> _Complex:
    square = b[0] * b[0] + b[1] * b[1]
    return (a[0] * b[0] + a[1] * b[1]) / square, (a[1] * b[0] - a[0] * b[1]) / square


def _reciprocal(a: _Complex) -> _Complex:
    inverse = 1 / (a[0] * a[0] + a[1] * a[1])
    return a[0] * inverse, -a[1] * inverse

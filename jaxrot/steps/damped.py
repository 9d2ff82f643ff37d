"""A damped solve for any symmetric matrix, shared by `cayley` and `quest`."""

import jax

from jaxrot._algebra.complex import Complex, divide, multiply, reciprocal, subtract, times
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.select import exchange, is_positive


def damped_solve(h: Mat3, delta: jax.Array, v: Vec3) -> Vec3:
    """The solution H(H²+δ²)⁻¹ v, which is the real part of (H+iδ)⁻¹ v.

    The factorisation is LDLᵀ of the complex symmetric H+iδ. It differs from `rule.damped_inverse` in two ways. It
    exchanges rows, because H may be indefinite far from the solution. It divides last: along a free axis the result is
    rounding, and all components must contain the same rounding.

    Args:
        h: Symmetric.
        delta: Positive.
        v: The right-hand side.
    """
    (h00, h01, h02), (_, h11, h12), (_, _, h22) = h
    v0, v1, v2 = v
    # The largest diagonal entry comes first. The exchanges are undone at the end, in reverse order.
    first = is_positive(h11 - h00)
    h00, h11 = exchange(first, h00, h11)
    h02, h12 = exchange(first, h02, h12)
    v0, v1 = exchange(first, v0, v1)
    second = is_positive(h22 - h00)
    h00, h22 = exchange(second, h00, h22)
    h01, h12 = exchange(second, h01, h12)
    v0, v2 = exchange(second, v0, v2)

    inverse0 = reciprocal((h00, delta))
    l1, l2 = times(inverse0, h01), times(inverse0, h02)
    s11 = (h11 - l1[0] * h01, delta - l1[1] * h01)
    s12 = (h12 - l1[0] * h02, -l1[1] * h02)
    s22 = (h22 - l2[0] * h02, delta - l2[1] * h02)
    y1 = (v1 - l1[0] * v0, -l1[1] * v0)
    y2 = (v2 - l2[0] * v0, -l2[1] * v0)
    third = is_positive(s22[0] - s11[0])
    s11, s22 = _exchange_complex(third, s11, s22)
    y1, y2 = _exchange_complex(third, y1, y2)
    l1, l2 = _exchange_complex(third, l1, l2)

    l12 = divide(s12, s11)
    pivot = subtract(s22, multiply(l12, s12))
    # Quotients instead of products with reciprocals. Along an unresolved axis these are rounding. XLA computes a
    # quotient once for all components of the result, and a product again, with other rounding, for each.
    x2 = divide(subtract(y2, multiply(l12, y1)), pivot)
    x1 = divide(subtract(y1, multiply(s12, x2)), s11)
    x0 = inverse0[0] * v0 - multiply(l1, x1)[0] - multiply(l2, x2)[0]

    x1, x2 = exchange(third, x1[0], x2[0])
    x0, x2 = exchange(second, x0, x2)
    x0, x1 = exchange(first, x0, x1)
    return x0, x1, x2


def _exchange_complex(condition: jax.Array, a: Complex, b: Complex) -> tuple[Complex, Complex]:
    real_a, real_b = exchange(condition, a[0], b[0])
    imaginary_a, imaginary_b = exchange(condition, a[1], b[1])
    return (real_a, imaginary_a), (real_b, imaginary_b)

"""The Taylor polynomial of A (AᵀA)^(−1/2) at a rotation, once or iterated."""

import jax
from jax import lax

from jaxrot import _mat3
from jaxrot._mat3 import Mat3
from jaxrot._scaling import unit_scaled

_ITERATIONS = {"float32": 9, "float64": 10}


def solve(matrix: jax.Array) -> jax.Array:
    """An approximation of the nearest rotation of a matrix that is nearly a rotation: A (3 C² − 10 C + 15)/8, C = AᵀA.

    Every singular value x becomes x (3x⁴ − 10x² + 15)/8 = 1 + O((x − 1)³), so the result is a rotation to third order
    in the noise, and no rotation far from one.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3), exact for multiples of a rotation. For det A < 0 it is nearer to a reflection.

    Cost: 220 flops and one square root, for the scale.
    Source: Sarabandi et al. 2020, eq. (20). The scale, which it takes to be 1, is removed first.
    """
    return _mat3.stack(polynomial(unit_scaled(_mat3.components(matrix))))


def solve_iterated(matrix: jax.Array) -> jax.Array:
    """The nearest rotation of a matrix with det A > 0, by the iterated polynomial: no square root but the scale's.

    It converges, to third order, where every singular value is below √(7/3); ‖A‖ = √2 makes sure of that. A small one
    grows by 15/8 a step. For det A < 0 the limit is the nearest *reflection*; a singular value 0 stays 0.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3), rotations as far as the fixed number of steps reaches, s1/s3 of about 50.

    Cost: 175 flops a step, 9 steps in float32 and 10 in float64.
    Source: Hasan, "Square-root free orthogonalization algorithms", 2009, in Sarabandi et al. 2020 after eq. (20).
    """
    a = unit_scaled(_mat3.components(matrix))
    a = _mat3.scale(a, (2 / 3) ** 0.5)
    return _mat3.stack(lax.fori_loop(0, _ITERATIONS[matrix.dtype.name], lambda _, r: polynomial(r), a))


def polynomial(r: Mat3) -> Mat3:
    """R (3 C² − 10 C + 15)/8, C = RᵀR, through E = C − 1: R (1 − E/2 + 3 E²/8), which keeps the digits of a small E."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = _mat3.transpose_multiply(r, r)
    error = ((xx - 1, xy, xz), (xy, yy - 1, yz), (xz, yz, zz - 1))
    correction = _mat3.add(_mat3.scale(error, -0.5), _mat3.scale(_mat3.multiply(error, error), 0.375))
    return _mat3.add(r, _mat3.multiply(r, correction))

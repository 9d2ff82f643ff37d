"""The Taylor polynomial of A (AᵀA)^(−1/2) at a rotation, once or iterated."""

from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.scaling import unit_scaled

_ITERATIONS = {"float32": 9, "float64": 10}


def solve(a: Mat3) -> Mat3:
    """An approximation of the nearest rotation of a matrix that is nearly a rotation: A (3 C² − 10 C + 15)/8, C = AᵀA.

    A singular value x becomes x (3x⁴ − 10x² + 15)/8 = 1 + O((x − 1)³). So the result is a rotation up to third order in
    the noise. Far from a rotation the result is not a rotation.

    Returns:
        Matrices, exact for multiples of a rotation. For det A < 0 the result is nearer to a reflection.

    Cost: 220 flops and one square root, for the scale.
    Source: Sarabandi et al. 2020, eq. (20). It assumes the scale 1; the scale is removed first.
    """
    return polynomial(unit_scaled(a))


def solve_iterated(a: Mat3) -> Mat3:
    """The nearest rotation of a matrix with det A > 0, by the iterated polynomial. Only the scale needs a root.

    It converges to third order if every singular value is below √(7/3), which ‖A‖ = √2 ensures. A small singular value
    grows by 15/8 per step. For det A < 0 the limit is the nearest *reflection*. A singular value 0 stays 0.

    Returns:
        Rotations up to s1/s3 of about 50. Beyond that the fixed number of steps is too small.

    Cost: 175 flops a step, 9 steps in float32 and 10 in float64.
    Source: Hasan, "Square-root free orthogonalization algorithms", 2009, in Sarabandi et al. 2020 after eq. (20).
    """
    a = unit_scaled(a)
    a = mat3.scale(a, (2 / 3) ** 0.5)
    return lax.fori_loop(0, _ITERATIONS[a[0][0].dtype.name], lambda _, r: polynomial(r), a)


def polynomial(r: Mat3) -> Mat3:
    """R (3 C² − 10 C + 15)/8, C = RᵀR, through E = C − 1: R (1 − E/2 + 3 E²/8), which keeps the digits of a small E."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = mat3.transpose_multiply(r, r)
    error = ((xx - 1, xy, xz), (xy, yy - 1, yz), (xz, yz, zz - 1))
    correction = mat3.add(mat3.scale(error, -0.5), mat3.scale(mat3.multiply(error, error), 0.375))
    return mat3.add(r, mat3.multiply(r, correction))

"""The nearest rotation of a matrix, from a cold start."""

import functools
from collections.abc import Callable

import jax
from jax.typing import ArrayLike

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.scaling import scaled
from jaxrot._compiled import compiled
from jaxrot._derivative.rule import rotation_tangent
from jaxrot._inputs import check_choice, check_damping, check_matrix
from jaxrot.solvers import DEFAULT_METHOD, METHODS


def nearest_rotation(matrix: ArrayLike, *, method: str = DEFAULT_METHOD, damping: float = 0.0) -> jax.Array:
    """The rotation nearest to a 3×3 matrix.

    R = argmin ‖A − R‖_F = argmax tr(RᵀA) over the rotations, det R = +1, whatever the sign of det A; R(cA) = R(A) for
    c > 0. It is the rotational part of the polar decomposition, the solution of Wahba's problem and of Kabsch's.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale. float16 and bfloat16 are computed in float32, integers in the
            default floating dtype, float64 in float32 unless JAX's 64-bit types are on. Entries below the smallest
            normal number count as 0.
        method: A name in `METHODS`, whose record states the method's domain. The default keeps the accuracy below for
            every finite matrix.
        damping: Relative damping δ/tr(RᵀA) ≥ 0 of the derivative, for learning: it bounds the norm of the derivative
            by 1/δ. The value is not touched. Static.

    Returns:
        R, shape (..., 3, 3), dtype of `matrix`. With κ = s1/(s2+s3) and eps of the computing dtype the default method's
        error is at most 8 eps (1+κ), ‖RᵀR − 1‖_F at most 10 eps. A matrix with NaN or inf gives NaN, its neighbours
        are untouched.

    Raises:
        ValueError: Wrong shape, unknown method, negative damping.
        TypeError: Complex or non-numeric matrix, traced method or damping, float64 on a TPU.

    Uniqueness:
        R is unique iff s2+s3 > 0 for the signed singular values s1 ≥ s2 ≥ |s3|: rank 2 and inverted matrices are fine.
        Elsewhere R is one of the rotations with the largest tr(RᵀA). The same compiled program returns the same one
        wherever the matrix stands in the batch; another program (eager, another batch size) may return another.

    Derivative:
        Forward and reverse, to any order, by one rule for every method: the derivative of the nearest rotation at the
        returned R. For an approximate method (`METHODS[method].exact` is False) that is not the derivative of its
        formula. Exact at equal singular values; along an axis whose gap sᵢ+sⱼ is below about 64 eps·tr(RᵀA) it tends
        to 0. It is finite for every finite matrix, in both modes and one of the other: where the dtype does not hold
        it, it is saturated.

    Source: Müller et al. 2016, section 3 (the problem); `METHODS[method].source` (the algorithm).
    """
    method = check_choice(method, "method", METHODS)
    return _nearest_rotation(check_matrix(matrix), method=method, damping=check_damping(damping))


def nearest_quaternion_wxyz(matrix: ArrayLike, *, method: str = DEFAULT_METHOD, damping: float = 0.0) -> jax.Array:
    """The unit quaternion (w, x, y, z), w ≥ 0, of the rotation nearest to a 3×3 matrix.

    q = argmax tr(R(q)ᵀA); everything said of `nearest_rotation` holds.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        method: A name in `METHODS`.
        damping: Relative damping of the derivative, static.

    Returns:
        q, shape (..., 4), dtype of `matrix`.

    Raises:
        ValueError: Wrong shape, unknown method, negative damping.
        TypeError: Complex or non-numeric matrix, traced method or damping, float64 on a TPU.

    Uniqueness:
        q and −q are one rotation; w ≥ 0 chooses. At a half turn, w = 0, the sign is the one that makes the largest
        component positive, and it jumps there.

    Derivative:
        That of `nearest_rotation`; on the side of the jump that was returned.

    Source: Shepperd 1978, for the conversion.
    """
    method = check_choice(method, "method", METHODS)
    return _nearest_quaternion(check_matrix(matrix), method=method, damping=check_damping(damping))


@compiled
def _nearest_rotation(matrix: jax.Array, *, method: str, damping: float) -> jax.Array:
    return nearest(matrix, method, damping, 0)


@compiled
def _nearest_quaternion(matrix: jax.Array, *, method: str, damping: float) -> jax.Array:
    rotation = nearest(matrix, method, damping, 0)
    return quaternion.stack(quaternion.from_rotation(mat3.components(rotation)))


@functools.partial(jax.custom_jvp, nondiff_argnums=(1, 2, 3))
def nearest(matrix: jax.Array, method: str, damping: float, order: int) -> jax.Array:
    """The solver, without its own derivative; `order` counts the derivatives taken, see `overflow.saturate`."""
    return solved(METHODS[method].solve, matrix)


def solved(solve: Callable[[Mat3], Mat3], matrix: jax.Array) -> jax.Array:
    """What a solver makes of matrices (..., 3, 3) of any scale."""
    return mat3.stack(solve(scaled(mat3.components(matrix))))


@nearest.defjvp
def _nearest_jvp(method: str, damping: float, order: int, primals, tangents):
    (matrix,), (matrix_dot,) = primals, tangents
    # The decorated function, not the solver: or the second derivative would differentiate the algorithm.
    rotation = nearest(matrix, method, damping, order + 1)
    return rotation, rotation_tangent(matrix, rotation, matrix_dot, damping=damping, order=order)

"""The nearest rotation of a matrix from a cold start: without a previous rotation."""

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
    """Returns the rotation nearest to a 3×3 matrix (Kabsch, Wahba, orthogonal Procrustes, polar decomposition).

    R = argmin ‖A − R‖_F = argmax tr(RᵀA) over the rotations, det R = +1, for either sign of det A.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale. Half precision is computed in float32, integers in the default
            floating dtype, float64 in float32 unless x64 is on. Subnormal entries count as 0.
        method: A name in `METHODS`. Static.
        damping: d ≥ 0. Bounds the norm of the derivative by 1/(d·tr(RᵀA)); R does not change. Static.

    Returns:
        R, shape (..., 3, 3), dtype of `matrix`. NaN for a matrix with NaN or inf; the others are not affected.

    Raises:
        ValueError: Wrong shape, unknown method, negative damping.
        TypeError: Complex or non-numeric matrix, traced method or damping, float64 on a TPU.

    Uniqueness:
        R is unique iff s2+s3 > 0 for the signed singular values s1 ≥ s2 ≥ |s3|. Elsewhere R is one maximiser of
        tr(RᵀA), always the same in one compiled program; another program may return another.

    Derivative:
        One rule for all methods, forward and reverse, to any order. Exact at equal singular values. Finite for
        every finite matrix: 0 in the limit of a gap sᵢ+sⱼ below about 64 eps·tr(RᵀA), and large instead of overflowing.

    Accuracy:
        Default method, κ = s1/(s2+s3) < 1/(8 eps), eps of the computing dtype: ‖R − R*‖_F is at most 8 eps (1+κ) for
        the exact R*, ‖RᵀR − 1‖_F at most 10 eps.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> A = jnp.array([[0.0, -2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.5]])
        >>> jaxrot.nearest_rotation(A).round().astype(int).tolist()
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]]

    Source: Müller et al. 2016, section 3 (the problem); `METHODS[method].source` (the algorithm).
    """
    method = check_choice(method, "method", METHODS)
    return _nearest_rotation(check_matrix(matrix), method=method, damping=check_damping(damping))


def nearest_quaternion_wxyz(matrix: ArrayLike, *, method: str = DEFAULT_METHOD, damping: float = 0.0) -> jax.Array:
    """Returns the unit quaternion (w, x, y, z), w ≥ 0, of the rotation nearest to a 3×3 matrix.

    q = argmax tr(R(q)ᵀA). Accuracy and limits are those of `nearest_rotation`.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        method: A name in `METHODS`. Static.
        damping: Relative damping of the derivative. Static.

    Returns:
        q, shape (..., 4), dtype of `matrix`.

    Raises:
        ValueError: Wrong shape, unknown method, negative damping.
        TypeError: Complex or non-numeric matrix, traced method or damping, float64 on a TPU.

    Uniqueness:
        q and −q are the same rotation; the sign with w ≥ 0 is returned. At a half turn w is 0. There the component of
        largest modulus is positive, and q jumps.

    Derivative:
        As for `nearest_rotation`. At a half turn it is that of the returned side of the jump.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> A = jnp.array([[0.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
        >>> [round(x, 3) for x in jaxrot.nearest_quaternion_wxyz(A).tolist()]
        [0.5, 0.5, 0.5, 0.5]

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
    """Runs the solver, which has no derivative rule; `order` counts the derivatives taken, see `overflow.saturate`."""
    return solved(METHODS[method].solve, matrix)


def solved(solve: Callable[[Mat3], Mat3], matrix: jax.Array) -> jax.Array:
    """Returns what a solver computes from matrices (..., 3, 3) of any scale."""
    return mat3.stack(solve(scaled(mat3.components(matrix))))


@nearest.defjvp
def _nearest_jvp(method: str, damping: float, order: int, primals, tangents):
    (matrix,), (matrix_dot,) = primals, tangents
    # Call the decorated function: if this called the solver, the second derivative would differentiate the algorithm.
    rotation = nearest(matrix, method, damping, order + 1)
    return rotation, rotation_tangent(matrix, rotation, matrix_dot, damping=damping, order=order)

"""The nearest rotation of a matrix from a warm start, by a fixed number of steps."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import nonzero_sqrt, scaled
from jaxrot._compiled import compiled
from jaxrot._derivative.rule import angular_tangent
from jaxrot._inputs import check_choice, check_flag, check_iterations, check_matrix, check_start
from jaxrot.steps import STEPS
from jaxrot.steps.escape import leave_equilibrium
from jaxrot.steps.iteration import iterate

# The values of `derivative`, and what each differentiates. At convergence both agree, as fast as the step converges.
#
# "implicit" assumes the limit, which does not depend on the start. It costs one small solve for any number of
# iterations. If the iteration stops early it is not the derivative of the result.
#
# "unrolled" is right wherever the iteration stops, for example in a simulation that is differentiated through its warm
# starts. Unlike the rule it is not saturated: it overflows at the ends of the dtype's range. For `torque` it also
# overflows if tr(RᵀA) is 0 up to rounding.
_DERIVATIVES = {"implicit": "the nearest rotation, by its rule", "unrolled": "the iterations that are run"}


def refine_rotation(
    matrix: ArrayLike,
    rotation: ArrayLike,
    *,
    step: str = "newton",
    iterations: int = 2,
    escape: bool = False,
    derivative: str = "implicit",
) -> jax.Array:
    """Returns a rotation closer to the one nearest to a 3×3 matrix, by a fixed number of steps from a warm start.

    In a simulation start from the last rotation.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        rotation: The start, shape (..., 3, 3), times any positive factor. The batch axes broadcast.
        step: A name in `STEPS`. Static.
        iterations: Number of steps, ≥ 0. Static.
        escape: Leave a start that is not nearest but that no step moves. Static.
        derivative: `"implicit"` or `"unrolled"`. Static.

    Returns:
        A rotation, shape (..., 3, 3), dtype of `matrix`: valid as a carry of `lax.scan`.

    Raises:
        ValueError: Wrong shape, unknown step or derivative, negative iterations.
        TypeError: Complex or non-numeric arrays, traced options.

    Uniqueness:
        The start decides what A leaves undetermined: everything for A = 0, the angle about the free axis for rank 1
        (with `quest` to √eps). A start Q exactly half a turn off has zero torque, QᵀA = AᵀQ, and is returned
        unless `escape` is on.

    Derivative:
        `"implicit"`: that of `nearest_rotation`, and 0 with respect to the start. Right at convergence, to any order.
        `"unrolled"`: that of the steps, with respect to both. Right before convergence too; may overflow.

    Accuracy:
        `newton` converges cubically from any start with torque, `cayley` from within 90°. `torque` and
        `torque_exact_angle` converge linearly. `quest` needs one step, except near a half turn.

    Cost:
        `escape` costs about one step. Unrolled reverse mode takes time and memory for every step.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> A = jnp.array([[0.0, -2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.5]])
        >>> jaxrot.refine_rotation(A, jnp.eye(3), iterations=5).round().astype(int).tolist()
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]]

    Source: `STEPS[step].source`.
    """
    checked = check_matrix(matrix)
    start = check_start(rotation, "rotation", (3, 3), checked)
    return _refine_rotation(checked, start, options=_checked_options(step, iterations, escape, derivative))


def refine_quaternion_wxyz(
    matrix: ArrayLike,
    quaternion_wxyz: ArrayLike,
    *,
    step: str = "newton",
    iterations: int = 2,
    escape: bool = False,
    derivative: str = "implicit",
) -> jax.Array:
    """Returns a unit quaternion (w, x, y, z) nearer to the nearest rotation of a 3×3 matrix, from a warm start.

    The steps and their convergence are those of `refine_rotation`.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        quaternion_wxyz: The start, shape (..., 4), any length but 0. The batch axes broadcast.
        step: A name in `STEPS`. Static.
        iterations: Number of steps, ≥ 0. Static.
        escape: Leave a start that no step would move although it is not nearest. Static.
        derivative: `"implicit"` or `"unrolled"`. Static.

    Returns:
        A unit quaternion, shape (..., 4) of the broadcast batch, dtype of `matrix`. Its sign continues that of the
        start. So it does not jump from frame to frame, and w may be negative.

    Raises:
        ValueError: Wrong shape, unknown step or derivative, negative iterations.
        TypeError: Complex or non-numeric arrays, traced step, iterations, escape or derivative.

    Uniqueness:
        As for `refine_rotation`. Where `escape` turns the start, the sign is arbitrary.

    Derivative:
        As for `refine_rotation`.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> A = jnp.array([[0.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
        >>> start = jnp.array([-0.6, -0.5, -0.5, -0.4])
        >>> [round(x, 3) for x in jaxrot.refine_quaternion_wxyz(A, start, iterations=4).tolist()]
        [-0.5, -0.5, -0.5, -0.5]

    Source: Müller et al. 2016, appendix D.
    """
    checked = check_matrix(matrix)
    start = check_start(quaternion_wxyz, "quaternion_wxyz", (4,), checked)
    return _refine_quaternion(checked, start, options=_checked_options(step, iterations, escape, derivative))


class _Options(NamedTuple):
    step: str
    iterations: int
    escape: bool
    derivative: str


def _checked_options(step: str, iterations: int, escape: bool, derivative: str) -> _Options:
    return _Options(
        step=check_choice(step, "step", STEPS),
        iterations=check_iterations(iterations),
        escape=check_flag(escape, "escape"),
        derivative=check_choice(derivative, "derivative", _DERIVATIVES),
    )


@compiled
def _refine_rotation(matrix: jax.Array, rotation: jax.Array, *, options: _Options) -> jax.Array:
    start = scaled(mat3.components(rotation))
    # The shift is the scale c of the start c·Q, at least 2 after scaling. With a fixed shift the columns would be
    # multiples of Q's quaternion at one scale only. A start of zeros has the shift 1 and becomes the identity.
    columns = quaternion.davenport_columns(start, nonzero_sqrt(mat3.squared_norm(start) / 3, smallest=1.0))
    # The sign of this quaternion does not matter. The start is the quaternion of its largest column. So a
    # tangent of the start that leaves the rotations has a derivative too, but no meaning.
    return mat3.stack(quaternion.to_orthonormal(_refine(matrix, quaternion.largest_column(columns), options)))


@compiled
def _refine_quaternion(matrix: jax.Array, quaternion_wxyz: jax.Array, *, options: _Options) -> jax.Array:
    return quaternion.stack(_refine(matrix, scaled(quaternion.components(quaternion_wxyz)), options))


def _refine(matrix: jax.Array, start: Quaternion, options: _Options) -> Quaternion:
    step, iterations, escape, derivative = options
    wxyz = quaternion.stack(quaternion.normalise(start))
    batch = jnp.broadcast_shapes(matrix.shape[:-2], wxyz.shape[:-1])
    matrix, wxyz = jnp.broadcast_to(matrix, (*batch, 3, 3)), jnp.broadcast_to(wxyz, (*batch, 4))
    if derivative == "unrolled":
        refined = _iterated(matrix, wxyz, step, iterations, escape)
    else:
        refined = _refined(matrix, wxyz, step, iterations, escape, 0)
    return quaternion.components(refined)


def _iterated(matrix: jax.Array, wxyz: jax.Array, step: str, iterations: int, escape: bool) -> jax.Array:
    a = scaled(mat3.components(matrix))
    # A loop needs a carry that is sharded like its result. Adding a 0 from the matrix gives the start that sharding.
    zero = a[0][0] * 0
    w, x, y, z = quaternion.components(wxyz)
    q = (w + zero, x + zero, y + zero, z + zero)
    if escape:
        q = leave_equilibrium(a, q)
    # Without a unit quaternion at both ends XLA:CPU of jax 0.12 rounds the matrices of a batch of two differently.
    return quaternion.stack(quaternion.renormalise(iterate(STEPS[step].correction, a, q, iterations)))


@functools.partial(jax.custom_jvp, nondiff_argnums=(2, 3, 4, 5))
def _refined(matrix: jax.Array, wxyz: jax.Array, step: str, iterations: int, escape: bool, order: int) -> jax.Array:
    """Runs the iteration; its derivative is the rule. `order` counts the derivatives taken, see `overflow.saturate`."""
    return _iterated(matrix, wxyz, step, iterations, escape)


@_refined.defjvp
def _refined_jvp(step: str, iterations: int, escape: bool, order: int, primals, tangents):
    (matrix, wxyz), (matrix_dot, _) = primals, tangents
    refined = _refined(matrix, wxyz, step, iterations, escape, order + 1)
    q = quaternion.components(refined)
    rotation = quaternion.to_rotation(q)
    x, y, z = angular_tangent(mat3.components(matrix), rotation, mat3.components(matrix_dot), order=order)
    zero = x - x
    return refined, 0.5 * quaternion.stack(quaternion.product(q, (zero, x, y, z)))

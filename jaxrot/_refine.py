"""The nearest rotation from a warm start, by a fixed number of steps."""

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

# What `derivative` may be, and what is then differentiated.
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
    """Moves a rotation towards the one nearest to a 3×3 matrix, by a fixed number of steps.

    Each step increases tr(RᵀA) towards its maximum over the rotations. Made for simulations: the rotation of the last
    frame is the start, few iterations are enough, and what A leaves undetermined is kept from the start (all of it for
    A = 0, the angle about the axis for rank 1).

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        rotation: The start, shape (..., 3, 3), times any factor but 0; its batch axes broadcast against those of
            `matrix`.
        step: A name in `STEPS`. The paper's `torque` is enough where the singular values are of one size and the
            rotation changes little; a rod that turns by 5° a frame it follows 6 to 13° late, or not at all. Static.
        iterations: How many steps, ≥ 0. Static.
        escape: Leave a start that is an equilibrium without being nearest, before the first step. Static; it costs
            about one step more, and nothing when it is off.
        derivative: `"implicit"` or `"unrolled"`, see below. Static.

    Returns:
        A rotation, shape (..., 3, 3) of the broadcast batch, dtype of `matrix`: valid as a carry of `lax.scan`.

    Convergence:
        `torque`: linear, the error shrinks by max|sᵢ| / |Σsᵢ| a step. `torque_exact_angle`: linear, about half the
        steps, and one for a multiple of a rotation; the trace never gets smaller. `newton`: cubic, from any start, the
        trace never gets smaller. `cayley`: cubic, from within 90°. `quest`: exact in one step but near a half turn, as
        far as the sum of the singular values is.

        Shares *outside* the error 8 eps (1+κ), κ = s1/(s2+s3), of 170,000 matrices (`cayley`, `quest`: 20,000) of each
        population, Gaussian, κ log-uniform, s2 and s3 log-uniform; the worst of them, float32 and float64. `newton`:
        from 45° off after 5 steps none for κ < 10, 0.05 % for κ < 1e3; from uniformly random starts after 8 steps one
        matrix for κ < 1e3, after 16 with `escape` none. `cayley`: from 45° off after 5 steps none for κ < 10, 2.7 % for
        κ < 1e3. `quest`: none for κ < 10, 0.3 % in float32 and none in float64 for κ < 1e3. The linear steps need tens.

    Raises:
        ValueError: Wrong shape, unknown step or derivative, negative iterations.
        TypeError: Complex or non-numeric arrays, traced step, iterations, escape or derivative.

    Uniqueness:
        From a start where the torque is zero but tr(RᵀA) is not largest (an exact half turn off) every step stands
        still, unless `escape` is on. At A = 0 the start is kept, at rank 1 its angle about the free axis (with
        `quest` to √eps).

    Derivative:
        `"implicit"`: the rule of `nearest_rotation`, at the rotation that was reached, and zero with respect to the
        start, on which the limit does not depend. It is right at convergence, costs one small solve whatever the number
        of iterations, and has any order. Where the iteration stops early it is not the derivative of the result.

        `"unrolled"`: the derivative of what was computed, with respect to the matrix and to the start, in forward and
        reverse mode. It is right wherever the iteration stops, for a simulation that is itself differentiated through
        its warm starts for example; memory and time in reverse mode grow with the iterations. At convergence both
        agree, as fast as the step converges. It is not saturated as the rule is: at the ends of the dtype's range it
        overflows, and that of `torque` where tr(RᵀA) is 0 to the last digit. The start counts as the quaternion of its
        largest column: a change of a matrix that leaves the rotations has a derivative too, and no meaning.

    Source: `STEPS[step].source`; for `torque` with the errata stated in `steps/torque.py`.
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
    """Moves a quaternion (w, x, y, z) towards the rotation nearest to a 3×3 matrix; see `refine_rotation`.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        quaternion_wxyz: The start, shape (..., 4), any length but 0; its batch axes broadcast against
            those of `matrix`.
        step: A name in `STEPS`. Static.
        iterations: How many steps, ≥ 0. Static.
        escape: Leave an equilibrium that is not nearest, before the first step; the sign of a start that is turned is
            free. Static.
        derivative: `"implicit"` or `"unrolled"`. Static.

    Returns:
        A unit quaternion, shape (..., 4) of the broadcast batch, dtype of `matrix`. Its sign continues that of the
        start: it does not jump from frame to frame, and w may be negative.

    Raises:
        ValueError: Wrong shape, unknown step or derivative, negative iterations.
        TypeError: Complex or non-numeric arrays, traced step, iterations, escape or derivative.

    Uniqueness:
        As for `refine_rotation`.

    Derivative:
        As for `refine_rotation`.

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
    # The shift is the scale c of the start c·Q, at least 2 after scaling. With another shift the columns are multiples
    # of Q's quaternion at one scale only. A start of zeros has the shift 1 and becomes the identity.
    columns = quaternion.davenport_columns(start, nonzero_sqrt(mat3.squared_norm(start) / 3, smallest=1.0))
    # Neither the length of this quaternion nor its sign matters.
    return mat3.stack(quaternion.to_orthonormal(_refine(matrix, quaternion.largest_column(columns), options)))


@compiled
def _refine_quaternion(matrix: jax.Array, quaternion_wxyz: jax.Array, *, options: _Options) -> jax.Array:
    start = quaternion.normalise(scaled(quaternion.components(quaternion_wxyz)))
    return quaternion.stack(quaternion.renormalise(_refine(matrix, start, options)))


def _refine(matrix: jax.Array, start: Quaternion, options: _Options) -> Quaternion:
    step, iterations, escape, derivative = options
    wxyz = quaternion.stack(start)
    batch = jnp.broadcast_shapes(matrix.shape[:-2], wxyz.shape[:-1])
    matrix, wxyz = jnp.broadcast_to(matrix, (*batch, 3, 3)), jnp.broadcast_to(wxyz, (*batch, 4))
    if derivative == "unrolled":
        refined = _iterated(matrix, wxyz, step, iterations, escape)
    else:
        refined = _refined(matrix, wxyz, step, iterations, escape, 0)
    return quaternion.components(refined)


def _iterated(matrix: jax.Array, wxyz: jax.Array, step: str, iterations: int, escape: bool) -> jax.Array:
    a = scaled(mat3.components(matrix))
    # A loop's carry must be sharded as its result is, so a start that is not has to take it from the matrix.
    zero = a[0][0] * 0
    w, x, y, z = quaternion.components(wxyz)
    q = (w + zero, x + zero, y + zero, z + zero)
    if escape:
        q = leave_equilibrium(a, q)
    return quaternion.stack(iterate(STEPS[step].correction, a, q, iterations))


@functools.partial(jax.custom_jvp, nondiff_argnums=(2, 3, 4, 5))
def _refined(matrix: jax.Array, wxyz: jax.Array, step: str, iterations: int, escape: bool, order: int) -> jax.Array:
    """The iteration, without its own derivative; `order` counts the derivatives taken, see `overflow.saturate`."""
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

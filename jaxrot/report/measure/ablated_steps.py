"""The steps of `refine_rotation` with some guards left out, composed of the parts of the library's own steps."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import jax
import jax.numpy as jnp

from jaxrot import STEPS
from jaxrot._algebra import ldl, mat3, quaternion
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.scaling import safe_divide, safe_sqrt, scaled
from jaxrot.steps.ascent import ascent
from jaxrot.steps.cayley import cayley_map, zhang_shift
from jaxrot.steps.escape import leave_equilibrium
from jaxrot.steps.exact_angle import turn_about
from jaxrot.steps.iteration import iterate
from jaxrot.steps.quest import sum_of_singular_values

ESCAPE = "escape"

# The guards that all steps share, and those of each step. All but `escape` are on by default.
_COMMON = ("scale", "renormalisation", ESCAPE)
_OWN = {
    "torque": ("absolute value", "epsilon"),
    "torque_exact_angle": ("flat circle",),
    "newton": ("Zhang's shift", "absolute pivots", "free axes", "flat circle"),
    "cayley": ("Zhang's shift", "damping"),
    "quest": ("root above trace", "damping"),
}
GUARDS: Mapping[str, tuple[str, ...]] = MappingProxyType({step: (*_COMMON, *_OWN[step]) for step in STEPS})


def one_step(step: str, without: tuple[str, ...] = ()) -> Callable[[jax.Array, jax.Array], jax.Array]:
    """Returns one step with all guards except those left out.

    Args:
        step: A name in `STEPS`.
        without: Names in `GUARDS[step]`.

    Returns:
        A function from matrices (..., 3, 3) and quaternions (..., 4) to quaternions. With nothing left out, or with
        only `escape` left out, it is the library's own program.
    """
    own = tuple(name for name in without if name in _OWN[step])

    def correction(b: Mat3) -> Quaternion:
        return _CORRECTIONS[step](b, own)

    def step_once(matrix: jax.Array, wxyz: jax.Array) -> jax.Array:
        a = mat3.components(matrix)
        if "scale" not in without:
            a = scaled(a)
        zero = a[0][0] * 0
        w, x, y, z = quaternion.components(wxyz)
        q = (w + zero, x + zero, y + zero, z + zero)
        if ESCAPE not in without:
            q = leave_equilibrium(a, q)
        if "renormalisation" not in without:
            return quaternion.stack(quaternion.renormalise(iterate(correction, a, q, 1)))
        b = mat3.transpose_multiply(quaternion.to_rotation(q), a)
        return quaternion.stack(quaternion.product(q, correction(b)))

    return step_once


def _torque(b: Mat3, without: tuple[str, ...]) -> Quaternion:
    epsilon = jnp.finfo(b[0][0].dtype).eps * safe_sqrt(mat3.squared_norm(b))
    one = jnp.ones_like(epsilon)
    size = mat3.trace(b) if "absolute value" in without else jnp.abs(mat3.trace(b))
    inverse = safe_divide(one, size if "epsilon" in without else size + epsilon)
    return quaternion.exponential(mat3.scale_vector(mat3.axial(b), inverse))


def _torque_exact_angle(b: Mat3, without: tuple[str, ...]) -> Quaternion:
    torque = mat3.axial(b)
    return _turn_about(mat3.gap_matrix(b), torque, torque, without)


def _newton(b: Mat3, without: tuple[str, ...]) -> Quaternion:
    b = fusion_barrier(b)
    h, torque = mat3.gap_matrix(b), mat3.axial(b)
    shifted = h if "Zhang's shift" in without else mat3.add_to_diagonal(h, zhang_shift(b) * 0.5)
    axis = ascent(
        shifted,
        b,
        torque,
        has_absolute_pivots="absolute pivots" not in without,
        keeps_free_axes="free axes" not in without,
    )
    return _turn_about(h, torque, axis, without)


def _cayley(b: Mat3, without: tuple[str, ...]) -> Quaternion:
    b = fusion_barrier(b)
    shift = jnp.zeros_like(b[0][0]) if "Zhang's shift" in without else zhang_shift(b)
    return _cayley_map(b, shift, without)


def _quest(b: Mat3, without: tuple[str, ...]) -> Quaternion:
    b = fusion_barrier(b)
    shift = sum_of_singular_values(b) - mat3.trace(b)
    above = shift if "root above trace" in without else jnp.where(shift < 0, jnp.zeros_like(shift), shift)
    return _cayley_map(b, above, without)


def _turn_about(h: Mat3, torque: Vec3, axis: Vec3, without: tuple[str, ...]) -> Quaternion:
    return turn_about(h, torque, axis, flat=0.0) if "flat circle" in without else turn_about(h, torque, axis)


def _cayley_map(b: Mat3, shift: jax.Array, without: tuple[str, ...]) -> Quaternion:
    """The Cayley map. Without damping, it solves as for a definite matrix, without pivoting."""
    if "damping" not in without:
        return cayley_map(b, shift)
    h = mat3.add_to_diagonal(mat3.gap_matrix(b), shift * 0.5)
    x, y, z = mat3.scale_vector(ldl.solve(h, mat3.axial(b)), 0.5)
    return (jnp.ones_like(x), x, y, z)


_CORRECTIONS: Mapping[str, Callable[[Mat3, tuple[str, ...]], Quaternion]] = {
    "torque": _torque,
    "torque_exact_angle": _torque_exact_angle,
    "newton": _newton,
    "cayley": _cayley,
    "quest": _quest,
}

"""Powers of a cycle of rotations, exact after any number of steps.

After q whole cycles and r further steps the product is C^q P_r. C is the product of one cycle, P_r that of its first r
rotations. C^q is a rotation about the axis of C by q times its angle. Counted in turns as a fixed-point number, q times
the angle loses only whole turns. So the reference needs no float64 in the program, and no sum over a million steps.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

# The angle of a cycle is three digits of 16 bits, the highest first, in units of 2⁻¹⁶, 2⁻³² and 2⁻⁴⁸ turns. Products of
# two digits fit in 32 bits. After 1e6 cycles the error of the angle is below 1e-8 rad.
_DIGIT = 1 << 16


class Cycle(NamedTuple):
    """The product of a cycle of rotations, and the products of its first rotations."""

    beginnings: jax.Array  # P_r, the products of the first r rotations, r = 0 ... period − 1, shape (period, ..., 3, 3)
    axis: jax.Array  # The unit axis of C, shape (..., 3)
    turns: jax.Array  # The angle of C in turns, from 0 to 1, as three digits, uint32, shape (..., 3)


def rotations(vectors: np.ndarray) -> np.ndarray:
    """exp([v]×) for rotation vectors of shape (..., 3), in float64, shape (..., 3, 3)."""
    half = np.linalg.norm(vectors, axis=-1, keepdims=True) / 2
    return _matrices(np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vectors], axis=-1))


def of(increments: np.ndarray) -> Cycle:
    """Returns the cycle of the rotations nearest to the increments, in their dtype, computed in float64.

    The increments, shape (period, ..., 3, 3), are rotations up to rounding, each by less than half a turn.
    """
    nearest = increments.astype(np.float64)
    for _ in range(2):  # Newton and Schulz, which squares an error of 1e-7 each time
        nearest = 1.5 * nearest - 0.5 * nearest @ np.swapaxes(nearest, -1, -2) @ nearest
    trace = np.trace(nearest, axis1=-2, axis2=-1)[..., None]
    axial = [nearest[..., i - 1, i - 2] - nearest[..., i - 2, i - 1] for i in range(3)]
    factors = np.concatenate([trace + 1, np.stack(axial, axis=-1)], axis=-1)
    factors /= np.linalg.norm(factors, axis=-1, keepdims=True)
    beginnings = [np.broadcast_to([1.0, 0, 0, 0], factors.shape[1:])]
    for factor in factors:
        product = _hamilton(beginnings[-1], factor)
        beginnings.append(product / np.linalg.norm(product, axis=-1, keepdims=True))
    last = beginnings.pop()
    sine = np.linalg.norm(last[..., 1:], axis=-1, keepdims=True)
    # A cycle with the angle 0 has no axis. Divide by 1 instead of 0; the axis is not used.
    axis = last[..., 1:] / np.where(sine == 0, 1, sine)
    turns = np.arctan2(sine, last[..., :1]) / np.pi
    count = np.round(turns * float(_DIGIT) ** 3).astype(np.int64)
    digits = np.concatenate([count // _DIGIT**2, count // _DIGIT, count], axis=-1) % _DIGIT
    dtype = increments.dtype
    matrices = _matrices(np.stack(beginnings)).astype(dtype)
    return Cycle(jnp.asarray(matrices), jnp.asarray(axis.astype(dtype)), jnp.asarray(digits.astype(np.uint32)))


def power(cycle: Cycle, count: jax.Array) -> jax.Array:
    """Returns the product of the first `count` ≥ 0 rotations of the repeated cycle, shape (..., 3, 3)."""
    period = len(cycle.beginnings)
    angle = _angle(cycle.turns, (count // period).astype(jnp.uint32), cycle.axis.dtype)[..., None]
    beginning = cycle.beginnings[count % period]
    # Rodrigues' formula, column by column.
    along = jnp.sum(cycle.axis[..., None] * beginning, axis=-2, keepdims=True) * cycle.axis[..., None]
    across = jnp.cross(jnp.broadcast_to(cycle.axis[..., None], beginning.shape), beginning, axis=-2)
    # 2 sin² is accurate for a small angle; 1 − cos would cancel.
    versine = (2 * jnp.sin(angle / 2) ** 2)[..., None]
    return beginning + jnp.sin(angle)[..., None] * across + versine * (along - beginning)


def _angle(turns: jax.Array, factor: jax.Array, dtype: np.dtype) -> jax.Array:
    """The angle turns·factor in radians, in (−π, π], without whole turns: accurate to rounding for every factor."""
    high, middle, low = (turns[..., i] for i in range(3))
    factor_high, factor_low = factor // _DIGIT, factor % _DIGIT
    # Long multiplication from the lowest digit. Carries out of the highest digit are whole turns, and are dropped.
    lowest = factor_low * low
    second, third = factor_low * middle, factor_high * low
    carried = lowest // _DIGIT + second % _DIGIT + third % _DIGIT
    highest = carried // _DIGIT + second // _DIGIT + third // _DIGIT + factor_low * high + factor_high * middle
    digits = [(x % _DIGIT).astype(dtype) for x in (highest, carried, lowest)]
    # Use the signed remainder, so that a small negative angle keeps its digits too.
    signed = jnp.where(digits[0] >= _DIGIT // 2, digits[0] - _DIGIT, digits[0])
    return 2 * np.pi / _DIGIT * (signed + (digits[1] + digits[2] / _DIGIT) / _DIGIT)


def _matrices(wxyz: np.ndarray) -> np.ndarray:
    """The rotations 1 + 2w [v]× + 2 [v]×² of unit quaternions (w, v)."""
    cross = np.cross(np.eye(3), wxyz[..., None, 1:])
    return np.eye(3) + 2 * (wxyz[..., :1, None] * cross + cross @ cross)


def _hamilton(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    w = p[..., :1] * q[..., :1] - np.sum(p[..., 1:] * q[..., 1:], axis=-1, keepdims=True)
    return np.concatenate(
        [w, p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])], axis=-1
    )

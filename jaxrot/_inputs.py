"""The gate: every public function's arguments pass here, and fail here, while the program is traced."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

_HALF_PRECISION = (jnp.float16.dtype, jnp.bfloat16.dtype)


class Checked(NamedTuple):
    """An argument that passed the gate.

    Attributes:
        value: The array in the dtype to compute in, float32 or float64.
        dtype: The dtype in which the caller expects the result.
    """

    value: jax.Array
    dtype: np.dtype


def _checked(argument: ArrayLike, name: str, trailing_shape: tuple[int, ...], hint: str = "") -> Checked:
    """Turns `argument` into a real floating array of shape (..., *trailing_shape), or raises naming it."""
    expected = f"{name} must be a real array of shape (..., {', '.join(map(str, trailing_shape))})"
    try:
        array = jnp.asarray(argument)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{expected}; got {type(argument).__name__}, which is no numeric array ({error})") from None
    if array.shape[-len(trailing_shape) :] != trailing_shape:
        raise ValueError(f"{expected}; got shape {array.shape}{hint if array.shape[:2] == trailing_shape else ''}")
    if jnp.issubdtype(array.dtype, jnp.integer) or array.dtype == jnp.bool_:
        array = array.astype(jnp.result_type(float))
    if not jnp.issubdtype(array.dtype, jnp.floating):
        raise TypeError(f"{expected}; got dtype {array.dtype}")
    if array.dtype in _HALF_PRECISION:
        return Checked(array.astype(jnp.float32), array.dtype)
    if array.dtype not in (jnp.float32.dtype, jnp.float64.dtype):
        raise TypeError(f"{name} must be float16, bfloat16, float32, float64, int or bool; got dtype {array.dtype}")
    return Checked(array, array.dtype)


def check_matrix(matrix: ArrayLike, name: str = "matrix") -> Checked:
    """Admits a batch of 3×3 matrices.

    Half precision is computed in float32: three digits are too few for a determinant. Integers and booleans become
    the default floating dtype.

    Args:
        matrix: Real array-like of shape (..., 3, 3).
        name: What the caller's argument is called, for the message.

    Returns:
        The array to compute with and the dtype to return.

    Raises:
        ValueError: The last two axes are not (3, 3).
        TypeError: The dtype is complex, an object, a string or an eight-bit float.
    """
    hint = "; if the batch axes trail, use jax.vmap(f, in_axes=-1, out_axes=-1)"
    return _checked(matrix, name, (3, 3), hint)


def check_start(start: ArrayLike, name: str, trailing_shape: tuple[int, ...], matrix: jax.Array) -> Checked:
    """Admits a warm start and gives it the matrices' computing dtype and a batch shape that holds both.

    Args:
        start: Real array-like of shape (..., *trailing_shape); its batch axes broadcast against those of `matrix`.
        name: What the caller's argument is called, for the message.
        trailing_shape: (3, 3) for rotations, (4,) for quaternions.
        matrix: The matrices, already admitted, of shape (..., 3, 3).

    Returns:
        The start of shape (*batch, *trailing_shape), and its own dtype.

    Raises:
        ValueError: The shape is wrong, or the batch axes do not broadcast.
        TypeError: The dtype is not real.
    """
    checked = _checked(start, name, trailing_shape)
    batch = checked.value.shape[: -len(trailing_shape)]
    try:
        batch = jnp.broadcast_shapes(batch, matrix.shape[:-2])
    except ValueError:
        raise ValueError(
            f"the batch axes of matrix and {name} must broadcast; got {matrix.shape[:-2]} and {batch}"
        ) from None
    return Checked(jnp.broadcast_to(checked.value.astype(matrix.dtype), batch + trailing_shape), checked.dtype)


def check_choice(choice: str, name: str, registry: Mapping[str, object]) -> str:
    """Admits a name in a registry.

    Raises:
        TypeError: `choice` is not a string.
        ValueError: The registry does not hold it; the message lists what it holds.
    """
    if not isinstance(choice, str):
        raise TypeError(f"{name} must be a string; got {type(choice).__name__}")
    if choice not in registry:
        raise ValueError(f"{name} must be one of {', '.join(sorted(registry))}; got {choice!r}")
    return choice


def check_iterations(iterations: int) -> int:
    """Admits a static, non-negative number of iterations.

    Raises:
        TypeError: It is no Python integer (a traced value included: the trip count must be static).
        ValueError: It is negative.
    """
    if isinstance(iterations, bool) or not isinstance(iterations, int | np.integer):
        raise TypeError(f"iterations must be a static Python integer; got {type(iterations).__name__}")
    if iterations < 0:
        raise ValueError(f"iterations must be >= 0; got {iterations}")
    return int(iterations)


def check_damping(damping: float) -> float:
    """Admits a static, finite, non-negative relative damping.

    Raises:
        TypeError: It is no Python number (a traced value included: damping is static).
        ValueError: It is negative or not finite.
    """
    if isinstance(damping, bool) or not isinstance(damping, int | float | np.integer | np.floating):
        raise TypeError(f"damping must be a static Python number; got {type(damping).__name__}")
    if not (np.isfinite(damping) and damping >= 0):
        raise ValueError(f"damping must be finite and >= 0; got {damping}")
    return float(damping)


def check_flag(flag: bool, name: str) -> bool:
    """Admits a static yes or no.

    Raises:
        TypeError: It is no Python bool (a traced value included: it decides what is computed).
    """
    if not isinstance(flag, bool | np.bool_):
        raise TypeError(f"{name} must be a static Python bool; got {type(flag).__name__}")
    return bool(flag)


def layout_hint(shape: tuple[int, ...]) -> str:
    """The line of NumPy that converts an array of another layout to shape (..., 3, 3), for the end of a message.

    Args:
        shape: Of the array.

    Returns:
        "; if ..., use ..." for every layout that it may have; "" if its shape is (..., 3, 3) or of no known layout.
    """
    if shape[-2:] == (3, 3):
        return ""
    # With several batch axes they are spelled out: -1 would merge them.
    batch = "-1" if len(shape) < 3 else ", ".join(map(str, shape[:-1]))
    last = {
        (9,): f"each row is a matrix, use array.reshape({batch}, 3, 3)",
        (12,): f"each row is a 3x4 pose, use array.reshape({batch}, 3, 4)[..., :3]",
        (16,): f"each row is a 4x4 pose, use array.reshape({batch}, 4, 4)[..., :3, :3]",
        (3, 4): "these are 3x4 poses, use array[..., :3]",
        (4, 4): "these are 4x4 poses, use array[..., :3, :3]",
    }
    readings = [reading for end, reading in last.items() if shape[-len(end) :] == end]
    if shape[:2] == (3, 3):
        axes = "-1, 0" if len(shape) == 3 else "(0, 1), (-2, -1)"
        readings.append(f"the batch comes last, use numpy.moveaxis(array, {axes})")
    return "".join(f"; if {reading}" for reading in readings)

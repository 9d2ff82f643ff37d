"""Validation of the arguments of every public function, while the program is traced."""

import math
import warnings
from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxrot._algebra.platform import platform

# A validated argument. NumPy arrays are not converted: the compiled program takes them.
Array = jax.Array | np.ndarray

_HALF_PRECISION = (jnp.float16.dtype, jnp.bfloat16.dtype)


class Computing(NamedTuple):
    """An argument in the dtype to compute in.

    Attributes:
        value: The array, float32 or float64.
        dtype: The dtype in which the caller expects the result.
    """

    value: jax.Array
    dtype: np.dtype


# Old names of methods, and the methods that replaced them.
_REPLACED = {"half_turn": "singular_pair"}


def check_array(argument: ArrayLike, name: str, trailing_shape: tuple[int, ...]) -> Array:
    """Returns a numeric array of shape (..., *trailing_shape), or raises an error that names the argument.

    Raises:
        ValueError: The shape is wrong.
        TypeError: The dtype is complex, an object, a string, a date, long double or an eight-bit float.
    """
    expected = f"{name} must be a real array of shape (..., {', '.join(map(str, trailing_shape))})"
    array = _as_array(argument, name, expected)
    if array.shape[-len(trailing_shape) :] != trailing_shape:
        hint = layout_hint(array.shape) if trailing_shape == (3, 3) else ""
        if array.shape[:2] == trailing_shape == (3, 3):
            hint += ", or jax.vmap(function, in_axes=-1, out_axes=-1)"
        raise ValueError(f"{expected}; got shape {array.shape}{hint}")
    _computing_dtype(array.dtype, expected)
    return array


def computing(array: jax.Array) -> Computing:
    """Converts a checked array: half precision to float32, integers and booleans to the default floating dtype.

    Half precision has three digits, too few for a determinant.

    Raises:
        TypeError: float64 on a TPU. Its compiler cannot read the exponent of such numbers, which scaling needs.
    """
    dtype = array.dtype
    if not jnp.issubdtype(dtype, jnp.floating):
        dtype = jnp.result_type(float)
    computing_dtype = _computing_dtype(array.dtype, "")
    if computing_dtype == jnp.float64.dtype and platform() == "tpu":
        raise TypeError(
            "matrix must be float32 or shorter on a TPU; for float64 use jax.default_device(jax.devices('cpu')[0])"
        )
    return Computing(array.astype(computing_dtype), dtype)


def _as_array(argument: ArrayLike, name: str, expected: str) -> Array:
    if isinstance(argument, jax.Array):
        return argument
    if isinstance(argument, np.ndarray):
        if argument.dtype == np.longdouble != np.float64:
            raise TypeError(f"{expected}; got dtype {argument.dtype}: convert it by {name}.astype(numpy.float64)")
        # Keep the NumPy array: `jnp.asarray` would compile and run a program of its own.
        return argument.astype(argument.dtype.newbyteorder("="), copy=False)
    try:
        return jnp.asarray(argument)
    except OverflowError:
        raise TypeError(f"{expected}; got an integer of more than 64 bits: pass floats instead") from None
    except (TypeError, ValueError) as error:
        raise TypeError(f"{expected}; got {type(argument).__name__}, not a numeric array ({error})") from None


def _computing_dtype(dtype: np.dtype, expected: str) -> np.dtype:
    if jnp.issubdtype(dtype, jnp.integer) or dtype == jnp.bool_:
        return jnp.result_type(float)
    if dtype in _HALF_PRECISION:
        return jnp.float32.dtype
    if dtype in (jnp.float32.dtype, jnp.float64.dtype):
        return dtype
    raise TypeError(f"{expected} in float16, bfloat16, float32, float64, int or bool; got dtype {dtype}")


def check_matrix(matrix: ArrayLike, name: str = "matrix") -> Array:
    """Returns a batch of 3×3 matrices in the dtype in which the caller passed them.

    Args:
        matrix: Real array-like of shape (..., 3, 3).
        name: What the caller's argument is called, for the message.

    Raises:
        ValueError: The last two axes are not (3, 3).
        TypeError: The dtype is not real, or jaxrot does not compute in it.
    """
    return check_array(matrix, name, (3, 3))


def check_start(start: ArrayLike, name: str, trailing_shape: tuple[int, ...], matrix: Array) -> Array:
    """Returns a warm start whose batch axes broadcast against those of the matrices.

    Args:
        start: Real array-like of shape (..., *trailing_shape).
        name: What the caller's argument is called, for the message.
        trailing_shape: (3, 3) for rotations, (4,) for quaternions.
        matrix: The checked matrices, of shape (..., 3, 3).

    Raises:
        ValueError: The shape is wrong, or the batch axes do not broadcast.
        TypeError: The dtype is not real.
    """
    checked = check_array(start, name, trailing_shape)
    batch = checked.shape[: -len(trailing_shape)]
    try:
        jnp.broadcast_shapes(batch, matrix.shape[:-2])
    except ValueError:
        raise ValueError(
            f"the batch axes of matrix and {name} must broadcast; got {matrix.shape[:-2]} and {batch}"
        ) from None
    return checked


def check_choice(choice: str, name: str, registry: Mapping[str, object]) -> str:
    """Returns a name in a registry. A name that was replaced gives its successor, with a warning.

    Raises:
        TypeError: `choice` is not a string.
        ValueError: The registry does not hold it; the message lists the names that it holds.
    """
    if not isinstance(choice, str):
        raise TypeError(f"{name} must be a string; got {type(choice).__name__}")
    if _REPLACED.get(choice) in registry:
        warnings.warn(f"{name} {choice!r} was replaced by {_REPLACED[choice]!r}", DeprecationWarning, stacklevel=3)
        return _REPLACED[choice]
    if choice not in registry:
        raise ValueError(f"{name} must be one of {', '.join(sorted(registry))}; got {choice!r}")
    return choice


def check_iterations(iterations: int) -> int:
    """Validates a static, non-negative number of iterations.

    Raises:
        TypeError: It is not a Python integer. A traced value is not one: the trip count must be static.
        ValueError: It is negative, or too large for the counter of a loop.
    """
    return check_integer(iterations, "iterations", 0)


def check_integer(number: int, name: str, least: int) -> int:
    """Returns a static integer between `least` and 2³¹ − 1, the largest of 32 bits.

    Raises:
        TypeError: It is not a Python integer. A traced value is not one: the integer decides what is computed.
        ValueError: It is too small or too large.
    """
    if isinstance(number, bool | np.bool_) or not isinstance(number, int | np.integer):
        raise TypeError(f"{name} must be a static Python integer; got {type(number).__name__}")
    if not least <= number < 2**31:
        shown = number if abs(int(number)) < 2**64 else "an integer of more than 64 bits"
        raise ValueError(f"{name} must be >= {least} and < 2**31; got {shown}")
    return int(number)


def check_damping(damping: float) -> float:
    """Validates a static, finite, non-negative relative damping.

    Raises:
        TypeError: It is not a Python number. A traced value is not one: damping is static.
        ValueError: It is negative, NaN or infinite.
    """
    if isinstance(damping, bool) or not isinstance(damping, int | float | np.integer | np.floating):
        raise TypeError(f"damping must be a static Python number; got {type(damping).__name__}")
    try:
        number = float(damping)
    except OverflowError:
        number = math.inf
    if not 0 <= number < math.inf:
        raise ValueError(f"damping must be finite and >= 0; got {number}")
    return number


def check_function(function: Callable, name: str) -> Callable:
    """Validates a function of the user.

    Raises:
        TypeError: It is not callable.
    """
    if not callable(function):
        raise TypeError(f"{name} must be a function; got {type(function).__name__}")
    return function


def check_flag(flag: bool, name: str) -> bool:
    """Validates a static bool.

    Raises:
        TypeError: It is not a Python bool. A traced value is not one: the flag decides what is computed.
    """
    if not isinstance(flag, bool | np.bool_):
        raise TypeError(f"{name} must be a static Python bool; got {type(flag).__name__}")
    return bool(flag)


def layout_hint(shape: tuple[int, ...]) -> str:
    """Returns the NumPy expression that converts an array of another layout to shape (..., 3, 3), for a message.

    Args:
        shape: The shape of the array.

    Returns:
        "; if ..., use ..." for every layout that this may be. "" for (..., 3, 3) and for unknown layouts.
    """
    if shape[-2:] == (3, 3):
        return ""
    # Spell out several batch axes: -1 would merge them.
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

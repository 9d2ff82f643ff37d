"""Compilation and export of public functions: one program for each, and serialised names for their records."""

import functools
import inspect
from collections.abc import Callable
from typing import TypeVar

import jax
from jax import export, lax

from jaxrot._inputs import computing

_Result = TypeVar("_Result")
_Record = TypeVar("_Record")


def compiled(function: Callable[..., _Result]) -> Callable[..., _Result]:
    """Jits a function of validated arrays. It computes in the computing dtype of the first array, the matrices.

    A barrier stands before the arguments: with a constant of extreme size XLA would form the product of two scaling
    factors, which overflows (NaN for a zero matrix that is written into a jitted program, on jax 0.10).

    Further arrays are converted to that dtype. Results have the dtype of the first array. Without `jit` JAX would
    dispatch every operation, 1,800 for the default method, and compile a loop again in every call.

    Args:
        function: Its positional arguments are arrays, its keyword-only arguments are static.

    Returns:
        The jitted function. It is inlined inside another `jit`, whose program is the same as without this one.
    """
    parameters = inspect.signature(function).parameters.values()
    static = [parameter.name for parameter in parameters if parameter.kind is inspect.Parameter.KEYWORD_ONLY]

    @functools.partial(jax.jit, static_argnames=static, inline=True)
    @functools.wraps(function)
    def run(matrix, *others, **options):
        value, dtype = computing(matrix)
        arrays = [value, *(other.astype(value.dtype) for other in others)]
        result = function(*lax.optimization_barrier(arrays), **options)
        return jax.tree.map(lambda x: x.astype(dtype), result)

    return run


def exportable(record: type[_Record]) -> type[_Record]:
    """Lets `jax.export` serialise functions that take or return this NamedTuple."""
    rooms = [room for room in record.__module__.split(".") if not room.startswith("_")]
    return export.register_namedtuple_serialization(record, serialized_name=".".join([*rooms, record.__name__]))


class ByIdentity:
    """A user's function as a static argument, compared by identity: each function object is compiled once.

    Equality would be wrong: bound methods of one object are equal even after that object has changed. Functions may
    also be unhashable.
    """

    def __init__(self, function: Callable) -> None:
        self.function = function

    def __call__(self, *args, **kwargs):
        return self.function(*args, **kwargs)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ByIdentity) and other.function is self.function

    def __hash__(self) -> int:
        return id(self.function)

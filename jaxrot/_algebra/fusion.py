"""A barrier that keeps XLA from computing a value more than once.

XLA:CPU recomputes a cheap expression in every fusion that uses it, and each copy can round differently. If the sign of
that expression decides a branch, two components of one result can disagree: the matrix is then no rotation, or a wrong
one. XLA does not duplicate a division, so a division by an opaque 1 pins the value.
"""

from typing import TypeVar

import jax

from jaxrot._algebra.platform import platform
from jaxrot._algebra.select import constant_like

_Tree = TypeVar("_Tree")


def fusion_barrier(values: _Tree, divisor: jax.Array | None = None) -> _Tree:
    """The values, one array or a tree of them, divided by a divisor and computed once.

    On a CPU each value is a quotient; without a divisor it is divided by a 1 that XLA cannot see through. Kernels on
    other platforms compute each value only once anyway. There the function returns the values unchanged if no divisor
    is given; otherwise it multiplies all of them by one reciprocal.
    """
    if platform() != "cpu":
        inverse = None if divisor is None else 1 / divisor
        return values if inverse is None else jax.tree.map(lambda value: value * inverse, values)
    if divisor is None:
        divisor = constant_like(jax.tree.leaves(values)[0], 1)
    return jax.tree.map(lambda value: value / divisor, values)

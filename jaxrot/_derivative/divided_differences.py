"""Divided differences of a function of the singular values, without cancellation at equal singular values.

A permutation of the arguments of φ permutes its results. So φᵢ − φⱼ vanishes at sᵢ = sⱼ, and the divided difference is
the mean of a derivative of φ on the path from there to s. The same holds for sums at sᵢ = −sⱼ if the map is smooth
there.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxrot._algebra.mat3 import Vec3
from jaxrot._derivative.rule import resolved_gap

# The planes (y, z), (z, x), (x, y), in the order of their normals.
PLANES = ((1, 2), (2, 0), (0, 1))

# The mean is used where it agrees with the quotient up to this many eps of the operands of the subtraction.
_AGREEMENT = 32
# Two singular values are equal up to this many eps.
_EQUAL = 64
# Positive nodes of the Gauss-Legendre quadrature. It is exact up to rounding for a smooth function and a path up to
# half as long as the singular values.
_NODES = {"float32": 2, "float64": 4}


class DividedDifferences(NamedTuple):
    """The divided differences for each pair (i, j) of `PLANES`.

    Attributes:
        over_differences: (φᵢ − φⱼ)/(sᵢ − sⱼ).
        over_sums: (φᵢ + φⱼ)/(sᵢ + sⱼ), or (φᵢ − φⱼ)/(sᵢ + sⱼ) for an even map.
    """

    over_differences: Vec3
    over_sums: Vec3


def divided_differences(
    function: Callable[[jax.Array], jax.Array], s: jax.Array, phi: jax.Array, *, is_even: bool
) -> DividedDifferences:
    """Returns the divided differences of φ at s.

    Args:
        function: φ, from arrays of shape (..., 3) to such arrays. It is called with more batch axes than s has.
        s: The singular values, shape (..., 3).
        phi: φ(s).
        is_even: Whether the map of φ does not change if two singular values change their signs. Static.
    """
    sign = -1 if is_even else 1
    # Clamp values within a factor of 16 of the largest number: otherwise the sums overflow.
    largest = jnp.finfo(s.dtype).max / 16
    s = lax.clamp(-largest, s, largest)
    slopes_over_differences, slopes_over_sums = _mean_slopes(function, s, sign)
    over_differences, over_sums = [], []
    for k, (i, j) in enumerate(PLANES):
        si, sj, fi, fj = s[..., i], s[..., j], phi[..., i], phi[..., j]
        size, length = jnp.abs(fi) + jnp.abs(fj), jnp.abs(si) + jnp.abs(sj)
        slope = slopes_over_differences[..., k]
        are_equal = jnp.abs(si - sj) <= _EQUAL * float(jnp.finfo(s.dtype).eps) * length
        agrees = _agrees(fi - fj, si - sj, slope, size, length) | are_equal
        over_differences.append(jnp.where(agrees, slope, (fi - fj) / _nonzero(si - sj)))
        slope, numerator, gap = slopes_over_sums[..., k], fi + sign * fj, _nonzero(si + sj)
        unresolved = resolved_gap(jnp.sum(jnp.abs(s), axis=-1)) / gap
        agrees = _agrees(numerator, si + sj, slope, size, length)
        over_sums.append(jnp.where(agrees, slope, numerator / (gap * (1 + unresolved * unresolved))))
    (x, y, z), (u, v, w) = over_differences, over_sums
    return DividedDifferences((x, y, z), (u, v, w))


def _mean_slopes(function: Callable[[jax.Array], jax.Array], s: jax.Array, sign: int) -> tuple[jax.Array, jax.Array]:
    """Returns, for each plane, half of the mean derivative of φᵢ − φⱼ along eᵢ − eⱼ, and of φᵢ ± φⱼ along eᵢ + eⱼ.

    The paths start where sᵢ = sⱼ and where sᵢ = −sⱼ, and end at s.
    """
    starts, directions = [], []
    for i, j in PLANES:
        si, sj = s[..., i], s[..., j]
        mean, half = 0.5 * (si + sj), 0.5 * (si - sj)
        # If two values have the same sign, the path would cross points where φ may be undefined. The quotient is
        # accurate there, and the path is left out.
        is_opposite = si * sj <= 0
        starts.append(_with(s, (i, j), (mean, mean)))
        starts.append(_with(s, (i, j), (jnp.where(is_opposite, half, si), jnp.where(is_opposite, -half, sj))))
        directions += [np.eye(3)[i] - np.eye(3)[j], np.eye(3)[i] + np.eye(3)[j]]

    nodes, weights = np.polynomial.legendre.leggauss(2 * _NODES[s.dtype.name])
    rule = [(float(node), float(weight)) for node, weight in zip(nodes, weights, strict=True) if node > 0]
    # notation: the axes are the batch, the six paths, the nodes, and x, y, z.
    start = jnp.stack(starts, axis=-2)
    way = s[..., None, :] - start
    points = jnp.stack([start + node * way for node, _ in rule], axis=-2)
    along = jnp.broadcast_to(np.array(directions, s.dtype)[:, None, :], points.shape)
    derivatives = jax.jvp(function, (points,), (along,))[1]
    weighted = (0.5 * weight * derivatives[..., k, :] for k, (_, weight) in enumerate(rule))
    slopes = functools.reduce(jnp.add, weighted)
    over_differences = [slopes[..., 2 * k, i] - slopes[..., 2 * k, j] for k, (i, j) in enumerate(PLANES)]
    over_sums = [slopes[..., 2 * k + 1, i] + sign * slopes[..., 2 * k + 1, j] for k, (i, j) in enumerate(PLANES)]
    return jnp.stack(over_differences, axis=-1), jnp.stack(over_sums, axis=-1)


def _with(s: jax.Array, plane: tuple[int, int], values: tuple[jax.Array, jax.Array]) -> jax.Array:
    entries = [s[..., axis] for axis in range(3)]
    for axis, value in zip(plane, values, strict=True):
        entries[axis] = value
    return jnp.stack(entries, axis=-1)


def _agrees(numerator: jax.Array, gap: jax.Array, slope: jax.Array, size: jax.Array, length: jax.Array) -> jax.Array:
    """Whether slope times gap equals the numerator up to the rounding of φ and of the singular values."""
    rounding = _AGREEMENT * float(jnp.finfo(gap.dtype).eps) * (size + jnp.abs(slope) * length)
    return jnp.abs(numerator - gap * slope) <= rounding


def _nonzero(gap: jax.Array) -> jax.Array:
    return jnp.where(gap == 0, jnp.ones_like(gap), gap)

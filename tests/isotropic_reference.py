"""Isotropic functions, and their derivatives in 50 digits by divided differences of exactly decomposed matrices."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import mpmath as mp
import numpy as np

MU, LAMBDA = 0.75, 1.5
LOWER, UPPER = 0.975, 1.0075  # the clamp of snow plasticity (Stomakhin et al. 2013)


class Material(NamedTuple):
    """ψ in JAX, or None; φ = ∂ψ in JAX; φ in mpmath, from a list of three numbers."""

    energy: Callable | None
    function: Callable | None
    values: Callable


def _strain_trace(s):
    return sum((x * x - 1) / 2 for x in s)


MATERIALS = {
    "hencky": Material(lambda s: jnp.sum(jnp.log(s) ** 2), None, lambda s: [2 * mp.log(x) / x for x in s]),
    "neo_hookean": Material(
        lambda s: MU / 2 * (jnp.sum(s * s) - 3) - MU * jnp.log(jnp.prod(s)) + LAMBDA / 2 * jnp.log(jnp.prod(s)) ** 2,
        None,
        lambda s: [MU * x + (LAMBDA * mp.log(s[0] * s[1] * s[2]) - MU) / x for x in s],
    ),
    "saint_venant_kirchhoff": Material(
        lambda s: MU * jnp.sum(((s * s - 1) / 2) ** 2) + LAMBDA / 2 * jnp.sum((s * s - 1) / 2) ** 2,
        None,
        lambda s: [x * (MU * (x * x - 1) + LAMBDA * _strain_trace(s)) for x in s],
    ),
    "corotated": Material(lambda s: jnp.sum((s - 1) ** 2), None, lambda s: [2 * (x - 1) for x in s]),
    "determinant": Material(lambda s: s[0] * s[1] * s[2], None, lambda s: [s[1] * s[2], s[0] * s[2], s[0] * s[1]]),
    "snow": Material(None, lambda s: jnp.clip(s, LOWER, UPPER), lambda s: [min(max(x, LOWER), UPPER) for x in s]),
    "logarithm": Material(None, jnp.log, lambda s: [mp.log(x) for x in s]),
}


def _jacobian(values, s, h=2.0**-66):
    """∂φ_i/∂s_j by central differences, good to 40 digits."""
    moved = lambda j, sign: values([x + sign * h * (i == j) for i, x in enumerate(s)])  # noqa: E731
    columns = [[(a - b) / (2 * h) for a, b in zip(moved(j, 1), moved(j, -1), strict=True)] for j in range(3)]
    return [list(row) for row in zip(*columns, strict=True)]


def derivatives(matrix: np.ndarray, material: Material, vectors: str = "left_right") -> tuple[np.ndarray, np.ndarray]:
    """The map U diag(φ) Vᵀ and its Jacobian, shapes (3, 3) and (9, 9), in float64 or wider."""
    with mp.workdps(60):
        # Moved by 1e-25, so that no two singular values are equal; what that changes is far below rounding.
        shift = 1e-25 * np.random.default_rng(1).standard_normal((3, 3))
        a = mp.matrix(matrix.astype(float).tolist()) + mp.matrix(shift.tolist()) * max(1e-30, np.abs(matrix).max())
        u, s, vt = mp.svd_r(a)
        v = vt.T
        s = list(s)
        # The sign of the determinant goes into the smallest singular value.
        for axes in (u, v):
            if mp.det(axes) < 0:
                axes[:, 2] *= -1
                s[2] = -s[2]
        phi, jacobian = material.values(s), _jacobian(material.values, s)
        outer, inner = {"left_right": (u, v), "left": (u, u), "right": (v, v)}[vectors]
        value = outer * mp.diag(phi) * inner.T
        columns = []
        for k in range(9):
            direction = mp.zeros(3)
            direction[k // 3, k % 3] = 1
            m = u.T * direction * v
            columns.append(np.array((outer * _tangent(m, s, phi, jacobian, vectors) * inner.T).tolist()).ravel())
        return np.array(value.tolist(), float), np.stack(columns, -1).astype(float)


def _tangent(m, s, phi, jacobian, vectors):
    tangent = mp.diag([sum(jacobian[i][j] * m[j, j] for j in range(3)) for i in range(3)])
    for i in range(3):
        for j in range(3):
            if i != j:
                symmetric, skew = (m[i, j] + m[j, i]) / 2, (m[i, j] - m[j, i]) / 2
                over_sum = phi[i] + phi[j] if vectors == "left_right" else (phi[i] - phi[j])
                if vectors == "left":
                    skew = -skew
                tangent[i, j] = (phi[i] - phi[j]) / (s[i] - s[j]) * symmetric + over_sum / (s[i] + s[j]) * skew
    return tangent

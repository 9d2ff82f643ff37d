"""JAX's own singular value decomposition, polar decomposition and symmetric eigenvectors."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import jax.scipy.linalg
import numpy as np

from jaxrot.console.environment import usable_cores
from jaxrot.report.peers.peer import Peer


def svd(dtype: str) -> Peer:
    """U diag(1, 1, det UVᵀ) Vᵀ by `jnp.linalg.svd`."""

    def rotation(matrix: jax.Array) -> jax.Array:
        left, _, right = jnp.linalg.svd(matrix)
        sign = jnp.sign(jnp.linalg.det(left @ right))
        return jnp.concatenate([left[..., :2], left[..., 2:] * sign[..., None, None]], axis=-1) @ right

    return in_jax(rotation, dtype)


def polar(dtype: str) -> Peer:
    """The unitary factor by `jax.scipy.linalg.polar`: a reflection if det A < 0. Its loop has no reverse mode."""

    def rotation(matrix: jax.Array) -> jax.Array:
        return jax.vmap(lambda a: jax.scipy.linalg.polar(a)[0])(matrix)

    return in_jax(rotation, dtype, has_pullback=False)


def eigh(dtype: str) -> Peer:
    """The rotation of the quaternion that belongs to the largest eigenvalue of Davenport's matrix."""

    def rotation(matrix: jax.Array) -> jax.Array:
        (a, b, c), (d, e, f), (g, h, i) = (tuple(matrix[..., j, k] for k in range(3)) for j in range(3))
        rows = [
            [a + e + i, h - f, c - g, d - b],
            [h - f, a - e - i, b + d, c + g],
            [c - g, b + d, e - a - i, f + h],
            [d - b, c + g, f + h, i - a - e],
        ]
        davenport = jnp.stack([jnp.stack(row, -1) for row in rows], -2)
        # The sums overflow if A is near the largest number, and LAPACK may never return from an infinity.
        is_finite = jnp.isfinite(davenport).all(axis=(-2, -1), keepdims=True)
        safe = jnp.where(is_finite, davenport, jnp.zeros_like(davenport))
        w, x, y, z = jnp.moveaxis(jnp.linalg.eigh(safe)[1][..., -1], -1, 0)
        columns = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        # After an overflow the value is NaN and, because of the factor A, its derivative too.
        nan = jnp.where(is_finite, jnp.zeros_like(matrix), jnp.full_like(matrix, jnp.nan))
        return jnp.stack([jnp.stack(row, -1) for row in columns], -2) + nan * matrix

    return in_jax(rotation, dtype)


def in_jax(rotation: Callable[[jax.Array], jax.Array], dtype: str, has_pullback: bool = True) -> Peer:
    """A function of JAX arrays, compiled, as a peer."""

    @jax.jit
    def value_and_pullback(matrix: jax.Array, rotation_bar: jax.Array) -> tuple[jax.Array, jax.Array]:
        value, pullback = jax.vjp(rotation, matrix)
        return value, pullback(rotation_bar)[0]

    compiled = jax.jit(rotation)
    return Peer(
        load=jnp.asarray,
        value=lambda matrix: jax.block_until_ready(compiled(matrix)),
        pullback=(lambda matrix, bar: jax.block_until_ready(value_and_pullback(matrix, bar))) if has_pullback else None,
        unload=np.asarray,
        threads=usable_cores() if jax.default_backend() == "cpu" else 1,
        computes_in=dtype,
    )

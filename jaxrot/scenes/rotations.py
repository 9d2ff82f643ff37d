"""Products, errors and angles of batches of 3×3 matrices, shape (..., 3, 3)."""

import jax
import jax.numpy as jnp

from jaxrot._algebra.scaling import safe_sqrt


def product(a: jax.Array, b: jax.Array) -> jax.Array:
    """The matrix product by elementwise products: an accelerator rounds the factors of `@` and `einsum` to TF32."""
    x, y, z = (a[..., :, i, None] * b[..., i, None, :] for i in range(3))
    return x + y + z


def orthonormality_error(rotation: jax.Array) -> jax.Array:
    """‖RᵀR − 1‖_F, without unit, shape (...)."""
    square = product(jnp.swapaxes(rotation, -1, -2), rotation)
    return _distance(square, jnp.broadcast_to(jnp.eye(3, dtype=square.dtype), square.shape))


def angle_between(rotation: jax.Array, other: jax.Array) -> jax.Array:
    """Returns the angle of the rotation from one to the other, rad, shape (...)."""
    return 2 * jnp.arcsin(jnp.minimum(_distance(rotation, other) / 8**0.5, 1))


def _distance(a: jax.Array, b: jax.Array) -> jax.Array:
    return safe_sqrt(jnp.sum((a - b) ** 2, axis=(-2, -1)))

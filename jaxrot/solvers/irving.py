"""The stabilised polar decomposition of Irving et al. 2004, as Müller et al. 2016 print it for comparison."""

import jax
import jax.numpy as jnp

from jaxrot import _jacobi, _mat3
from jaxrot._choice import constant_like
from jaxrot._mat3 import Vec3
from jaxrot._scaling import safe_divide, safe_sqrt, scaled

# A singular value below this part of the largest counts as zero. In float32 the paper's 1e-4 lies below the noise,
# √eps, of the root of an eigenvalue of AᵀA: a plane matrix would be divided by it.
_RANK_TOLERANCE = {"float32": 1e-3, "float64": 1e-4}


def solve(matrix: jax.Array) -> jax.Array:
    """The rotation U Vᵀ, V the eigenvectors of AᵀA, U = A V diag(1/s), reflected along the smallest s if det U < 0.

    The cases of the source, each by a select: one singular value zero, that column of U is the vector product of the
    two others; two or three zero, U = 1 and the result is Vᵀ, some rotation.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3). The error grows like eps (s1/s3)², and so does the defect of orthogonality: s is good to eps s1²/s.
        At rank 1 the result is a rotation and not a nearest one.

    Cost: about 560 flops, 24 square roots and as many divisions.
    Source: Irving, Teran and Fedkiw 2004; Müller et al. 2016, appendix C. Its constants 1e-15 and 1e-4 are absolute:
    here the scale is removed, the first is not needed, and the second is relative to the largest singular value. The
    determinant of V, which the source tests, is +1 as a product of rotations.
    """
    a = scaled(_mat3.components(matrix))
    eigenvalues, axes = _jacobi.symmetric_eigen(_mat3.transpose_multiply(a, a))
    s = (safe_sqrt(eigenvalues[0]), safe_sqrt(eigenvalues[1]), safe_sqrt(eigenvalues[2]))
    limit = _RANK_TOLERANCE[matrix.dtype.name] * jnp.maximum(jnp.maximum(s[0], s[1]), s[2])
    # The order is free: the frame is rolled so that the smallest comes last.
    is_first = (s[0] < s[1]) & (s[0] < s[2])
    is_second = ~is_first & (s[1] < s[2])
    for condition in (is_first | is_second, is_second):
        (s, axes) = _rolled(condition, s), _jacobi.rolled(condition, axes)
    images = [_mat3.apply(a, axis) for axis in axes]
    one = constant_like(limit, 1)
    u0, u1, u2 = (_mat3.scale_vector(image, safe_divide(one, size)) for image, size in zip(images, s, strict=True))

    product = _mat3.cross(u0, u1)
    product = _mat3.scale_vector(product, safe_divide(one, safe_sqrt(_mat3.dot(product, product))))
    sign = jnp.where(_mat3.dot(u2, product) < 0, -one, one)
    is_flat = s[2] < limit
    reflected = _mat3.scale_vector(u2, sign)
    u2 = tuple(jnp.where(is_flat, x, y) for x, y in zip(product, reflected, strict=True))
    is_line = (s[0] < limit) | (s[1] < limit) | (limit == 0)
    left = _mat3.where(is_line, _mat3.identity_like(a), _mat3.transpose((u0, u1, (u2[0], u2[1], u2[2]))))
    return _mat3.stack(_mat3.newton_schulz(_mat3.multiply(left, axes)))


def _rolled(condition: jax.Array, v: Vec3) -> Vec3:
    x, y, z = v
    return jnp.where(condition, y, x), jnp.where(condition, z, y), jnp.where(condition, x, z)

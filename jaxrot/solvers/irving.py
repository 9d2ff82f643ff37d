"""The stabilised polar decomposition of Irving et al. 2004, as Müller et al. 2016 print it for comparison."""

import jax
import jax.numpy as jnp

from jaxrot._algebra import jacobi, mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_divide, safe_sqrt
from jaxrot._algebra.select import constant_like

# A singular value below this fraction of the largest counts as zero. In float32 the paper's 1e-4 is below √eps, the
# noise of the root of an eigenvalue of AᵀA. With it a matrix of rank 2 would be divided by noise.
_RANK_TOLERANCE = {"float32": 1e-3, "float64": 1e-4}


def solve(a: Mat3) -> Mat3:
    """The rotation U Vᵀ, V the eigenvectors of AᵀA, U = A V diag(1/s), reflected along the smallest s if det U < 0.

    Selects replace the cases of the source. If one singular value is zero, its column of U is the vector product of the
    other two. If two or three are zero, U = 1 and the result is Vᵀ, some rotation.

    Returns:
        Rotations. The error and the defect of orthogonality grow like eps (s1/s3)², because s is accurate to eps s1²/s.
        At rank 1 the result is a rotation and not a nearest one.

    Cost: about 560 flops, 24 square roots and as many divisions.
    Source: Irving, Teran and Fedkiw 2004; Müller et al. 2016, appendix C. Its constants 1e-15 and 1e-4 are absolute.
    Here the scale is removed: the first is not needed, and the second is relative to the largest singular value. The
    source tests the determinant of V; here it is +1, because V is a product of rotations.
    """
    eigenvalues, axes = jacobi.symmetric_eigen(mat3.transpose_multiply(a, a))
    s = (safe_sqrt(eigenvalues[0]), safe_sqrt(eigenvalues[1]), safe_sqrt(eigenvalues[2]))
    limit = _RANK_TOLERANCE[a[0][0].dtype.name] * jnp.maximum(jnp.maximum(s[0], s[1]), s[2])
    # The order of the axes is free. Roll the frame until the smallest singular value comes last.
    is_first = (s[0] < s[1]) & (s[0] < s[2])
    is_second = ~is_first & (s[1] < s[2])
    for condition in (is_first | is_second, is_second):
        (s, axes) = _rolled(condition, s), jacobi.rolled(condition, axes)
    images = [mat3.apply(a, axis) for axis in axes]
    one = constant_like(limit, 1)
    u0, u1, u2 = (mat3.scale_vector(image, safe_divide(one, size)) for image, size in zip(images, s, strict=True))

    product = mat3.cross(u0, u1)
    product = mat3.scale_vector(product, safe_divide(one, safe_sqrt(mat3.dot(product, product))))
    sign = jnp.where(mat3.dot(u2, product) < 0, -one, one)
    is_flat = s[2] < limit
    reflected = mat3.scale_vector(u2, sign)
    u2 = tuple(jnp.where(is_flat, x, y) for x, y in zip(product, reflected, strict=True))
    is_line = (s[0] < limit) | (s[1] < limit) | (limit == 0)
    left = mat3.where(is_line, mat3.identity_like(a), mat3.transpose((u0, u1, (u2[0], u2[1], u2[2]))))
    return mat3.newton_schulz(mat3.multiply(left, axes))


def _rolled(condition: jax.Array, v: Vec3) -> Vec3:
    x, y, z = v
    return jnp.where(condition, y, x), jnp.where(condition, z, y), jnp.where(condition, x, z)

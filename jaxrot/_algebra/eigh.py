"""Eigenvalues and eigenvectors of symmetric 3×3 matrices, without branches or loops, also for equal eigenvalues."""

import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import mat3
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.jacobi import diagonalising
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_divide, safe_sqrt
from jaxrot._algebra.select import is_positive, sign_of

# Newton's method starts at 2, and the largest root of the cubic is within 0.27 of that. After 4 steps it is off by
# 7e-12.
_NEWTON_STEPS = 5


def eigen(m: Mat3) -> tuple[Vec3, Mat3]:
    """Returns the eigenvalues of a symmetric matrix, the largest first, and unit eigenvectors as rows of a rotation.

    Either the largest or the smallest eigenvalue is farther from the middle one. That one is a simple root of the
    characteristic cubic, and Newton's method finds it from 2. Its eigenvector is the largest column of the adjugate.
    The other two eigenvectors lie in the plane perpendicular to it, and one plane rotation finds them. So no difference
    of roots has to separate two equal or nearly equal eigenvalues.

    The error is a few eps of the spread of the eigenvalues. Where eigenvalues are equal or nearly equal, the vectors
    are one of many bases, but the diagonal matrix in that basis is still accurate.

    Args:
        m: Symmetric matrix; only the upper triangle is read. Its squares must not overflow or underflow.

    Source: Eberly, "A robust eigensolver for 3×3 symmetric matrices", 2014, with Newton's method instead of the
    trigonometric functions.
    """
    mean = mat3.trace(m) / 3
    deviation = mat3.add_to_diagonal(m, -mean)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = deviation
    symmetric: Mat3 = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    size = safe_sqrt(mat3.squared_norm(symmetric) / 6)
    # notation: x are the eigenvalues of deviation/size, between −2 and 2, the roots of x³ − 3x − 2p = 0.
    inverse = safe_divide(jnp.ones_like(size), size)
    xx, xy, xz, yy, yz, zz = (entry * inverse for entry in (xx, xy, xz, yy, yz, zz))
    scaled: Mat3 = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    p = mat3.determinant(scaled) * 0.5
    largest_is_simple = is_positive(p)
    p = jnp.abs(p)
    p = jnp.where(p > 1, jnp.ones_like(p), p)
    root = jnp.full_like(p, 2)
    for _ in range(_NEWTON_STEPS):
        square = root * root
        root = 2 * (square * root + p) / (3 * square - 3)
    root = jnp.where(largest_is_simple, root, -root)
    adjugate = mat3.cofactor(mat3.add_to_diagonal(scaled, -root))
    sizes = [lax.stop_gradient(jnp.abs(adjugate[i][i])) for i in range(3)]
    simple, largest = adjugate[0], sizes[0]
    for i in (1, 2):
        simple = mat3.where(is_positive(sizes[i] - largest), adjugate[i], simple)
        largest = jnp.maximum(largest, sizes[i])
    length = safe_sqrt(mat3.dot(simple, simple))
    x, y, z = (component / length for component in simple)

    # u and v are perpendicular to the axis. The sign keeps the denominator away from 0 (Duff et al. 2017).
    sign = sign_of(z)
    quotient = -1 / (sign + z)
    u: Vec3 = (1 + sign * x * x * quotient, sign * x * y * quotient, -sign * x)
    v: Vec3 = (x * y * quotient, sign + y * y * quotient, -y)
    hu, hv = mat3.apply(scaled, u), mat3.apply(scaled, v)
    uu, uv, vv = mat3.dot(u, hu), mat3.dot(u, hv), mat3.dot(v, hv)
    # Pin these values: their rounding may decide which of two axes comes first. If XLA recomputed them, the axes and
    # the eigenvalues could come in different orders.
    uu, uv, vv = fusion_barrier((uu, uv, vv))
    (cosine, sine), t = diagonalising(uu, uv, vv)
    first_is_smaller = is_positive((vv - t * uv) - (uu + t * uv))
    larger = mat3.add_vectors(
        mat3.scale_vector(u, jnp.where(first_is_smaller, -sine, cosine)),
        mat3.scale_vector(v, jnp.where(first_is_smaller, cosine, sine)),
    )
    # Do not use t here: its sign is arbitrary where uu = vv. Two parts of a program that round it differently would
    # return the larger eigenvalue twice.
    middle, radius = 0.5 * (uu + vv), 0.5 * safe_sqrt((uu - vv) * (uu - vv) + 4 * uv * uv)
    larger_value, smaller_value = middle + radius, middle - radius

    axis: Vec3 = (x, y, z)
    axis0 = mat3.where(largest_is_simple, axis, larger)
    axis1 = mat3.where(largest_is_simple, larger, mat3.cross(axis, larger))
    values = (
        jnp.where(largest_is_simple, root, larger_value),
        jnp.where(largest_is_simple, larger_value, smaller_value),
        jnp.where(largest_is_simple, smaller_value, root),
    )
    axes = (axis0, axis1, mat3.cross(axis0, axis1))
    return mat3.add_vectors(mat3.scale_vector(values, size), (mean, mean, mean)), axes

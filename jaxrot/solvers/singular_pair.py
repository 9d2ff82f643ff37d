"""The default method: one well-separated pair of singular vectors, and the best angle in the plane across it."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxrot._algebra import mat3, quaternion
from jaxrot._algebra.fusion import fusion_barrier
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.quaternion import Quaternion
from jaxrot._algebra.select import constant_like, sign_of

# cos(⅓ arccos r) on [0, 1] to 4e-5 and 2e-9, by Chebyshev interpolation. A Newton step follows.
_COSINE = {
    "float32": (0.8660663295, 0.1653303502, -0.04069119742, 0.009319683897),
    "float64": (0.8660254056, 0.1666663711, -0.04810444145, 0.02460429679, -0.01510727516, 0.009383330571,
                -0.004929691173, 0.001764856874, -0.0003028542016),
}  # fmt: skip


def solve(a: Mat3) -> Mat3:
    """The nearest rotation, to rounding, without a branch, an iteration or a decomposition.

    R maps each right singular vector to its left one. One pair is enough: only the angle about it is then missing.

    1. n, the right singular vector with the better separated eigenvalue λ of AᵀA: the largest or the smallest,
       whichever is further from the middle one. n is the column of the adjugate of AᵀA − λ·1 that cannot vanish.
    2. u = R n up to length: A n if n belongs to the largest singular value, else cof(A) n, for either sign of det A.
    3. Two reflections (half turns, as quaternions) take n to e₃, and u to e₃ or −e₃, whichever is nearer.
    4. The angle about n that makes tr(RᵀA) largest, and R's quaternion from the two reflections and the angle.
    5. If A/2ᵏ is a rotation up to √eps for some k, it replaces R, so that repeated repairs do not drift.
    6. One Newton–Schulz step.

    Rounding of AᵀA, eps s1², tilts v1 towards vⱼ by eps s1²/(s1² − sⱼ²), and R by that times (s1 − sⱼ)/s1, which is
    eps s1/(s1 + sⱼ) ≤ eps κ. The same holds for v3 where it is the separated one, with a factor of √2.

    Returns:
        Rotations that keep every line of the contract; NaN where the matrix is not finite.

    Cost: about 450 flops, 28 divisions and 4 square roots included.
    Source: Wahba's problem on the circle of rotations that map n to u; Smith 1961 for the eigenvalue.
    """
    gram = deviator(a)
    outer = outer_eigenvalue(gram)
    x, y = eigenvector(gram, outer)
    images = reflected(a, x, y)
    axis = image_of_axis(images, outer < 0)
    cosine, sine, trace = half_angle(images, axis)
    r = rotation(a, composed((x, y), axis, cosine, sine), gram, trace)
    return mat3.newton_schulz(r)


class Deviator(NamedTuple):
    """AᵀA − mean·1, without trace.

    Attributes:
        diagonal: xx, yy, zz.
        off_diagonal: yz, xz, xy.
        p: Its Frobenius norm over √6.
        xx: The first entry of AᵀA.
    """

    diagonal: Vec3
    off_diagonal: Vec3
    p: jax.Array
    xx: jax.Array


def deviator(a: Mat3) -> Deviator:
    """AᵀA without its mean."""
    (xx, yy, zz), off_diagonal = mat3.gram(a)
    mean = (xx + yy + zz) * (1 / 3)
    diagonal = xx - mean, yy - mean, zz - mean
    square = 0.5 * mat3.dot(diagonal, diagonal) + mat3.dot(off_diagonal, off_diagonal)
    return Deviator(diagonal, off_diagonal, jnp.sqrt(square * (1 / 3)), xx)


def outer_eigenvalue(gram: Deviator) -> jax.Array:
    """The largest or the smallest eigenvalue of the deviator, whichever is further from the middle one.

    The eigenvalues are 2p cos(⅓ arccos r + 120° k), with r = det/2p³. The separated one has the sign of r. Its cosine
    t ≥ √¾ is a simple root of 4t³ − 3t = |r|: a polynomial gives it roughly, and a Newton step to rounding.
    """
    (xx, yy, zz), (yz, xz, xy), p, _ = gram
    square = p * p
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    p = p + p
    r = determinant / (square * p + float(jnp.finfo(p.dtype).tiny))
    size = jnp.abs(r)
    *lower, t = _COSINE[r.dtype.name]
    for coefficient in reversed(lower):
        t = t * size + coefficient
    square = 4 * (t * t)
    return jnp.where(r < 0, -p, p) * ((square + square) * t + size) / (3 * square - 3)


def eigenvector(gram: Deviator, eigenvalue: jax.Array, *, is_chosen: bool = True) -> tuple[jax.Array, jax.Array]:
    """Returns x, y with (x, y, 1) parallel to n + e₃‖n‖, n the eigenvector of a separated eigenvalue (e₃ if gram is 0).

    n is a column of the adjugate of gram − eigenvalue·1: the one with the largest diagonal entry. So nothing cancels,
    and n is far from −e₃.

    Args:
        gram: The deviator.
        eigenvalue: A separated one: its distance from the other two is comparable with their size.
        is_chosen: True takes the column that cannot vanish; False always takes the third one, which may be 0.
    """
    (xx, yy, zz), (yz, xz, xy), *_ = gram
    xx, yy, zz = xx - eigenvalue, yy - eigenvalue, zz - eigenvalue
    third = (xy * yz - yy * xz, xy * xz - xx * yz, xx * yy - xy * xy + _guard(xx))
    x, y, z = third
    if is_chosen:
        first = (yy * zz - yz * yz, xz * yz - zz * xy, x)
        second = (first[1], xx * zz - xz * xz, y)
        # −1 for the first column, 0 for the second, 1 or 2 for the third, over a number ≥ 1.
        is_third, is_first = jnp.maximum(first[0], second[1]) < z, first[0] >= second[1]
        third_chosen = is_third.astype(x.dtype)
        index = third_chosen + third_chosen - is_first.astype(x.dtype)
        index = fusion_barrier(index, 1 + gram.p)
        x, y, z = mat3.where(index > 0, third, mat3.where(index < 0, first, second))
    length = z + jnp.sqrt(x * x + y * y + z * z)
    x, y = fusion_barrier((x, y), length)
    return x, y


class Images(NamedTuple):
    """A e, A g and A n for the right-handed frame (e, g, n)."""

    e: Vec3
    g: Vec3
    n: Vec3


def reflected(a: Mat3, x: jax.Array, y: jax.Array) -> Images:
    """The columns of A·(e, g, n), where 1 − 2 m mᵀ/‖m‖² of m = (x, y, 1) takes the axes to e, g and −n."""
    columns = mat3.transpose(a)
    half = 0.5 * (x * x + y * y + 1)
    in_plane = mat3.add_vectors(mat3.scale_vector(columns[0], x), mat3.scale_vector(columns[1], y))
    am = fusion_barrier(mat3.add_vectors(in_plane, columns[2]), half)
    return Images(
        mat3.subtract(columns[0], mat3.scale_vector(am, x)),
        mat3.subtract(columns[1], mat3.scale_vector(am, y)),
        mat3.subtract(am, columns[2]),
    )


def image_of_axis(images: Images, is_smallest: jax.Array, *, is_nearer: bool = True) -> Vec3:
    """(x, y, s) parallel to u + s e₃‖u‖ for u = R n, s the sign of its third component; (0, 0, 1) where u = 0."""
    x, y, z = mat3.where(is_smallest, mat3.cross(images.e, images.g), images.n)
    length = jnp.abs(z) if is_nearer else z
    x, y, z = fusion_barrier(
        (x, y, z), length + jnp.sqrt(mat3.dot((x, y, z), (x, y, z))) + float(jnp.finfo(x.dtype).tiny)
    )
    return x, y, sign_of(z) if is_nearer else constant_like(z, 1)


def half_angle(images: Images, axis: Vec3) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Cosine and sine of half the best angle about n, times one number, and tr(RᵀA).

    The trace is u·An + c cos φ + d sin φ, at best u·An + √(c² + d²). Where A does not determine the angle, c and d are
    rounding. They are computed once, so that every entry of R has the same angle.
    """
    x, y, s = axis
    e, g, n = images
    half = 0.5 * (x * x + y * y + 1)
    me, mg = mat3.dot(axis, e), mat3.dot(axis, g)
    c = (e[0] + s * g[1]) * half - (x * me + s * y * mg)
    d = (s * e[1] - g[0]) * half - (s * y * me - x * mg)
    c, d = fusion_barrier((c, d), half)
    best = jnp.sqrt(c * c + d * d)
    large = best + jnp.abs(c) + _guard(c)
    is_behind = c < 0
    trace = best + (mat3.dot(axis, n) / half - s * n[2])
    return jnp.where(is_behind, d, large), jnp.where(is_behind, large, d), trace


def composed(m: tuple[jax.Array, jax.Array], axis: Vec3, cosine: jax.Array, sine: jax.Array) -> Quaternion:
    """The quaternion of R, any length but 0: (x', y', s) ∘ (cosine + sine k) ∘ (x, y, 1).

    Two reflections are two half turns about their axes. Where s = −1 the second one goes to the other side: then it is
    (x', −y', 1), and a half turn about e₁ comes last.
    """
    x, y = m
    x1, y1, s = axis
    y1 = s * y1
    px, py = cosine * x - sine * y, cosine * y + sine * x
    w = -(x1 * px + y1 * py + cosine)
    i = y1 * cosine - py - x1 * sine
    j = px - x1 * cosine - y1 * sine
    k = x1 * py - y1 * px - sine
    is_flipped = s < 0
    q = (
        jnp.where(is_flipped, -i, w),
        jnp.where(is_flipped, w, i),
        jnp.where(is_flipped, -k, j),
        jnp.where(is_flipped, j, k),
    )
    return fusion_barrier(q, jnp.abs(cosine) + jnp.abs(sine))


def rotation(a: Mat3, q: Quaternion, gram: Deviator, trace: jax.Array, *, is_kept: bool = True) -> Mat3:
    """The matrix of q, orthogonal to a few eps; or A divided by its power of two, if that is a rotation up to √eps.

    A scaled rotation is 2 or 4 times a rotation: AᵀA is 4 or 16 times 1, and tr(RᵀA) is 6 or 12. For −R it is 2 or 4.
    """
    r, norm = quaternion.to_scaled_rotation(q), quaternion.squared_norm(q)
    if is_kept:
        is_large = (gram.xx > 8).astype(norm.dtype)
        power = 2 + (is_large + is_large)
        off = gram.xx - power * power
        is_rotation = (gram.p * gram.p + off * off < 4 * float(jnp.finfo(norm.dtype).eps)) & (trace > 2 * power)
        # The sign of the divisor encodes the choice, so that XLA computes the choice only once.
        norm = fusion_barrier(jnp.where(is_rotation, -power, norm))
        r = mat3.where(norm < 0, a, r)
        norm = jnp.abs(norm)
    return fusion_barrier(r, norm)


def _guard(x: jax.Array) -> float:
    """Far below eps; its square is far above the smallest number."""
    return float(jnp.finfo(x.dtype).tiny) ** 0.4

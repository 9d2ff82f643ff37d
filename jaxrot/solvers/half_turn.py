"""The default method: the well-conditioned one of R(A) and R(−A), half a turn, two exact corrections."""

import jax
import jax.numpy as jnp

from jaxrot import _definite, _mat3, _quaternion
from jaxrot._choice import choose, computed_once, constant_like, index_of_largest, sign_of
from jaxrot._mat3 import Mat3, Vec3
from jaxrot._quaternion import Quaternion
from jaxrot._scaling import safe_divide, scaled
from jaxrot.steps.exact_angle import turn_about

# The stages that keep a promise each and that `solve` can leave out, to see what they cost.
GUARDS = ("scale", "largest component", "inversion", "weakest axis", "polish", "renormalisation")

_NEWTON_STEPS = {"float32": 3, "float64": 4}

# cos(⅔ arccos u) on [0, 1] to 3e-9 (Chebyshev interpolation). What is missing tilts the axis of the half turn, and the
# tilt's square times κ is left to the polish: the tilt must be below √eps. With 1e-6 float64 is off by 150 bounds.
_COSINE = (
    0.500000003,
    0.57734972,
    -0.111095683,
    0.053288656,
    -0.031961295,
    0.019675718,
    -0.010325493,
    0.003707686,
    -0.000639314,
)


def solve(matrix: jax.Array, *, without: tuple[str, ...] = ()) -> jax.Array:
    """The nearest rotation, to rounding, without a branch, an iteration to convergence or a decomposition.

    1. f = |s1|+|s2|+|s3|, from a fixed point that keeps its digits, and σ = sign det A.
    2. The quaternion of R(σA), the null vector of f·1 − N(σA), N Davenport's matrix. All singular values of σA are
       positive: at most one gap is small, and the null vector is wrong about that one axis only. *largest component*:
       it is solved for with its largest component 1, not with the first one, which is 0 at a half turn.
    3. *inversion*: where σ = −1, R(A) is R(σA) after half a turn about the weakest axis of the stretch.
    4. *weakest axis*: the best angle about the axis of the smallest gap. It is the best of a whole circle, so that
       it makes good what 2 and 3 left open there, the sign of a determinant that is rounding included.
    5. *polish*: one Newton step; an axis that A does not determine keeps its angle.
    6. *renormalisation*: one Newton–Schulz step.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.
        without: Names in `GUARDS` of stages to leave out, static; what remains has a smaller domain.

    Returns:
        (..., 3, 3) rotations that keep every line of the contract; NaN where the matrix is not finite.

    Cost: about 1,100 flops in float32 and float64 alike, 87 divisions and 14 square roots.
    Source: Markley 1993 for the quartic; Higham and Noferini 2016 for the null vector; Wahba's problem on a circle of
    rotations. That R(A) and R(−A) differ by half a turn: −A = R(−A) S makes R(A) = R(−A) R(−S), and −1 + 2 n nᵀ
    maximises −tr(RᵀS).
    """
    a = _mat3.components(matrix)
    if "scale" not in without:
        a = scaled(a)
    f = signed_sum(a)
    q = nearest_to_definite(a, f, is_chosen="largest component" not in without)
    if "inversion" not in without:
        q = half_turn(a, q, f)
    if "weakest axis" not in without:
        q = turn_about_weakest_axis(a, q)
    if "polish" not in without:
        q = polish(a, q)
    r = _quaternion.to_rotation(q)
    if "renormalisation" not in without:
        r = _mat3.newton_schulz(r)
    return _mat3.stack(r)


def signed_sum(a: Mat3) -> jax.Array:
    """σ(|s1|+|s2|+|s3|) with the sign σ of det A.

    With I = ‖A‖², K = ‖cof A‖², J = |det A| the sum solves f = √(I + 2√(K + 2Jf)), positive terms only: nothing cancels
    and the root is simple where that of the quartic is double. Newton's method, from the upper bound √(3I).
    """
    # notation: I (`square`), K (`minors`), J (`volume`); m = s1s2 + s1s3 + s2s3.
    cofactor = _mat3.cofactor(a)
    square, minors = _mat3.squared_norm(a), _mat3.squared_norm(cofactor)
    determinant = _mat3.dot(a[0], cofactor[0])
    volume = jnp.abs(determinant)
    info = jnp.finfo(square.dtype)
    sign = sign_of(determinant)
    f = jnp.sqrt(3 * square)
    steps = _NEWTON_STEPS[square.dtype.name]
    for step in range(steps):
        m = jnp.maximum(jnp.sqrt(minors + 2 * volume * f), float(info.eps) * square)
        g = square + 2 * m
        gm = jnp.sqrt(g) * m
        # The sign goes into the last quotient, so that it is decided once.
        numerator = (g * m - f * volume) * (sign if step == steps - 1 else 1)
        f = numerator / (gm - volume + float(info.tiny))
    return f


def nearest_to_definite(a: Mat3, f: jax.Array, *, is_chosen: bool = True) -> Quaternion:
    """The quaternion of R(σA), any length but 0: the null vector of f·1 − N(σA).

    A half turn in front makes its largest component the first one; the other three then solve a definite system. Which
    one that is, the largest diagonal entry of the adjugate tells; shifted by what rounding does to f, so that it
    means something where two eigenvalues of N are equal.

    Args:
        a: The matrices, their scale removed.
        f: `signed_sum(a)`.
        is_chosen: Whether there is a half turn in front, static. Without it the system is singular where R is a half
            turn, and the first component, 1 here, is none of the quaternion's.
    """
    size, sign = jnp.abs(f), sign_of(f)
    eps, tiny = float(jnp.finfo(f.dtype).eps), float(jnp.finfo(f.dtype).tiny)
    shifted = size * (1 + 16 * eps)
    cofactor, gram = _mat3.cofactor(a), _mat3.transpose_multiply(a, a)
    x, y, z = (
        sign * ((shifted * shifted + _mat3.squared_norm(a)) * a[i][i] - 2 * _mat3.dot(a[i], gram[i]))
        + 2 * shifted * cofactor[i][i]
        for i in range(3)
    )
    k = (
        computed_once(index_of_largest((x + y + z, x - y - z, y - x - z, z - x - y)))
        if is_chosen
        else constant_like(f, 0)
    )

    one = constant_like(f, 1)
    flips = (choose(k, one, one, -one, -one), choose(k, one, -one, one, -one))
    rows = [_mat3.scale_vector(row, sign * flip) for row, flip in zip(a, (*flips, flips[0] * flips[1]), strict=True)]
    b = (rows[0], rows[1], rows[2])
    bound = size * (1 + 4 * eps) + tiny
    xy, xz, yz = -(b[0][1] + b[1][0]), -(b[0][2] + b[2][0]), -(b[1][2] + b[2][1])
    h = (
        (bound + (b[1][1] + b[2][2] - b[0][0]), xy, xz),
        (xy, bound + (b[0][0] + b[2][2] - b[1][1]), yz),
        (xz, yz, bound + (b[0][0] + b[1][1] - b[2][2])),
    )
    x, y, z = _definite.solve(h, _mat3.axial(b))
    # e_k ∘ (1, x, y, z), up to its sign.
    return (
        choose(k, one, -x, -y, -z),
        choose(k, x, one, z, -y),
        choose(k, y, -z, one, x),
        choose(k, z, y, -x, one),
    )


def half_turn(a: Mat3, q: Quaternion, f: jax.Array) -> Quaternion:
    """Where f < 0: q, the quaternion of R(−A), after half a turn about the weakest axis of its stretch; unit length."""
    h, _ = _gaps_and_torque(a, q)
    # The stretch is σ(tr(B)·1 − H): without their traces the two differ by the sign alone.
    sign = -sign_of(f)
    deviator = _mat3.scale(_mat3.add_to_diagonal(h, _mat3.trace(h) * (-1 / 3)), sign)
    x, y, z = _definite.null_vector(_mat3.add_to_diagonal(deviator, -_smallest_eigenvalue(deviator)))
    turned = _quaternion.product(q, (jnp.zeros_like(x), x, y, z))
    w, x, y, z = (jnp.where(f < 0, new, old) for new, old in zip(turned, q, strict=True))
    length = jnp.sqrt(_quaternion.squared_norm((w, x, y, z)))
    return (w / length, x / length, y / length, z / length)


def turn_about_weakest_axis(a: Mat3, q: Quaternion) -> Quaternion:
    """The best angle about the axis of the smallest gap: tr(RᵀA) is largest on that whole circle of rotations."""
    h, torque = _gaps_and_torque(a, q)
    return _quaternion.product(q, turn_about(h, torque, _definite.null_vector(h), flat=0.5))


def polish(a: Mat3, q: Quaternion) -> Quaternion:
    """One Newton step; an axis whose gap is below 8 eps f moves by no more than it is determined."""
    # With H formed again in every quotient the torque of matrices near −R was up to 13 times its bound in float64.
    h, torque = computed_once(_gaps_and_torque(a, q))
    info = jnp.finfo(q[0].dtype)
    trace = jnp.abs(h[0][0] + h[1][1] + h[2][2]) * 0.5
    x, y, z = _definite.solve(_mat3.add_to_diagonal(h, 8 * float(info.eps) * trace + float(info.tiny) ** 0.5), torque)
    return _quaternion.product(q, (jnp.ones_like(x), 0.5 * x, 0.5 * y, 0.5 * z))


def _gaps_and_torque(a: Mat3, q: Quaternion) -> tuple[Mat3, Vec3]:
    """H = tr(B)·1 − sym B and d = vee(B − Bᵀ) of B = R(q)ᵀA, times q·q: where they are used their scale cancels."""
    b = _mat3.transpose_multiply(_quaternion.to_scaled_rotation(q), a)
    return _mat3.gap_matrix(b), _mat3.axial(b)


def _smallest_eigenvalue(deviator: Mat3) -> jax.Array:
    """The smallest eigenvalue of a symmetric matrix D without trace, to 3e-9 of the spread of the three.

    It is −2p cos(⅓ arccos(−r)), p² = ‖D‖²/6, r = det D/2p³ (Smith 1961). With u = √((1−r)/2) the cosine is
    cos(⅔ arccos u), which has no singularity on [0, 1].
    """
    square = _mat3.squared_norm(deviator) / 6
    p = jnp.sqrt(square)
    r = jnp.clip(safe_divide(_mat3.determinant(deviator), 2 * square * p), -1, 1)
    u = jnp.sqrt((1 - r) * 0.5)
    cosine = jnp.full_like(u, _COSINE[-1])
    for coefficient in reversed(_COSINE[:-1]):
        cosine = cosine * u + coefficient
    return computed_once(-2 * p * cosine)

"""Dense 9×9 matrices for Newton solvers: the Jacobian of the nearest rotation and the Hessian of ‖A − R‖²."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jax.typing import ArrayLike

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_divide
from jaxrot._algebra.select import exchange
from jaxrot._compiled import compiled, exportable
from jaxrot._derivative.overflow import normalising_factor, saturate
from jaxrot._derivative.rule import inverse_gap_matrix, stretch_tangent
from jaxrot._inputs import check_choice, check_damping, check_flag, check_matrix
from jaxrot._nearest import nearest
from jaxrot._svd import decomposed, reciprocal_gaps
from jaxrot.solvers import DEFAULT_METHOD, METHODS


@exportable
class TwistModes(NamedTuple):
    """The eigenpairs of the Jacobian of the nearest rotation with nonzero eigenvalues.

    Attributes:
        eigenvalues: 2/(s2+s3), 2/(s1+s3), 2/(s1+s2), shape (..., 3), the largest first; damped ones are 0.
        modes: U [eᵢ]× Vᵀ/√2, shape (..., 3, 3, 3), orthonormal. The first of the last three axes counts the modes.
    """

    eigenvalues: jax.Array
    modes: jax.Array


def rotation_jacobian(matrix: ArrayLike, *, method: str = DEFAULT_METHOD, damping: float = 0.0) -> jax.Array:
    """Returns the Jacobian of the nearest rotation as a 9×9 matrix, ∂vec(R)/∂vec(A), in closed form.

    vec goes row by row: vec(Ṙ) = J vec(Ȧ). J = T H⁻¹ Tᵀ with H = tr(S)·1 − S and S = RᵀA. The rows of T are e_n × r_m,
    where r_m are the rows of R. J is symmetric positive semidefinite of rank 3.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        method: A name in `METHODS`, for R. Static.
        damping: Relative damping of H⁻¹, as for `nearest_rotation`. Static.

    Returns:
        J, shape (..., 9, 9), dtype of `matrix`, in the unit of 1/A. J is exactly symmetric, and inf where it exceeds
        the dtype. Accuracy and damping are those of the derivative of `nearest_rotation`.

    Raises:
        ValueError: Wrong shape, unknown method, negative damping.
        TypeError: Complex or non-numeric matrix, traced method or damping.

    Uniqueness:
        As for `nearest_rotation`.

    Derivative:
        The second derivative of R.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> [round(x) for x in jnp.linalg.eigvalsh(jaxrot.rotation_jacobian(jnp.eye(3))).tolist()]
        [0, 0, 0, 0, 0, 0, 1, 1, 1]

    Source: Kim and Eberle, "Dynamic deformables", 2020 (the rotation gradient), with H instead of singular vectors.
    """
    method = check_choice(method, "method", METHODS)
    return _rotation_jacobian(check_matrix(matrix), method=method, damping=check_damping(damping))


@compiled
def _rotation_jacobian(matrix: jax.Array, *, method: str, damping: float) -> jax.Array:
    # Order 1: the Jacobian is a first derivative. So the derivative of this R is a second one, and saturates as such.
    rotation = nearest(matrix, method, damping, 1)
    r = mat3.components(rotation)
    return _quadratic_form(r, inverse_gap_matrix(mat3.components(matrix), r, damping=damping))


def twist_modes(matrix: ArrayLike) -> TwistModes:
    """Returns the twist modes: the three eigenpairs, of nonzero eigenvalue, of the Jacobian of the nearest rotation R.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.

    Returns:
        (eigenvalues, modes). A change of A along a mode changes R along that mode, 2/(sᵢ+sⱼ) times as much, sᵢ the
        signed singular values. It is damped to 0 if sᵢ+sⱼ is below about 64 eps (s1+s2+s3). NaN or inf gives NaN.

    Raises:
        ValueError: Wrong shape.
        TypeError: Complex or non-numeric matrix.

    Uniqueness:
        Where singular values are equal, the modes are one of many bases.

    Derivative:
        As for `rotation_variant_svd`.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> [round(x, 3) for x in jaxrot.twist_modes(jnp.diag(jnp.array([3.0, 1.0, 1.0]))).eigenvalues.tolist()]
        [1.0, 0.5, 0.5]

    Source: Smith, de Goes and Kim, "Analytic eigensystems for isotropic distortion energies", 2019.
    """
    return _twist_modes(check_matrix(matrix))


@compiled
def _twist_modes(matrix: jax.Array) -> TwistModes:
    left, s, normalised, right = decomposed(matrix, 1)
    u, v = mat3.components(left), mat3.components(right)
    factor = normalising_factor(mat3.components(matrix))
    gaps = reciprocal_gaps(s, normalised, factor, 1)
    eigenvalues = 2 * jnp.stack(gaps.over_sums, axis=-1) * saturate(factor, gaps.norm, 0)[..., None]
    axes = mat3.identity_like(u)
    modes = [mat3.multiply(mat3.multiply_skew(u, axis), mat3.transpose(v)) for axis in axes]
    stacked = jnp.stack([mat3.stack(mat3.scale(mode, 0.5**0.5)) for mode in modes], axis=-3)
    return TwistModes(eigenvalues, stacked)


def arap_hessian(matrix: ArrayLike, *, psd: bool = True) -> jax.Array:
    """Returns the Hessian of the as-rigid-as-possible energy ‖A − R(A)‖² as a 9×9 matrix, projected by default.

    The gradient is 2(A − R), the Hessian 2(1 − J) with J of `rotation_jacobian`. Six eigenvalues are 2, the others
    2 − 4/(sᵢ+sⱼ) for the signed singular values sᵢ. These are negative where A is so compressed that sᵢ+sⱼ < 2. There
    an unprojected Newton step may increase the energy.

    Args:
        matrix: A, the deformation gradient, real, shape (..., 3, 3), near the scale of a rotation.
        psd: Replace negative eigenvalues by 0, which gives the nearest positive semidefinite matrix. Static.

    Returns:
        The Hessian, shape (..., 9, 9), dtype of `matrix`, vec row by row; exactly symmetric.

    Raises:
        ValueError: Wrong shape.
        TypeError: Complex or non-numeric matrix; `psd` is not a static bool.

    Uniqueness:
        Where R is not unique the energy is not differentiable. This is the Hessian of one of its smooth branches. The
        eigenvalue about the free axis is 0 if projected. It is 2 if not, because J is damped there.

    Derivative:
        To first order, right at equal singular values too. If projected, not differentiable where sᵢ+sⱼ = 2.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> [round(x) for x in jnp.linalg.eigvalsh(jaxrot.arap_hessian(0.5 * jnp.eye(3), psd=False)).tolist()]
        [-2, -2, -2, 2, 2, 2, 2, 2, 2]

    Source: Smith, de Goes and Kim 2019; Lin et al., "Isotropic ARAP energy using Cauchy–Green invariants", 2022.
    """
    return _arap_hessian(check_matrix(matrix), psd=check_flag(psd, "psd"))


@compiled
def _arap_hessian(matrix: jax.Array, *, psd: bool) -> jax.Array:
    r = mat3.components(nearest(matrix, DEFAULT_METHOD, 0.0, 1))
    inverse = mat3.components(_clamped(matrix)) if psd else inverse_gap_matrix(mat3.components(matrix), r)
    jacobian = _quadratic_form(r, inverse)
    return 2 * (jnp.broadcast_to(jnp.eye(9, dtype=jacobian.dtype), jacobian.shape) - jacobian)


@jax.custom_jvp
def _clamped(matrix: jax.Array) -> jax.Array:
    """H⁻¹ with its eigenvalues 1/g clamped to at most ½: V φ(g) Vᵀ with φ(g) = 1/max(g, 2).

    Above ½ those of 2(1 − J) would be negative. A clamped inverse is never large, so it needs no damping.
    """
    _, s, _, right = decomposed(matrix, 1)
    return mat3.stack(_in_axes(right, _diagonal(_clamped_inverses(_gaps(s)))))


@_clamped.defjvp
def _clamped_jvp(primals, tangents):
    # Divided differences of φ (Daleckii and Krein). The derivative of V is damped where singular values are equal, but
    # that of V φ Vᵀ exists there.
    (matrix,), (matrix_dot,) = primals, tangents
    left, s, _, right = decomposed(matrix, 1)
    v = mat3.components(right)
    rotation = mat3.multiply(mat3.components(left), mat3.transpose(v))
    stretch_dot = stretch_tangent(mat3.components(matrix), rotation, mat3.components(matrix_dot), order=1)
    h_dot = mat3.gap_matrix(mat3.transpose_multiply(v, mat3.multiply(stretch_dot, v)))
    gaps = _gaps(s)
    tangent = [mat3.multiply_entries(row, _slopes(gap, gaps)) for row, gap in zip(h_dot, gaps, strict=True)]
    return _clamped(matrix), mat3.stack(_in_axes(right, (tangent[0], tangent[1], tangent[2])))


def _gaps(singular_values: jax.Array) -> Vec3:
    largest = jnp.finfo(singular_values.dtype).max
    # Clamp before and after the sums. Singular values and their sums may be infinite for a finite matrix, and a later
    # difference of two infinities would be NaN.
    halves = lax.clamp(-largest, singular_values, largest) * 0.5
    s1, s2, s3 = halves[..., 0], halves[..., 1], halves[..., 2]
    x, y, z = (2 * lax.clamp(-largest / 4, gap, largest / 4) for gap in (s2 + s3, s3 + s1, s1 + s2))
    return x, y, z


def _clamped_inverses(gaps: Vec3) -> Vec3:
    x, y, z = (1 / _at_least_two(gap) for gap in gaps)
    return x, y, z


def _at_least_two(gap: jax.Array) -> jax.Array:
    # A choice instead of `jnp.maximum`, whose derivative fails on jax 0.10 inside `vmap` on a mesh with Explicit axes.
    return jnp.where(gap < 2, jnp.full_like(gap, 2), gap)


def _slopes(gap: jax.Array, gaps: Vec3) -> Vec3:
    """(φ(g) − φ(gᵢ))/(g − gᵢ) for the three gᵢ, and φ′ where g = gᵢ. If both are clamped 0, if neither −1/(g gᵢ)."""

    def slope(other: jax.Array) -> jax.Array:
        smaller, larger = exchange(gap > other, gap, other)
        # The fraction of the interval from the smaller to the larger gap on which φ is not constant.
        part = safe_divide(jnp.where(larger > 2, larger - 2, 0), larger - smaller)
        share = jnp.where(smaller >= 2, jnp.ones_like(gap), part)
        return -share / (_at_least_two(larger) * _at_least_two(smaller))

    x, y, z = (slope(other) for other in gaps)
    return x, y, z


def _diagonal(v: Vec3) -> Mat3:
    zero = jnp.zeros_like(v[0])
    return ((v[0], zero, zero), (zero, v[1], zero), (zero, zero, v[2]))


def _in_axes(axes: jax.Array, m: Mat3) -> Mat3:
    v = mat3.components(axes)
    return mat3.multiply(v, mat3.multiply(m, mat3.transpose(v)))


def _quadratic_form(rotation: Mat3, m: Mat3) -> jax.Array:
    """T M Tᵀ, shape (..., 9, 9), for a symmetric M; the rows of T are e_n × r_m, those of [r_m]×, r_m the rows of R.

    Broadcasting lets XLA write the 81 entries in one pass instead of 81.
    """
    t = jnp.concatenate([mat3.stack(mat3.skew(row)) for row in rotation], axis=-2)
    product = _product(_product(t, mat3.stack(mat3.symmetric(m))), jnp.swapaxes(t, -1, -2))
    # (TM)Tᵀ and its transpose differ in rounding; the mean is exactly symmetric.
    return 0.5 * (product + jnp.swapaxes(product, -1, -2))


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """The matrix product of (..., n, 3) and (..., 3, m) by elementwise products: accelerators may round `@` to TF32."""
    x, y, z = (a[..., i][..., None] * b[..., i, :][..., None, :] for i in range(3))
    return x + y + z

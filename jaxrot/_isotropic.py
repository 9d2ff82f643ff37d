"""Isotropic functions of a matrix: functions of its signed singular values, with the correct derivatives."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxrot._algebra import mat3
from jaxrot._algebra.mat3 import Mat3
from jaxrot._compiled import ByIdentity, compiled
from jaxrot._derivative.divided_differences import divided_differences
from jaxrot._inputs import check_choice, check_function, check_matrix
from jaxrot._svd import decomposed, tangent_in_axes

# The values of `vectors`, and the matrix that each stands for.
_VECTORS = {"left_right": "U diag(φ) Vᵀ", "left": "U diag(φ) Uᵀ", "right": "V diag(φ) Vᵀ"}

# notation: functions of the singular values of one matrix, shape (3,), and of the parameters that they close over.
_Function = Callable[..., jax.Array]


def isotropic_energy(matrix: ArrayLike, energy: Callable[[jax.Array], jax.Array]) -> jax.Array:
    """Returns ψ(s1, s2, s3), a function of the signed singular values of a 3×3 matrix, with exact gradient and Hessian.

    Use it for the energy density of an isotropic hyperelastic material. A composition with `signed_singular_values` has
    a wrong Hessian at equal singular values, for example at rest.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        energy: ψ, a JAX function from the signed singular values s1 ≥ s2 ≥ |s3| of one matrix, shape (3,), to a scalar.
            It must be symmetric in its arguments. It may close over traced parameters, and is differentiated with
            respect to them too. Static: each function object is compiled once.

    Returns:
        ψ, shape (...), dtype of `matrix`. NaN for a matrix with NaN or inf.

    Raises:
        ValueError: Wrong shape of the matrix or of the result of `energy`.
        TypeError: Complex or non-numeric matrix, `energy` not callable.

    Derivative:
        The gradient is U diag(∂ψ) Vᵀ. The Hessian is exact at equal, nearly equal, zero and negative singular values if
        ψ is smooth there as a function of A. If ψ changes when two arguments change their signs, it is not smooth at
        s2+s3 = 0; the Hessian is damped there as in `nearest_rotation`. Third derivatives are damped at equal singular
        values.

    Accuracy:
        Gradient 64 eps, Hessian 1,024 eps, relative to the norms of the derivatives of this and of the next order.

    Example:
        >>> import jax, jax.numpy as jnp, jaxrot
        >>> hencky = lambda s: jnp.sum(jnp.log(s) ** 2)
        >>> hessian = jax.hessian(lambda F: jaxrot.isotropic_energy(F, hencky))(jnp.eye(3)).reshape(9, 9)
        >>> [round(x) for x in jnp.linalg.eigvalsh(hessian).tolist()]
        [0, 0, 0, 2, 2, 2, 2, 2, 2]

    Source: Smith, de Goes and Kim, "Analytic eigensystems for isotropic distortion energies", 2019.
    """
    return _isotropic_energy(check_matrix(matrix), energy=ByIdentity(check_function(energy, "energy")))


def isotropic_map(
    matrix: ArrayLike, function: Callable[[jax.Array], jax.Array], *, vectors: str = "left_right"
) -> jax.Array:
    """Returns U diag(φ(s)) Vᵀ for a function φ of the signed singular values of A = U diag(s) Vᵀ.

    Use it for stresses, logarithmic strains, or to clamp singular values in plasticity. A composition with
    `rotation_variant_svd` has a wrong derivative at equal singular values.

    Args:
        matrix: A, real, shape (..., 3, 3), any scale.
        function: φ, a JAX function from the signed singular values s1 ≥ s2 ≥ |s3| of one matrix, shape (3,), to shape
            (3,). A permutation of its arguments must permute its results. It may close over traced parameters. Static.
        vectors: "left_right" for U diag(φ) Vᵀ; "right" for V diag(φ) Vᵀ, a function of the right stretch; "left" for
            U diag(φ) Uᵀ, a function of the left stretch. Static.

    Returns:
        The matrix, shape (..., 3, 3), dtype of `matrix`. NaN for a matrix with NaN or inf.

    Raises:
        ValueError: Wrong shape of the matrix or of the result of `function`, unknown `vectors`.
        TypeError: Complex or non-numeric matrix, `function` not callable.

    Derivative:
        By divided differences of φ, whose limits are derivatives of φ. It is exact at equal, nearly equal, zero and
        negative singular values if the map is smooth there as a function of A, and damped where it is not, as for
        `nearest_rotation`. Second derivatives are damped at equal singular values.

    Accuracy:
        Derivative 1,024 eps, relative to its norm and that of the next one.

    Example:
        >>> import jax.numpy as jnp, jaxrot
        >>> F = jnp.diag(jnp.array([4.0, 1.0, 0.25]))
        >>> [round(x) for x in jaxrot.isotropic_map(F, jnp.log2, vectors="right").diagonal().tolist()]
        [2, 0, -2]

    Source: Daleckii and Krein 1965; Smith, de Goes and Kim 2019.
    """
    choice = check_choice(vectors, "vectors", _VECTORS)
    return _isotropic_map(
        check_matrix(matrix), function=ByIdentity(check_function(function, "function")), vectors=choice
    )


@compiled
def _isotropic_energy(matrix: jax.Array, *, energy: ByIdentity) -> jax.Array:
    function, parameters = _converted(energy, "energy", (), matrix.dtype)
    return _energy(matrix, parameters, function, 0)


@compiled
def _isotropic_map(matrix: jax.Array, *, function: ByIdentity, vectors: str) -> jax.Array:
    converted, parameters = _converted(function, "function", (3,), matrix.dtype)
    return _mapped(matrix, parameters, converted, vectors, 0)


def _converted(
    function: _Function, name: str, shape: tuple[int, ...], dtype: np.dtype
) -> tuple[_Function, tuple[jax.Array, ...]]:
    """Returns the function with the traced arrays that it closes over as further arguments, and these arrays."""
    example = jax.ShapeDtypeStruct((3,), dtype)
    converted, parameters = jax.closure_convert(function, example)
    result = jax.eval_shape(converted, example, *parameters)
    if not isinstance(result, jax.ShapeDtypeStruct) or result.shape != shape:
        got = f"shape {result.shape}" if isinstance(result, jax.ShapeDtypeStruct) else type(result).__name__
        raise ValueError(f"{name} must return an array of shape {shape} for singular values of shape (3,); got {got}")
    if not jnp.issubdtype(result.dtype, jnp.floating):
        raise TypeError(f"{name} must return real floating-point numbers; got dtype {result.dtype}")
    return lambda s, *parameters: converted(s, *parameters).astype(s.dtype), tuple(parameters)


def _batched(function: _Function, s: jax.Array, parameters: tuple) -> jax.Array:
    """Applies the function to the singular values of every matrix."""
    for _ in range(s.ndim - 1):
        function = jax.vmap(function, in_axes=(0, *(None for _ in parameters)))
    return function(s, *parameters)


@functools.partial(jax.custom_jvp, nondiff_argnums=(2, 3))
def _energy(matrix: jax.Array, parameters: tuple, energy: _Function, order: int) -> jax.Array:
    return _batched(energy, decomposed(matrix, order)[1], parameters)


@_energy.defjvp
def _energy_jvp(energy: _Function, order: int, primals, tangents):
    (matrix, parameters), (matrix_dot, parameters_dot) = primals, tangents
    value = _energy(matrix, parameters, energy, order + 1)
    gradient = _mapped(matrix, parameters, jax.grad(energy), "left_right", order + 1)
    tangent = jnp.sum(gradient * matrix_dot, axis=(-2, -1))
    if parameters:
        s = decomposed(matrix, order + 1)[1]
        tangent += jax.jvp(lambda *p: _batched(energy, s, p), parameters, parameters_dot)[1]
    return value, tangent


@functools.partial(jax.custom_jvp, nondiff_argnums=(2, 3, 4))
def _mapped(matrix: jax.Array, parameters: tuple, function: _Function, vectors: str, order: int) -> jax.Array:
    left, s, _, right = decomposed(matrix, order)
    x, y, z = mat3.vector_components(_batched(function, s, parameters))
    outer, inner = _axes(left, right, vectors)
    scaled = [mat3.multiply_entries(row, (x, y, z)) for row in outer]
    return mat3.stack(mat3.multiply((scaled[0], scaled[1], scaled[2]), mat3.transpose(inner)))


@_mapped.defjvp
def _mapped_jvp(function: _Function, vectors: str, order: int, primals, tangents):
    (matrix, parameters), (matrix_dot, parameters_dot) = primals, tangents
    value = _mapped(matrix, parameters, function, vectors, order + 1)
    left, s, _, right = decomposed(matrix, order + 1)
    m = tangent_in_axes(left, matrix_dot, right)
    s_dot = jnp.stack((m[0][0], m[1][1], m[2][2]), axis=-1)
    batched = lambda s, *parameters: _batched(function, s, parameters)  # noqa: E731
    phi, phi_dot = jax.jvp(batched, (s, *parameters), (s_dot, *parameters_dot))

    # notation: UᵀȦV off the diagonal is the sum of a symmetric and a skew matrix, a and b, in the planes (y, z), ...
    # Each is multiplied by divided differences of φ, whose limits are derivatives of φ.
    a = ((m[1][2] + m[2][1]) * 0.5, (m[2][0] + m[0][2]) * 0.5, (m[0][1] + m[1][0]) * 0.5)
    b = ((m[1][2] - m[2][1]) * 0.5, (m[2][0] - m[0][2]) * 0.5, (m[0][1] - m[1][0]) * 0.5)
    at_parameters = lambda s: batched(s, *parameters)  # noqa: E731
    slopes = divided_differences(at_parameters, s, phi, is_even=vectors != "left_right")
    a, b = mat3.multiply_entries(a, slopes.over_differences), mat3.multiply_entries(b, slopes.over_sums)
    x, y, z = mat3.vector_components(phi_dot)
    if vectors == "left_right":
        upper, lower = mat3.add_vectors(a, b), mat3.add_vectors(a, mat3.scale_vector(b, -1.0))
    else:
        upper = lower = mat3.add_vectors(a, mat3.scale_vector(b, 1.0 if vectors == "right" else -1.0))
    tangent = ((x, upper[2], lower[1]), (lower[2], y, upper[0]), (upper[1], lower[0], z))
    outer, inner = _axes(left, right, vectors)
    return value, mat3.stack(mat3.multiply(outer, mat3.multiply(tangent, mat3.transpose(inner))))


def _axes(left: jax.Array, right: jax.Array, vectors: str) -> tuple[Mat3, Mat3]:
    outer, inner = {"left_right": (left, right), "left": (left, left), "right": (right, right)}[vectors]
    return mat3.components(outer), mat3.components(inner)

"""Co-rotational linear elasticity on tetrahedra: energy, force, and two tangents as matrix-free products.

Ψ(F) = μ ‖F − R‖² + λ/2 (tr(RᵀF) − 3)² a volume, R the rotation nearest to F, det R = +1 for inverted elements too.
Written with the strain ε = sym(RᵀF) − 1, which at the nearest rotation is S − 1, Ψ = μ ‖ε‖² + λ/2 tr(ε)²: so its
derivative with R held has no stiffness against rotations, and with R = 1 is that of linear elasticity.

Sources: Etzmuß et al. 2003; Müller and Gross 2004; Chao et al. 2010; McAdams et al. 2011 (the energy); Smith, de Goes
and Kim 2019 (the eigenvalues of its Hessian).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxrot import nearest_rotation, refine_rotation, twist_modes
from jaxrot._compiled import exportable


@exportable
class Elements(NamedTuple):
    """Linear tetrahedra.

    Attributes:
        corners: Vertex indices, shape (m, 4).
        incidence: Where each vertex occurs in `corners.ravel()`, filled up with 4 m, shape (n, largest valence).
        rest_inverses: Inverses of the edge matrices at rest, shape (m, 3, 3), 1/m; their rows are the gradients of the
            linear functions that are 1 at corners 1, 2 and 3.
        volumes: At rest, shape (m,), m³.
        shear_modulus: μ, Lamé's second parameter, shape (m,), Pa.
        lame_first: λ, Lamé's first parameter, shape (m,), Pa.
    """

    corners: jax.Array
    incidence: jax.Array
    rest_inverses: jax.Array
    volumes: jax.Array
    shear_modulus: jax.Array
    lame_first: jax.Array


def lame_parameters(young: Any, poisson: Any) -> tuple[Any, Any]:
    """(μ, λ) from Young's modulus, Pa, and Poisson's ratio: numbers, or arrays of NumPy or JAX."""
    return young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))


def deformation_gradients(positions: jax.Array, elements: Elements) -> jax.Array:
    """F of each element, shape (m, 3, 3); linear: that of a displacement is the change of F."""
    corners = positions.at[elements.corners].get(mode="promise_in_bounds")
    # The differences first: far from the origin a sum over the four corners would cancel digits.
    edges = corners[:, 1:] - corners[:, :1]
    return _product(jnp.swapaxes(edges, -1, -2), elements.rest_inverses)


def nodal_gradient(stress: jax.Array, elements: Elements) -> jax.Array:
    """Σ V P b over the elements around each vertex: the transpose of `deformation_gradients`, shape (n, 3).

    Args:
        stress: ∂Ψ/∂F, shape (m, 3, 3), Pa; then the result is ∂E/∂x, minus the force, N.
        elements: The elements.
    """
    scaled = stress * elements.volumes[:, None, None]
    # Row a is the product of the stress with the gradient of corner a's function.
    others = jnp.sum(elements.rest_inverses[:, :, None, :] * scaled[:, None, :, :], axis=-1)
    corners = jnp.concatenate([-jnp.sum(others, axis=1, keepdims=True), others], axis=1).reshape(-1, 3)
    return jnp.sum(corners.at[elements.incidence].get(mode="fill", fill_value=0), axis=1)


def element_rotations(
    gradients: jax.Array, rotations: jax.Array, *, rotation: str, iterations: int | None
) -> jax.Array:
    """The rotation of each element.

    Args:
        gradients: F, shape (m, 3, 3).
        rotations: The warm start, shape (m, 3, 3).
        rotation: A name in `jaxrot.STEPS`, or, if `iterations` is None, in `jaxrot.METHODS`.
        iterations: Steps from the warm start. 0 keeps it: from the identity that is linear elasticity. None: a cold
            start.
    """
    if iterations is None:
        return nearest_rotation(gradients, method=rotation)
    return refine_rotation(gradients, rotations, step=rotation, iterations=iterations) if iterations else rotations


def energy(gradients: jax.Array, rotations: jax.Array, elements: Elements) -> jax.Array:
    """The elastic energy Σ V (μ ‖ε‖² + λ/2 tr(ε)²), a scalar, J; at the nearest rotation that is Ψ."""
    strain = _strain(gradients, rotations)
    shear = elements.shear_modulus * jnp.sum(strain**2, axis=(-2, -1))
    return jnp.sum(elements.volumes * (shear + 0.5 * elements.lame_first * _trace(strain) ** 2))


def stress(gradients: jax.Array, rotations: jax.Array, elements: Elements) -> jax.Array:
    """∂Ψ/∂F = R (2 μ ε + λ tr(ε) 1), shape (m, 3, 3), Pa.

    R is held, and the derivative is exact: what ∂R/∂F adds is a product of a symmetric matrix, that in brackets times
    S = RᵀF, with a skew one. At the nearest rotation it is 2 μ (F − R) + λ (tr S − 3) R.
    """
    return _rotated(_strain(gradients, rotations), rotations, elements)


def held_tangent(rotations: jax.Array, elements: Elements) -> Callable[[jax.Array], jax.Array]:
    """Ḟ to Ṗ with R held: "stiffness warping", positive semidefinite.

    Source: Müller and Gross 2004.
    """

    def product(gradients_dot: jax.Array) -> jax.Array:
        return _rotated(_symmetric_part(gradients_dot, rotations), rotations, elements)

    return product


def exact_tangent(gradients: jax.Array, rotations: jax.Array, elements: Elements) -> Callable[[jax.Array], jax.Array]:
    """Ḟ to Ṗ with R's derivative: 2 μ (Ḟ − Ṙ) + λ ((R:Ḟ) R + (tr S − 3) Ṙ).

    Newton's method is quadratic with it near a stable equilibrium. In compression it has negative eigenvalues.

    Args:
        gradients: F, shape (m, 3, 3).
        rotations: R, converged, shape (m, 3, 3).
        elements: The elements.
    """
    shear = 2 * elements.shear_modulus[:, None, None]
    # Without iterations what is left is the rule of the derivative at R; linearised, its inverses are formed once.
    _, turned = jax.linearize(lambda f: refine_rotation(f, rotations, iterations=0), gradients)
    pressure = (elements.lame_first * _trace(_strain(gradients, rotations)))[:, None, None]

    def product(gradients_dot: jax.Array) -> jax.Array:
        rotations_dot = turned(gradients_dot)
        trace = elements.lame_first * jnp.sum(rotations * gradients_dot, axis=(-2, -1))
        return shear * gradients_dot + (pressure - shear) * rotations_dot + trace[:, None, None] * rotations

    return product


def projected_tangent(
    gradients: jax.Array, rotations: jax.Array, elements: Elements
) -> Callable[[jax.Array], jax.Array]:
    """`exact_tangent` made positive semidefinite, for conjugate gradients to descend from anywhere.

    R turns in three twist modes T only, Ṙ = Σ 2/(sᵢ+sⱼ) T (T:Ḟ), in which `held_tangent` has no stiffness. The exact
    one is 2 μ − (2 μ − λ (tr S − 3)) 2/(sᵢ+sⱼ): the geometric stiffness. Where it is negative, 0 is taken.

    Args:
        gradients: F, shape (m, 3, 3).
        rotations: R, converged, shape (m, 3, 3).
        elements: The elements.

    Source: Smith, de Goes and Kim 2019, section 4.
    """
    held = held_tangent(rotations, elements)
    eigenvalues, modes = twist_modes(gradients)
    shear = 2 * elements.shear_modulus
    turning = shear - elements.lame_first * _trace(_strain(gradients, rotations))
    stiffness = jnp.maximum(shear[:, None] - turning[:, None] * eigenvalues, 0)

    def product(gradients_dot: jax.Array) -> jax.Array:
        twist = stiffness * jnp.sum(modes * gradients_dot[:, None], axis=(-2, -1))
        return held(gradients_dot) + jnp.sum(twist[:, :, None, None] * modes, axis=1)

    return product


def stiffness_diagonal(elements: Elements) -> jax.Array:
    """The mean of the three diagonal entries of the held stiffness matrix at each vertex, shape (n,), N/m.

    It does not depend on R: the trace of μ |b|² 1 + (μ + λ) Rb (Rb)ᵀ is (4 μ + λ) |b|².
    """
    inverses = elements.rest_inverses
    first = jnp.sum(jnp.sum(inverses, axis=1) ** 2, axis=-1, keepdims=True)
    squares = jnp.concatenate([first, jnp.sum(inverses**2, axis=-1)], axis=1)
    factor = elements.volumes * (4 * elements.shear_modulus + elements.lame_first) / 3
    corners = (factor[:, None] * squares).reshape(-1)
    return jnp.sum(corners.at[elements.incidence].get(mode="fill", fill_value=0), axis=1)


def _strain(gradients: jax.Array, rotations: jax.Array) -> jax.Array:
    """ε = sym(RᵀF) − 1 as sym(Rᵀ(F − R)), which keeps its digits where the strain is small."""
    return _symmetric_part(gradients - rotations, rotations)


def _symmetric_part(gradients: jax.Array, rotations: jax.Array) -> jax.Array:
    """sym(RᵀF)."""
    product = _product(jnp.swapaxes(rotations, -1, -2), gradients)
    return 0.5 * (product + jnp.swapaxes(product, -1, -2))


def _rotated(strain: jax.Array, rotations: jax.Array, elements: Elements) -> jax.Array:
    """R (2 μ ε + λ tr(ε) 1)."""
    shear = 2 * elements.shear_modulus[:, None, None] * _product(rotations, strain)
    return shear + (elements.lame_first * _trace(strain))[:, None, None] * rotations


def _trace(matrices: jax.Array) -> jax.Array:
    return matrices[:, 0, 0] + matrices[:, 1, 1] + matrices[:, 2, 2]


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """The matrix product by elementwise products: an accelerator rounds `@` and `einsum` to TF32."""
    x, y, z = (a[:, :, i, None] * b[:, i, None, :] for i in range(3))
    return x + y + z

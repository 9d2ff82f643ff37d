"""Co-rotational linear elasticity on tetrahedra: energy, force, and two tangents as matrix-free products.

The energy per volume is Ψ(F) = μ ‖F − R‖² + λ/2 (tr(RᵀF) − 3)². R is the rotation nearest to F, with det R = +1 for
inverted elements too. In terms of the strain ε = sym(RᵀF) − 1, which is S − 1 at the nearest rotation,
Ψ = μ ‖ε‖² + λ/2 tr(ε)². In this form the derivative with R held constant has no stiffness against rotations. With R = 1
it is linear elasticity.

Sources: Etzmuß et al. 2003; Müller and Gross 2004; Chao et al. 2010; McAdams et al. 2011 (the energy); Smith, de Goes
and Kim 2019 (the eigenvalues of its Hessian).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxrot import nearest_rotation, refine_rotation, twist_modes
from jaxrot._compiled import exportable
from jaxrot.scenes.incidence import sum_at_vertices
from jaxrot.scenes.rotations import product


@exportable
class Elements(NamedTuple):
    """Linear tetrahedra."""

    corners: jax.Array  # Vertex indices, shape (m, 4)
    incidence: jax.Array  # The places of each vertex in `corners.ravel()`, filled up with 4 m, shape (n, k)
    # Inverses of the edge matrices at rest, shape (m, 3, 3), 1/m. Their rows are the gradients of the linear functions
    # that are 1 at corners 1, 2 and 3.
    rest_inverses: jax.Array
    volumes: jax.Array  # At rest, shape (m,), m³
    shear_modulus: jax.Array  # μ, Lamé's second parameter, shape (m,), Pa
    lame_first: jax.Array  # λ, Lamé's first parameter, shape (m,), Pa


def lame_parameters(young: Any, poisson: Any) -> tuple[Any, Any]:
    """Returns Lamé's parameters (μ, λ) from Young's modulus, Pa, and Poisson's ratio: numbers or arrays."""
    return young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))


def deformation_gradients(positions: jax.Array, elements: Elements) -> jax.Array:
    """Returns F of each element, shape (m, 3, 3). It is linear: of a displacement it is the change of F."""
    corners = positions.at[elements.corners].get(mode="promise_in_bounds")
    # Take the differences first: far from the origin a sum over the four corners would cancel.
    edges = corners[:, 1:] - corners[:, :1]
    return product(jnp.swapaxes(edges, -1, -2), elements.rest_inverses)


def nodal_gradient(stress: jax.Array, elements: Elements) -> jax.Array:
    """Returns Σ V P b over the elements around each vertex, shape (n, 3): the transpose of `deformation_gradients`.

    For the stress P = ∂Ψ/∂F, Pa, it is ∂E/∂x, the negative force, N.
    """
    scaled = stress * elements.volumes[:, None, None]
    # Row a is the product of the stress and the gradient of the linear function of corner a.
    others = jnp.sum(elements.rest_inverses[:, :, None, :] * scaled[:, None, :, :], axis=-1)
    corners = jnp.concatenate([-jnp.sum(others, axis=1, keepdims=True), others], axis=1)
    return sum_at_vertices(corners, elements.incidence)


def element_rotations(
    gradients: jax.Array, rotations: jax.Array, *, rotation: str, iterations: int | None
) -> jax.Array:
    """Returns the rotation of each element. `rotation` and `iterations` are as in `corotational.step`."""
    if iterations is None:
        return nearest_rotation(gradients, method=rotation)
    return refine_rotation(gradients, rotations, step=rotation, iterations=iterations) if iterations else rotations


def energy(gradients: jax.Array, rotations: jax.Array, elements: Elements) -> jax.Array:
    """Returns the elastic energy Σ V (μ ‖ε‖² + λ/2 tr(ε)²), a scalar, J. At the nearest rotation it is Σ V Ψ."""
    strain = _strain(gradients, rotations)
    shear = elements.shear_modulus * jnp.sum(strain**2, axis=(-2, -1))
    return jnp.sum(elements.volumes * (shear + 0.5 * elements.lame_first * _trace(strain) ** 2))


def stress(gradients: jax.Array, rotations: jax.Array, elements: Elements) -> jax.Array:
    """∂Ψ/∂F = R (2 μ ε + λ tr(ε) 1), shape (m, 3, 3), Pa.

    R is held constant, and the derivative is still exact. The term with ∂R/∂F vanishes: it is the inner product of a
    symmetric matrix, the bracket times S = RᵀF, and a skew one. At the nearest rotation the stress is
    2 μ (F − R) + λ (tr S − 3) R.
    """
    return _rotated(_strain(gradients, rotations), rotations, elements)


def held_tangent(rotations: jax.Array, elements: Elements) -> Callable[[jax.Array], jax.Array]:
    """Returns the map from Ḟ to Ṗ with R held constant, "stiffness warping". It is positive semidefinite.

    Source: Müller and Gross 2004.
    """

    def apply(gradients_dot: jax.Array) -> jax.Array:
        return _rotated(_symmetric_part(gradients_dot, rotations), rotations, elements)

    return apply


def exact_tangent(gradients: jax.Array, rotations: jax.Array, elements: Elements) -> Callable[[jax.Array], jax.Array]:
    """Returns the map from Ḟ to Ṗ with R's derivative: 2 μ (Ḟ − Ṙ) + λ ((R:Ḟ) R + (tr S − 3) Ṙ).

    R must have converged. With it Newton's method converges quadratically near a stable equilibrium. In compression
    it has negative eigenvalues.
    """
    shear = 2 * elements.shear_modulus[:, None, None]
    # With 0 iterations `refine_rotation` only applies the derivative rule at R. `jax.linearize` computes its inverses
    # once for all products.
    _, turned = jax.linearize(lambda f: refine_rotation(f, rotations, iterations=0), gradients)
    pressure = (elements.lame_first * _trace(_strain(gradients, rotations)))[:, None, None]

    def apply(gradients_dot: jax.Array) -> jax.Array:
        rotations_dot = turned(gradients_dot)
        trace = elements.lame_first * jnp.sum(rotations * gradients_dot, axis=(-2, -1))
        return shear * gradients_dot + (pressure - shear) * rotations_dot + trace[:, None, None] * rotations

    return apply


def projected_tangent(
    gradients: jax.Array, rotations: jax.Array, elements: Elements
) -> Callable[[jax.Array], jax.Array]:
    """Returns `exact_tangent` made positive semidefinite, so that conjugate gradients descend from every state.

    R turns only in the three twist modes T: Ṙ = Σ 2/(sᵢ+sⱼ) T (T:Ḟ). `held_tangent` has no stiffness in these modes.
    The exact (geometric) stiffness is 2 μ − (2 μ − λ (tr S − 3)) 2/(sᵢ+sⱼ). A negative one is replaced by 0.

    Source: Smith, de Goes and Kim 2019, section 4.
    """
    held = held_tangent(rotations, elements)
    eigenvalues, modes = twist_modes(gradients)
    shear = 2 * elements.shear_modulus
    turning = shear - elements.lame_first * _trace(_strain(gradients, rotations))
    stiffness = jnp.maximum(shear[:, None] - turning[:, None] * eigenvalues, 0)

    def apply(gradients_dot: jax.Array) -> jax.Array:
        twist = stiffness * jnp.sum(modes * gradients_dot[:, None], axis=(-2, -1))
        return held(gradients_dot) + jnp.sum(twist[:, :, None, None] * modes, axis=1)

    return apply


def stiffness_diagonal(elements: Elements) -> jax.Array:
    """Returns the mean of the three diagonal entries of the held stiffness matrix at each vertex, shape (n,), N/m.

    It does not depend on R: the trace of μ |b|² 1 + (μ + λ) Rb (Rb)ᵀ is (4 μ + λ) |b|².
    """
    inverses = elements.rest_inverses
    first = jnp.sum(jnp.sum(inverses, axis=1) ** 2, axis=-1, keepdims=True)
    squares = jnp.concatenate([first, jnp.sum(inverses**2, axis=-1)], axis=1)
    factor = elements.volumes * (4 * elements.shear_modulus + elements.lame_first) / 3
    return sum_at_vertices(factor[:, None] * squares, elements.incidence)


def _strain(gradients: jax.Array, rotations: jax.Array) -> jax.Array:
    """ε = sym(RᵀF) − 1, computed as sym(Rᵀ(F − R)), which is accurate for a small strain."""
    return _symmetric_part(gradients - rotations, rotations)


def _symmetric_part(gradients: jax.Array, rotations: jax.Array) -> jax.Array:
    """sym(RᵀF)."""
    stretch = product(jnp.swapaxes(rotations, -1, -2), gradients)
    return 0.5 * (stretch + jnp.swapaxes(stretch, -1, -2))


def _rotated(strain: jax.Array, rotations: jax.Array, elements: Elements) -> jax.Array:
    """R (2 μ ε + λ tr(ε) 1)."""
    shear = 2 * elements.shear_modulus[:, None, None] * product(rotations, strain)
    return shear + (elements.lame_first * _trace(strain))[:, None, None] * rotations


def _trace(matrices: jax.Array) -> jax.Array:
    return matrices[:, 0, 0] + matrices[:, 1, 1] + matrices[:, 2, 2]

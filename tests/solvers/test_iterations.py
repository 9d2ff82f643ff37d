"""Properties of the iterated methods: `higham_newton`, `taylor`, `taylor_iterated`, `higham_noferini`."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import stretched

from jaxrot import nearest_rotation
from jaxrot._algebra import mat3, quaternion
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES
from jaxrot.solvers import higham_noferini, taylor


def test_newton_is_right_to_rounding_until_the_determinant_is_lost():
    solve = functools.partial(nearest_rotation, method="higham_newton")
    for s in ((1, 1e-6, 1e-6), (1, 1, 1e-12), (1, 1e-3, 1e-11)):
        matrices = stretched(s, dtype="float64")
        bound = 8 * np.finfo(float).eps * (1 + reference.condition(matrices))
        assert (reference.forward_error(np.asarray(solve(matrices)), matrices) < bound).all(), s
    lost = stretched((1, 1e-9, 1e-9), dtype="float64")
    assert reference.forward_error(np.asarray(solve(lost)), lost).max() > 0.1


def test_one_taylor_step_is_equation_20_and_right_to_third_order_in_the_noise():
    random = np.random.default_rng(0)
    rotation = FAMILIES["rotation"].sample(200, dtype=np.float64).matrices
    noise = random.uniform(-1, 1, rotation.shape)
    noisy = [rotation + d * noise for d in (4e-3, 2e-3, 1e-3)]
    errors = [reference.forward_error(np.asarray(nearest_rotation(a, method="taylor")), a).mean() for a in noisy]
    ratios = np.divide(errors[:-1], errors[1:])
    assert (np.abs(ratios - 8) < 0.5).all()
    a = FAMILIES["noisy_rotation_0.3"].sample(50, dtype=np.float64).matrices
    c = a.transpose(0, 2, 1) @ a
    expected = a @ (3 * c @ c - 10 * c + 15 * np.eye(3)) / 8
    np.testing.assert_allclose(mat3.stack(taylor.polynomial(mat3.components(jnp.asarray(a)))), expected, atol=1e-14)


def test_the_iteration_stays_in_its_basin_because_it_is_scaled():
    # √(7/3) is where the polynomial returns what it is given; beyond, it grows.
    for x, factor in ((1.5, 0.9), (7 / 3, 1.0), (2.5, 1.05)):
        r = mat3.components(jnp.eye(3) * np.sqrt(x))
        ratio = taylor.polynomial(r)[0][0] / np.sqrt(x)
        assert ratio < factor if factor < 1 else ratio >= factor - 1e-15
    # Of norm √3, as a rotation has, and s1 > √(7/3): the iteration would run away.
    matrices = stretched((3**0.5, 0.12, 0.11), dtype="float64")
    solved = np.asarray(nearest_rotation(matrices, method="taylor_iterated"))
    assert reference.forward_error(solved, matrices).max() < 1e-13


@pytest.mark.parametrize("zero", range(4))
def test_the_null_vector_is_found_wherever_the_first_pivots_vanish(zero):
    """A zero in the leading place is what the pivoting is for."""
    columns = np.eye(4)
    columns[zero, zero] = 0
    other = (zero + 1) % 4
    columns[other, other] = 3
    q = higham_noferini.null_vector(tuple(quaternion.components(jnp.asarray(c)) for c in columns))  # pyright: ignore
    np.testing.assert_array_equal(np.asarray(q) != 0, np.arange(4) == zero)


def test_inverse_iteration_makes_up_for_an_eigenvalue_that_is_slightly_off():
    random = np.random.default_rng(0)
    axes, _ = np.linalg.qr(random.standard_normal((100, 4, 4)))
    symmetric = np.einsum("nij,j,nkj->nik", axes, [1e-3, 0.5, 1, 2], axes)
    columns = tuple(quaternion.components(jnp.asarray(symmetric[:, :, j])) for j in range(4))
    q = np.stack(jax.jit(higham_noferini.null_vector)(columns), -1)  # pyright: ignore
    cosine = np.abs(np.sum(q * axes[:, :, 0], -1)) / np.linalg.norm(q, axis=-1)
    np.testing.assert_allclose(cosine, 1, atol=1e-14)

"""Sarabandi et al. 2020: closed forms, their roots, and what to make of the four columns of eq. (27)."""

import jax.numpy as jnp
import numpy as np
import pytest
from differences import quaternion_rotations

from jaxrot import nearest_rotation
from jaxrot._algebra import mat3, quaternion
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES
from jaxrot.solvers import horn_quartic, smith_franca


def gaussian(sign, count=200):
    matrices = FAMILIES["gaussian"].sample(4 * count, dtype=np.float64, seed=2).matrices
    return matrices[np.sign(np.linalg.det(matrices)) == sign][:count]


@pytest.mark.parametrize("method", ["inverse_square_root", "smith_franca", "higham_newton", "taylor_iterated"])
def test_an_inverted_matrix_gives_the_nearest_reflection(method):
    inverted = np.diag([1.0, 0.9, -0.7]) @ FAMILIES["rotation"].sample(50, dtype=np.float64).matrices
    result = np.asarray(nearest_rotation(inverted, method=method))
    # The nearest orthogonal matrix of −A, whose determinant is positive, with the sign back.
    np.testing.assert_allclose(result, -np.asarray(reference.reference_rotation(-inverted), float), atol=1e-13)
    assert (np.linalg.det(result) < 0).all()


def test_the_inverse_square_root_of_a_singular_matrix_is_not_finite():
    assert not np.isfinite(nearest_rotation(np.diag([1.0, 0.5, 0.0]), method="inverse_square_root")).all()


def test_the_eigenvalues_need_the_correction_of_equations_9_and_10():
    matrices = gaussian(1)
    c = np.einsum("nki,nkj->nij", matrices, matrices)
    values = np.stack(smith_franca.smith_eigenvalues(mat3.components(jnp.asarray(c))), -1)
    expected = np.linalg.eigvalsh(c)[:, ::-1]
    np.testing.assert_allclose(values, expected, atol=1e-13 * expected.max())
    # As printed, m + 2 √p (cos θ ± √3 sin θ): the sum is not the trace.
    m = np.trace(c, axis1=1, axis2=2) / 3
    deviator = c - m[:, None, None] * np.eye(3)
    p, q = np.sum(deviator**2, axis=(1, 2)) / 6, np.linalg.det(deviator) / 2
    theta = np.arctan2(np.sqrt(p**3 - q**2), q) / 3
    printed = [m + 2 * np.sqrt(p) * (np.cos(theta) + k * 3**0.5 * np.sin(theta)) for k in (1, -1)]
    assert (np.abs(values[:, 0] + printed[0] + printed[1] - 3 * m) > 0.1 * m).all()


def test_the_largest_root_of_the_quartic_is_the_sum_of_the_singular_values_and_the_adjugate_is_right():
    for matrices in (gaussian(1), gaussian(-1), np.stack([np.diag([1.0, 0.5, 0.0]), np.diag([2.0, 0.0, 0.0])])):
        root = horn_quartic.quartic_root(mat3.components(jnp.asarray(matrices)))
        expected = np.asarray(reference.signed_singular_values(matrices).sum(-1), float)
        # A double root, s2+s3 → 0, is known to √eps.
        np.testing.assert_allclose(root, expected, rtol=1e-7)
        assert np.median(np.abs(root / expected - 1)) < 1e-14
    random = np.random.default_rng(0).standard_normal((50, 4, 4))
    symmetric = random + random.transpose(0, 2, 1)
    columns = tuple(quaternion.components(jnp.asarray(symmetric[:, :, j])) for j in range(4))
    adjugate = np.stack([np.stack(column, -1) for column in quaternion.adjugate(columns)], -1)
    expected = np.linalg.det(symmetric)[:, None, None] * np.eye(4)
    np.testing.assert_allclose(symmetric @ adjugate, expected, atol=1e-11)


def test_the_dominant_eigenvalue_must_be_the_algebraically_largest():
    """Sarabandi et al. 2020 say "maximal absolute value" after eq. (27), which fails for many inverted matrices."""
    matrices = gaussian(-1)
    columns = quaternion.davenport_columns(mat3.components(jnp.asarray(matrices)), 0.0)
    n = np.stack([np.stack(column, -1) for column in columns], -1)
    values, vectors = np.linalg.eigh(n)
    in_modulus = np.take_along_axis(vectors, np.abs(values).argmax(-1)[:, None, None], -1)[..., 0]
    rotation = mat3.stack(quaternion.to_rotation(quaternion.components(jnp.asarray(in_modulus))))
    assert (reference.forward_error(np.asarray(rotation), matrices) > 0.1).mean() > 0.1
    solved = np.asarray(nearest_rotation(matrices, method="horn_quartic"))
    assert np.median(reference.forward_error(solved, matrices)) < 1e-13


def test_the_average_is_best_in_the_worst_case_and_shepperd_and_markley_worst_in_the_mean():
    """Their figure 4. In the mean the average and Cayley cross over, at δ = 0.3 once the scale is removed."""
    noisy = FAMILIES["noisy_rotation_0.5"].sample(10_000, dtype=np.float64).matrices
    errors = {
        name: np.linalg.norm(np.asarray(nearest_rotation(noisy, method=name)) - noisy, axis=(1, 2))
        for name in ("quaternion_average", "cayley", "shepperd_markley")
    }
    mean = [error.mean() for error in errors.values()]
    assert mean == sorted(mean)
    assert errors["quaternion_average"].max() < 0.8 * errors["cayley"].max()


def test_the_simple_average_fails_where_the_components_add_up_to_zero_and_not_where_all_are_positive():
    # q ∝ (1, −1, 1, −1): the four columns cancel.
    cancelling = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    assert np.linalg.det(cancelling) == 1
    random = np.random.default_rng(0)
    noisy = cancelling + random.uniform(-0.05, 0.05, (200, 3, 3))
    errors = {
        name: reference.forward_error(np.asarray(nearest_rotation(noisy, method=name)), noisy)
        for name in ("simple_average", "quaternion_average")
    }
    assert errors["quaternion_average"].max() < 0.2
    assert np.median(errors["simple_average"]) > 0.2
    assert np.isnan(nearest_rotation(cancelling, method="simple_average")).all()
    np.testing.assert_allclose(nearest_rotation(cancelling, method="quaternion_average"), cancelling, atol=1e-15)
    # The flaw is the signs alone.
    rotation = quaternion_rotations(np.random.default_rng(0).uniform(0.5, 1, (4, 200)))
    noisy = rotation + np.random.default_rng(1).uniform(-0.01, 0.01, rotation.shape)
    solved = [np.asarray(nearest_rotation(noisy, method=name)) for name in ("simple_average", "quaternion_average")]
    np.testing.assert_allclose(solved[0], solved[1], atol=1e-15)

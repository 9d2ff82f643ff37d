"""Sarabandi et al. 2020, section IV: what to make of the four columns of eq. (27)."""

import numpy as np
from differences import quaternion_rotations

from jaxrot import nearest_rotation
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES


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


def test_the_simple_average_fails_where_the_components_add_up_to_zero():
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


def test_the_simple_average_is_no_worse_where_all_components_are_positive():
    """The flaw is the signs alone."""
    rotation = quaternion_rotations(np.random.default_rng(0).uniform(0.5, 1, (4, 200)))
    noisy = rotation + np.random.default_rng(1).uniform(-0.01, 0.01, rotation.shape)
    solved = [np.asarray(nearest_rotation(noisy, method=name)) for name in ("simple_average", "quaternion_average")]
    np.testing.assert_allclose(solved[0], solved[1], atol=1e-15)

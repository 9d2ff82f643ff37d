import numpy as np
import pytest
from certificate import (
    assert_contract,
    assert_forward_error,
    assert_rotations,
    assert_within,
    family_batch,
    in_families,
    resolved,
)

BATCH = family_batch("float64", 4)
GOOD = resolved(BATCH)
NEAREST = BATCH.nearest.astype(np.float64)


def turned(angle):
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


def test_the_reference_itself_keeps_the_contract():
    assert_contract(NEAREST, BATCH)


def test_a_rotation_that_is_turned_a_little_is_caught():
    with pytest.raises(AssertionError, match="forward error"):
        assert_forward_error(NEAREST @ turned(1e-12), BATCH, GOOD & (BATCH.condition < 10))


def test_a_rotation_that_is_not_nearest_is_caught_where_it_is_not_unique():
    where = in_families(BATCH, ["rank_one"])
    rank_one = BATCH._replace(**{name: getattr(BATCH, name)[where] for name in BATCH._fields})
    # The trace falls in second order of the angle, the torque in first.
    with pytest.raises(AssertionError, match="lost trace"):
        assert_contract(NEAREST[where] @ turned(3.0), rank_one)
    with pytest.raises(AssertionError, match="torque"):
        assert_contract(NEAREST[where] @ turned(1e-12), rank_one)


def test_a_reflection_is_caught():
    with pytest.raises(AssertionError, match="orthogonality"):
        assert_rotations(-NEAREST, BATCH.families)


def test_what_is_not_orthogonal_is_caught():
    with pytest.raises(AssertionError, match="orthogonality"):
        assert_rotations(NEAREST * (1 + 1e-14), BATCH.families)


def test_a_nan_is_caught_and_its_family_named():
    with pytest.raises(AssertionError, match="'b'"):
        assert_within(np.array([0.0, np.nan]), 1.0, np.array(["a", "b"]), "promise")

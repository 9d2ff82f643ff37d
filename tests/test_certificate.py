import numpy as np
import pytest
from certificate import assert_contract, assert_forward_error, assert_rotations, assert_within, family_batch, resolved
from differences import turned

BATCH = family_batch("float64", 4)
GOOD = resolved(BATCH)
NEAREST = BATCH.nearest.astype(np.float64)


def test_the_reference_itself_keeps_the_contract_and_a_small_turn_is_caught():
    assert_contract(NEAREST, BATCH)
    with pytest.raises(AssertionError, match="forward error"):
        assert_forward_error(NEAREST @ turned([0, 0, 1], 1e-12), BATCH, GOOD & (BATCH.condition < 10))


def test_a_rotation_that_is_not_nearest_is_caught_where_it_is_not_unique():
    where = BATCH.families == "rank_one"
    rank_one = BATCH._replace(**{name: getattr(BATCH, name)[where] for name in BATCH._fields})
    # The trace falls in second order of the angle, the torque in first.
    with pytest.raises(AssertionError, match="lost trace"):
        assert_contract(NEAREST[where] @ turned([0, 0, 1], 3.0), rank_one)
    with pytest.raises(AssertionError, match="torque"):
        assert_contract(NEAREST[where] @ turned([0, 0, 1], 1e-12), rank_one)


@pytest.mark.parametrize("factor", [-1, 1 + 1e-14], ids=["reflected", "stretched"])
def test_what_is_no_rotation_is_caught(factor):
    with pytest.raises(AssertionError, match="orthogonality"):
        assert_rotations(NEAREST * factor, BATCH.families)


def test_a_nan_is_caught_and_its_family_named():
    with pytest.raises(AssertionError, match="'b'"):
        assert_within(np.array([0.0, np.nan]), 1.0, np.array(["a", "b"]), "promise")

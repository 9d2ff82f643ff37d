"""What an error message suggests for an array of another layout."""

import re

import numpy
import numpy as np
import pytest

from jaxrot._inputs import layout_hint

MATRICES = np.arange(2 * 5 * 9.0).reshape(2, 5, 3, 3)
POSES = np.concatenate([np.concatenate([MATRICES, np.full((2, 5, 3, 1), 7.0)], -1), np.ones((2, 5, 1, 4))], -2)

LAYOUTS = {
    "poses": POSES[0],
    "one_pose": POSES[0, 0],
    "batches_of_poses": POSES,
    "poses_without_last_row": POSES[0, :, :3],
    "flat_matrices": MATRICES[0].reshape(5, 9),
    "one_flat_matrix": MATRICES[0, 0].ravel(),
    "batches_of_flat_matrices": MATRICES.reshape(2, 5, 9),
    "flat_poses": POSES[0, :, :3].reshape(5, 12),
    "batches_of_flat_poses": POSES[:, :, :3].reshape(2, 5, 12),
    "flat_poses_with_last_row": POSES[0].reshape(5, 16),
    "trailing_batch": np.moveaxis(MATRICES[0], 0, -1),
    "trailing_batches": np.moveaxis(MATRICES, (-2, -1), (0, 1)),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_hint_is_code_that_gives_the_matrices(layout):
    array = LAYOUTS[layout]
    hint = layout_hint(array.shape)
    (code,) = re.findall("; if [^;]*, use ([^;]*)", hint)
    converted = eval(code, {"numpy": numpy, "array": array})
    np.testing.assert_array_equal(converted.reshape(-1, 3, 3), MATRICES.reshape(-1, 3, 3)[: converted.size // 9])
    assert converted.ndim <= max(3, array.ndim + 1), "the batch axes are kept"
    assert "\n" not in hint


@pytest.mark.parametrize(
    "shape", [(3, 3), (3, 3, 3), (4, 4, 3, 3), (0, 3, 3), (12, 3, 3), (), (3,), (7,), (2, 2), (5, 4)]
)
def test_a_legal_shape_and_an_unknown_one_get_no_hint(shape):
    assert layout_hint(shape) == ""


@pytest.mark.parametrize(("shape", "count"), [((3, 3, 4), 2), ((3, 3, 9), 2), ((3, 3, 12), 2), ((3, 3, 4, 4), 2)])
def test_an_ambiguous_shape_gets_every_reading(shape, count):
    assert layout_hint(shape).count("; if ") == count

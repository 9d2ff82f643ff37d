"""Matrices at which derivatives are checked, rotations to make others of, and central differences."""

import numpy as np
import pytest

from jaxrot.families import FAMILIES

POINTS = {
    "rotation": np.eye(3),
    "rank two": np.diag([1, 0.7, 0]),
    "inverted": np.diag([1, 0.8, -0.5]),
    "equal": np.diag([2.0, 2, -0.5]),
    "generic": np.array([[1.0, 0.3, -0.2], [0.1, 0.8, 0.4], [-0.3, 0.2, 1.3]]),
}
# Where singular vectors have a derivative too.
DISTINCT = {name: POINTS[name] for name in ("rank two", "inverted", "generic")}
at_points, at_distinct_points = (
    pytest.mark.parametrize("matrix", points.values(), ids=points.keys()) for points in (POINTS, DISTINCT)
)


def turned(axis, angle):
    """The rotation about an axis of any length, by an angle in radians."""
    axis = np.asarray(axis) / np.linalg.norm(axis)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def stretched(s, count=50, dtype="float32"):
    """Matrices with these singular values, the last one signed, between two random rotations."""
    left, right = (FAMILIES["rotation"].sample(count, dtype=np.float64, seed=seed).matrices for seed in (1, 2))
    return ((left * np.asarray(s)[..., None, :]) @ right).astype(dtype)


def quaternion_rotations(wxyz):
    """The rotations of quaternions of any length, shape (4, n)."""
    w, x, y, z = wxyz / np.linalg.norm(wxyz, axis=0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def central_difference(function, matrix, tangent, h=1e-5):
    """The change of an array-valued function along a tangent."""
    ahead, behind = function(matrix + h * tangent), function(matrix - h * tangent)
    return (np.asarray(ahead) - np.asarray(behind)) / (2 * h)


def difference_jacobian(function, matrix, h=1e-5):
    """The Jacobian, shape (*shape of the result, 3, 3)."""
    columns = [central_difference(function, matrix, unit, h) for unit in np.eye(9).reshape(9, 3, 3)]
    return np.stack(columns, axis=-1).reshape(*columns[0].shape, 3, 3)


def assert_is_derivative(derivative, function, matrix, digits=2e-8):
    """`derivative(matrix)`, of any order, is that of `function` by differences."""
    got = np.asarray(derivative(matrix))
    np.testing.assert_allclose(got, difference_jacobian(function, matrix), atol=digits * max(1, np.abs(got).max()))

import numpy as np
import pytest

from jaxrot.report import deformed_dragon
from jaxrot.scenes.clusters import overlapping_clusters
from jaxrot.scenes.dragon import rest_vertices


@pytest.fixture(scope="module")
def vertices():
    return rest_vertices()


@pytest.fixture(scope="module")
def matrices():
    return deformed_dragon.dragon_matrices(40)


def test_cluster_matrices_are_the_sum_over_the_cluster(vertices):
    clusters = overlapping_clusters(vertices, 3, 32)
    current = deformed_dragon.bent(vertices, 1.0)
    for row, matrix in zip(clusters, deformed_dragon.cluster_matrices(current, vertices, clusters), strict=True):
        x, q = current[row] - current[row].mean(0), vertices[row] - vertices[row].mean(0)
        expected = sum(np.outer(x[k], q[k]) for k in range(len(row))) / len(row)
        np.testing.assert_allclose(matrix, expected, rtol=1e-12, atol=1e-18)


def test_every_stage_is_what_its_name_says_every_time(matrices):
    assert list(matrices) == ["at rest", "twisted", "bent", "squashed", "flat", "inverted", "scrambled"]
    determinant = {name: np.linalg.det(array) for name, array in matrices.items()}
    assert np.all(determinant["at rest"] > 0)
    assert np.all(determinant["squashed"] > 0)
    assert np.all(determinant["inverted"] < 0)
    largest = np.linalg.norm(matrices["flat"], axis=(1, 2))
    assert np.all(np.abs(determinant["flat"]) < 1e-15 * largest**3)
    assert 0.2 < np.mean(determinant["scrambled"] < 0) < 0.8
    np.testing.assert_allclose(matrices["at rest"], np.swapaxes(matrices["at rest"], 1, 2), atol=1e-18)
    for name, array in deformed_dragon.dragon_matrices(40).items():
        np.testing.assert_array_equal(array, matrices[name])


def test_twisting_and_bending_keep_lengths_where_they_should(vertices):
    twisted = deformed_dragon.twisted(vertices, 6.0)
    radius, expected = (np.hypot(points[:, 0], points[:, 2]) for points in (twisted, vertices))
    np.testing.assert_allclose(radius, expected, rtol=1e-12)
    np.testing.assert_array_equal(twisted[:, 1], vertices[:, 1])
    nearly_straight = deformed_dragon.bent(vertices, 1e-6)
    np.testing.assert_allclose(nearly_straight, vertices, atol=1e-5)

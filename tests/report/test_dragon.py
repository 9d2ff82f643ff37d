from importlib import resources

import numpy as np
import pytest

from jaxrot.report import dragon


@pytest.fixture(scope="module")
def vertices():
    return dragon.rest_vertices()


@pytest.fixture(scope="module")
def matrices():
    return dragon.dragon_matrices(40)


def test_the_dragon_ships_with_its_acknowledgement(vertices):
    assert vertices.shape == (5205, 3)
    assert np.ptp(vertices[:, 1]) == pytest.approx(1)
    text = resources.files("jaxrot.report").joinpath("dragon.txt").read_text(encoding="utf-8")
    assert "Stanford Computer" in text
    assert "acknowledged" in text


def test_clusters_cover_the_dragon_and_overlap(vertices):
    clusters = dragon.overlapping_clusters(vertices, 400)
    assert clusters.shape == (400, dragon.CLUSTER_SIZE)
    assert all(len(set(row)) == dragon.CLUSTER_SIZE for row in clusters.tolist())
    assert len(set(clusters[:, 0].tolist())) == 400, "two clusters share a seed"
    covered = len(np.unique(clusters))
    assert covered > 0.9 * len(vertices)
    assert clusters.size > 2 * covered


def test_a_cluster_holds_the_nearest_vertices(vertices):
    row = dragon.overlapping_clusters(vertices, 5)[4]
    distance = np.linalg.norm(vertices - vertices[row[0]], axis=1)
    assert np.max(distance[row]) <= np.min(np.delete(distance, row))


def test_cluster_matrices_are_the_sum_over_the_cluster(vertices):
    clusters = dragon.overlapping_clusters(vertices, 3)
    current = dragon.bent(vertices, 1.0)
    for row, matrix in zip(clusters, dragon.cluster_matrices(current, vertices, clusters), strict=True):
        x, q = current[row] - current[row].mean(0), vertices[row] - vertices[row].mean(0)
        expected = sum(np.outer(x[k], q[k]) for k in range(len(row))) / len(row)
        np.testing.assert_allclose(matrix, expected, rtol=1e-12, atol=1e-18)


def test_every_stage_is_what_its_name_says(matrices):
    assert list(matrices) == ["at rest", "twisted", "bent", "squashed", "flat", "inverted", "scrambled"]
    determinant = {name: np.linalg.det(array) for name, array in matrices.items()}
    assert np.all(determinant["at rest"] > 0)
    assert np.all(determinant["squashed"] > 0)
    assert np.all(determinant["inverted"] < 0)
    largest = np.linalg.norm(matrices["flat"], axis=(1, 2))
    assert np.all(np.abs(determinant["flat"]) < 1e-15 * largest**3)
    assert 0.2 < np.mean(determinant["scrambled"] < 0) < 0.8
    np.testing.assert_allclose(matrices["at rest"], np.swapaxes(matrices["at rest"], 1, 2), atol=1e-18)


def test_twisting_and_bending_keep_lengths_where_they_should(vertices):
    twisted = dragon.twisted(vertices, 6.0)
    np.testing.assert_allclose(
        np.hypot(twisted[:, 0], twisted[:, 2]), np.hypot(vertices[:, 0], vertices[:, 2]), rtol=1e-12
    )
    np.testing.assert_array_equal(twisted[:, 1], vertices[:, 1])
    nearly_straight = dragon.bent(vertices, 1e-6)
    np.testing.assert_allclose(nearly_straight, vertices, atol=1e-5)


def test_the_same_matrices_every_time(matrices):
    for name, array in dragon.dragon_matrices(40).items():
        np.testing.assert_array_equal(array, matrices[name])

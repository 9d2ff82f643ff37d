from importlib import resources

import numpy as np
import pytest

from jaxrot.scenes.clusters import overlapping_clusters
from jaxrot.scenes.dragon import rest_vertices

SIZE = 32


@pytest.fixture(scope="module")
def vertices():
    return rest_vertices()


def test_the_dragon_ships_with_its_acknowledgement(vertices):
    fine = rest_vertices(fine=True)
    assert (vertices.shape, fine.shape) == ((5205, 3), (22998, 3))
    assert np.ptp(vertices[:, 1]) == pytest.approx(1)
    np.testing.assert_allclose(np.ptp(fine, axis=0), np.ptp(vertices, axis=0), rtol=0.01)
    text = resources.files("jaxrot.scenes").joinpath("dragon.txt").read_text(encoding="utf-8")
    assert "Stanford Computer" in text
    assert "acknowledged" in text


def test_clusters_cover_the_dragon_and_overlap(vertices):
    clusters = overlapping_clusters(vertices, 400, SIZE)
    assert clusters.shape == (400, SIZE)
    assert all(len(set(row)) == SIZE for row in clusters.tolist())
    assert len(set(clusters[:, 0].tolist())) == 400, "two clusters share a seed"
    covered = len(np.unique(clusters))
    assert covered > 0.9 * len(vertices)
    assert clusters.size > 2 * covered


def test_a_cluster_holds_the_nearest_vertices(vertices):
    row = overlapping_clusters(vertices, 5, SIZE)[4]
    distance = np.linalg.norm(vertices - vertices[row[0]], axis=1)
    assert np.max(distance[row]) <= np.min(np.delete(distance, row))

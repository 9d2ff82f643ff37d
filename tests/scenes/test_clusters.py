from importlib import resources

import numpy as np
import pytest

from jaxrot.scenes.clusters import covering_clusters, overlapping_clusters, padded, spread_clusters
from jaxrot.scenes.dragon import rest_vertices
from jaxrot.scenes.incidence import incidence

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


def test_clusters_of_nearest_vertices_cover_the_dragon_and_overlap(vertices):
    clusters = overlapping_clusters(vertices, 400, SIZE)
    assert clusters.shape == (400, SIZE)
    assert all(len(set(row)) == SIZE for row in clusters.tolist())
    assert len(set(clusters[:, 0].tolist())) == 400, "two clusters share a seed"
    covered = len(np.unique(clusters))
    assert covered > 0.9 * len(vertices)
    assert clusters.size > 2 * covered
    row = clusters[4]
    distance = np.linalg.norm(vertices - vertices[row[0]], axis=1)
    assert np.max(distance[row]) <= np.min(np.delete(distance, row))


def test_covering_clusters_hold_every_vertex_and_spread_ones_hold_it_once():
    points = np.random.default_rng(0).standard_normal((300, 3)) ** 3
    assert len(np.unique(overlapping_clusters(points, 30, 20))) < 300
    clusters = covering_clusters(points, 30, 20)
    assert set(clusters.ravel().tolist()) == set(range(300))
    np.testing.assert_array_equal(clusters[:30], overlapping_clusters(points, 30, 20))
    spread = spread_clusters(100, 32)
    assert sorted(np.concatenate(spread).tolist()) == list(range(100))
    assert {len(cluster) for cluster in spread} == {25}


def test_incidence_is_the_table_of_clusters_the_other_way_round():
    members, filled = padded([[3, 1, 0], [1], [2, 1]], 4)
    places, counts = incidence(members, 4, filled=filled)
    assert counts.tolist() == [1, 3, 1, 1]
    for vertex, row in enumerate(places.tolist()):
        found = [place for place in row if place < members.size]
        assert len(found) == counts[vertex]
        assert all(members.ravel()[place] == vertex and filled.ravel()[place] for place in found)

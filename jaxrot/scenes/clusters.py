"""Overlapping clusters of a set of points.

Source: Müller et al. 2005, "Meshless deformations based on shape matching", section 4.4.
"""

import numpy as np


def overlapping_clusters(vertices: np.ndarray, count: int, size: int) -> np.ndarray:
    """Clusters that cover the shape evenly and share vertices.

    The seeds are farthest points: each lies as far as possible from those before it. A cluster is the `size` vertices
    nearest to its seed.

    Args:
        vertices: Shape (n, 3).
        count: Number of clusters, at most n.
        size: Vertices in a cluster, at most n.

    Returns:
        Vertex indices of shape (count, size), the nearest first.
    """
    clusters = np.empty((count, size), dtype=np.intp)
    distance_to_seeds = np.full(len(vertices), np.inf)
    seed = 0
    for row in range(count):
        distance = np.sum((vertices - vertices[seed]) ** 2, axis=1)
        nearest = np.argpartition(distance, size - 1)[:size]
        clusters[row] = nearest[np.argsort(distance[nearest], kind="stable")]
        distance_to_seeds = np.minimum(distance_to_seeds, distance)
        seed = int(np.argmax(distance_to_seeds))
    return clusters

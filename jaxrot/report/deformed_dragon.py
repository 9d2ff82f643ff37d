"""The input that ships with the report: shape-matching matrices of deformations of the Stanford dragon.

Source: Müller et al. 2016, section 4 and Fig. 7, clustered shape matching of this model.
"""

import itertools
from collections.abc import Iterator

import numpy as np

from jaxrot.scenes.clusters import overlapping_clusters
from jaxrot.scenes.dragon import rest_vertices

NAME = "Stanford dragon"
CLUSTER_SIZE = 32


def twisted(vertices: np.ndarray, angle: float) -> np.ndarray:
    """The shape turned about the vertical, `angle` radians more at the top than at the bottom."""
    x, y, z = vertices.T
    cosine, sine = np.cos(angle * y), np.sin(angle * y)
    return np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=1)


def bent(vertices: np.ndarray, angle: float) -> np.ndarray:
    """The shape rolled up in its front plane, so that its two ends point `angle` radians apart."""
    x, y, z = vertices.T
    curvature = angle / np.ptp(x)
    radius = 1 / curvature - y
    return np.stack([radius * np.sin(curvature * x), 1 / curvature - radius * np.cos(curvature * x), z], axis=1)


def squashed(vertices: np.ndarray, height: float) -> np.ndarray:
    """The shape pressed to `height` of its height: 0 is flat, negative is turned inside out."""
    return vertices * np.array([1.0, height, 1.0])


def scrambled(vertices: np.ndarray, seed: int) -> np.ndarray:
    """Every vertex anywhere in the bounding box."""
    return np.random.default_rng(seed).uniform(vertices.min(axis=0), vertices.max(axis=0), vertices.shape)


def stages(vertices: np.ndarray, seed: int = 0) -> Iterator[tuple[str, np.ndarray]]:
    """Set name and vertices of the dragon at rest and in every deformation; several may share a set."""
    yield "at rest", vertices
    for angle in (0.5, 2.0, 6.0):
        yield "twisted", twisted(vertices, angle)
    for angle in (1.0, 4.0):
        yield "bent", bent(vertices, angle)
    for height in (0.5, 0.1, 0.01):
        yield "squashed", squashed(vertices, height)
    yield "flat", squashed(vertices, 0.0)
    for height in (-0.01, -0.1, -0.5, -1.0):
        yield "inverted", squashed(vertices, height)
    yield "scrambled", scrambled(vertices, seed)


def cluster_matrices(current: np.ndarray, rest: np.ndarray, clusters: np.ndarray) -> np.ndarray:
    """A_pq = Σ m (x − x̄)(q − q̄)ᵀ of every cluster, each of mass one.

    Args:
        current: Current vertices x, shape (n, 3).
        rest: The same vertices q at rest, shape (n, 3).
        clusters: Vertex indices of shape (count, size).

    Returns:
        Shape (count, 3, 3).
    """
    x, q = current[clusters], rest[clusters]
    x = x - x.mean(axis=1, keepdims=True)
    q = q - q.mean(axis=1, keepdims=True)
    return np.einsum("cki,ckj->cij", x, q) / clusters.shape[1]


def dragon_matrices(cluster_count: int) -> dict[str, np.ndarray]:
    """The matrices of every cluster at every stage, float64, by the name of the stage."""
    rest = rest_vertices()
    clusters = overlapping_clusters(rest, cluster_count, CLUSTER_SIZE)
    by_name = itertools.groupby(stages(rest), key=lambda stage: stage[0])
    return {
        name: np.concatenate([cluster_matrices(vertices, rest, clusters) for _, vertices in group])
        for name, group in by_name
    }

"""A deformable body of overlapping clusters, for shape matching.

Source: Müller et al. 2005, "Meshless deformations based on shape matching", sections 3.2 and 4.4.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxrot._compiled import exportable
from jaxrot.scenes.checks import check, checked_vertices
from jaxrot.scenes.clusters import padded, two_scale_clusters
from jaxrot.scenes.incidence import incidence


@exportable
class Body(NamedTuple):
    """A body of n vertices in c clusters of at most s vertices, each vertex in at most k clusters.

    The mass of a vertex is divided equally between its clusters. So the mean of the clusters' changes conserves
    momentum.
    """

    rest_positions: jax.Array  # Of the vertices, shape (n, 3), m
    masses: jax.Array  # Of the vertices, shape (n,), kg
    members: jax.Array  # The vertex in every place of a cluster, int32, shape (c, s); 0 in empty places
    shares: jax.Array  # The fraction of the cluster's mass in every place, shape (c, s); 0 in empty places
    offsets: jax.Array  # Places at rest from the cluster's centre of mass, shape (c, s, 3), m
    places: jax.Array  # The places of a vertex, int32 indices into the c·s places, shape (n, k), filled up with c·s
    cluster_counts: jax.Array  # The number of clusters of a vertex, shape (n,), as a floating-point number


def build_body(
    rest_vertices: ArrayLike,
    clusters: Sequence[Sequence[int] | np.ndarray] | np.ndarray,
    masses: ArrayLike | None = None,
    *,
    dtype: type = np.float32,
) -> Body:
    """Returns the body with this shape at rest.

    Args:
        rest_vertices: Shape (n, 3), m.
        clusters: Vertex indices of every cluster. Lengths may differ; every vertex must be in a cluster.
        masses: Of the vertices, shape (n,), kg; 1/n each if not given.
        dtype: Of the floating-point arrays.

    Raises:
        ValueError: No or non-finite vertices; a mass that is not positive; a cluster that is empty, holds a vertex
            twice or one that does not exist; a vertex in no cluster.
    """
    vertices = checked_vertices(rest_vertices)
    mass = np.full(len(vertices), 1 / len(vertices)) if masses is None else np.asarray(masses, dtype=np.float64)
    if mass.shape != (len(vertices),):
        raise ValueError(f"masses must have shape ({len(vertices)},); got {mass.shape}")
    check("finite and > 0", masses=mass)
    members, filled = padded(clusters, len(vertices))
    places, counts = incidence(members, len(vertices), filled=filled)
    shares = np.where(filled, (mass / counts)[members], 0.0)
    shares /= shares.sum(axis=1, keepdims=True)
    centres = np.einsum("cs,csi->ci", shares, vertices[members])
    offsets = np.where(filled[..., None], vertices[members] - centres[:, None], 0.0)
    places, members = (jnp.asarray(indices, jnp.int32) for indices in (places, members))
    vertices, mass, shares, offsets, counts = (
        jnp.asarray(numbers, dtype) for numbers in (vertices, mass, shares, offsets, counts)
    )
    return Body(vertices, mass, members, shares, offsets, places, counts)


def build_two_scale_body(
    rest_vertices: ArrayLike, masses: ArrayLike | None = None, *, cluster_size: int = 32, dtype: type = np.float32
) -> Body:
    """Returns a body with clusters of neighbours, two for every vertex on average, and clusters across the whole body.

    Each cluster has `cluster_size` vertices. The other arguments are those of `build_body`. Building takes time in
    proportion to n², a second for 23,000 vertices. A step takes time in proportion to n.
    """
    check("finite and > 0", cluster_size=cluster_size)
    vertices = checked_vertices(rest_vertices)
    return build_body(vertices, two_scale_clusters(vertices, cluster_size), masses, dtype=dtype)

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
from jaxrot.scenes.clusters import padded, two_scale_clusters
from jaxrot.scenes.incidence import incidence
from jaxrot.scenes.scene import LARGEST_COORDINATE


@exportable
class Body(NamedTuple):
    """A body of n vertices in c clusters of at most s vertices, each vertex in at most k clusters.

    The mass of a vertex is divided equally between its clusters. So the mean of the clusters' changes conserves
    momentum.

    Attributes:
        rest_positions: Of the vertices, m, shape (n, 3).
        masses: Of the vertices, kg, shape (n,).
        members: The vertex in every place of a cluster, int32, shape (c, s); 0 in empty places.
        shares: The fraction of the cluster's mass in every place, shape (c, s). They sum to 1, and are 0 in empty
            places.
        offsets: Places at rest from the cluster's centre of mass, m, shape (c, s, 3).
        places: The places of a vertex, int32 indices into the c·s places, shape (n, k), filled up with c·s.
        cluster_counts: The number of clusters of a vertex, shape (n,), as a floating-point number.
    """

    rest_positions: jax.Array
    masses: jax.Array
    members: jax.Array
    shares: jax.Array
    offsets: jax.Array
    places: jax.Array
    cluster_counts: jax.Array


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
        masses: Of the vertices, kg, shape (n,); 1/n each if not given.
        dtype: Of the floating-point arrays.

    Raises:
        ValueError: No or non-finite vertices; a mass that is not positive; a cluster that is empty, holds a vertex
            twice or one that does not exist; a vertex in no cluster.
    """
    vertices = checked_vertices(rest_vertices)
    mass = np.full(len(vertices), 1 / len(vertices)) if masses is None else np.asarray(masses, dtype=np.float64)
    if mass.shape != (len(vertices),) or not (np.isfinite(mass).all() and (mass > 0).all()):
        raise ValueError(
            f"masses must be {len(vertices)} positive finite numbers; got shape {mass.shape}{_worst(mass)}"
        )
    members, filled = padded(clusters, len(vertices))
    places, counts = incidence(members, len(vertices), filled=filled)
    shares = np.where(filled, (mass / counts)[members], 0.0)
    shares /= shares.sum(axis=1, keepdims=True)
    centres = np.einsum("cs,csi->ci", shares, vertices[members])
    offsets = np.where(filled[..., None], vertices[members] - centres[:, None], 0.0)
    return Body(
        jnp.asarray(vertices, dtype),
        jnp.asarray(mass, dtype),
        jnp.asarray(members, jnp.int32),
        jnp.asarray(shares, dtype),
        jnp.asarray(offsets, dtype),
        jnp.asarray(places, jnp.int32),
        jnp.asarray(counts, dtype),
    )


def build_two_scale_body(
    rest_vertices: ArrayLike, masses: ArrayLike | None = None, *, cluster_size: int = 32, dtype: type = np.float32
) -> Body:
    """Returns a body with clusters of neighbours, two for every vertex on average, and clusters across the whole body.

    Args:
        rest_vertices: Shape (n, 3), m.
        masses: Of the vertices, kg, shape (n,); 1/n each if not given.
        cluster_size: Vertices in a cluster.
        dtype: Of the floating-point arrays.

    Raises:
        ValueError: As `build_body`; a size that is not positive.

    Cost:
        Building takes time in proportion to n², a second for 23,000 vertices. A step takes time in proportion to n.
    """
    if cluster_size < 1:
        raise ValueError(f"cluster_size must be positive; got {cluster_size}")
    vertices = checked_vertices(rest_vertices)
    return build_body(vertices, two_scale_clusters(vertices, cluster_size), masses, dtype=dtype)


def checked_vertices(vertices: ArrayLike, name: str = "vertices") -> np.ndarray:
    """Returns the vertices as float64 of shape (n, 3), or raises a ValueError."""
    checked = np.asarray(vertices, dtype=np.float64)
    if checked.ndim != 2 or checked.shape[1] != 3 or not len(checked):
        raise ValueError(f"{name} must have shape (n, 3), n > 0; got shape {checked.shape}")
    bad = np.flatnonzero(~np.isfinite(checked).all(axis=1))
    if len(bad):
        raise ValueError(f"{name} must be finite; vertex {bad[0]} is {checked[bad[0]].tolist()}")
    if np.abs(checked).max() > LARGEST_COORDINATE:
        raise ValueError(
            f"{name} must be at most {LARGEST_COORDINATE:g} from the origin; got {np.abs(checked).max():.3g}"
        )
    return checked


def _worst(masses: np.ndarray) -> str:
    bad = masses[~(np.isfinite(masses) & (masses > 0))]
    return f" with {bad.ravel()[0]}" if bad.size else ""

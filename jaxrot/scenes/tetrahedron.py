"""The tetrahedron of Figs. 3 to 5: its tip is pushed through the base, and each frame refines the rotation of the last.

Source: Müller et al. 2016, section 4. The paper gives no shape. The deformation gradient depends only on the slant, the
angle between the path and the normal of the base.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxrot import nearest_rotation, refine_rotation, rotation_gap
from jaxrot._compiled import exportable
from jaxrot.scenes.checks import checked_vertices
from jaxrot.scenes.rotations import angle_between as angle_between
from jaxrot.scenes.rotations import orthonormality_error
from jaxrot.scenes.scene import Scene

SPIKE = -0.66  # det F where Fig. 4 has its spike
SLANT = 0.5 * float(np.arccos(-SPIKE))  # where the rotation turns fastest at that determinant, −cos 2θ
RADIUS = float(np.sqrt(-SPIKE / 2))  # of the base: the shape-matching matrix has its jump there, −2 radius²
_MATRICES = ("deformation_gradient", "shape_matching")
_FRAMES = 320


@exportable
class State(NamedTuple):
    """The rotation of one frame."""

    rotation: jax.Array  # Extracted in this frame, the start of the next one, shape (3, 3)
    frame: jax.Array  # The number of the frame, int32, shape ()


@exportable
class Parameters(NamedTuple):
    """The tetrahedron and the path of its tip, which a step does not change."""

    tip_path: jax.Array  # The tip in every frame, shape (frames, 3), m. It stays where it is after the last.
    base: jax.Array  # The three fixed vertices, shape (3, 3), a vertex a row, m
    # The factor of A = edges · shape for the edges [x₁−x₀ x₂−x₀ x₃−x₀], shape (3, 3). For the deformation gradient it
    # is the inverse of the edges at rest, 1/m; for shape matching that times Σ x̄ x̄ᵀ, m.
    shape: jax.Array


def slanted_tetrahedron(slant: float = SLANT, radius: float = RADIUS) -> np.ndarray:
    """Returns vertices of shape (4, 3), the tip at (1, 0, 0) last.

    The base is a regular triangle around the origin. Its normal is off the x-axis by the slant (rad).
    """
    angle = 2 * np.pi / 3 * np.arange(3)[:, None]
    base = np.cos(angle) * [-np.sin(slant), np.cos(slant), 0] + np.sin(angle) * [0.0, 0, 1]
    return np.vstack([radius * base, [1.0, 0, 0]])


def pushed_through(frames: int = _FRAMES) -> np.ndarray:
    """Returns the path of the tip on the x-axis from 1 through the base at 0 to its mirror image at −1.

    It has the shape (frames + 1, 3). For `slanted_tetrahedron` x = det F.
    """
    path = np.zeros((frames + 1, 3))
    path[:, 0] = np.linspace(1, -1, frames + 1)
    return path


def build(
    rest: ArrayLike, tip_path: ArrayLike, *, matrix: str = "deformation_gradient", dtype: type = np.float32
) -> tuple[State, Parameters]:
    """Returns the first state, with the identity, and the parameters of a tetrahedron and the path of its tip.

    Args:
        rest: Vertices at rest, the tip last, shape (4, 3), m.
        tip_path: The tip in every frame, shape (frames, 3), m.
        matrix: The matrix whose rotation is extracted: "deformation_gradient", or "shape_matching", Σ x x̄ᵀ over the
            four vertices relative to their mean.
        dtype: Of all arrays, float32 or float64.
    """
    if np.shape(rest) != (4, 3):
        raise ValueError(f"rest must have shape (4, 3), a vertex a row; got {np.shape(rest)}")
    vertices, path = checked_vertices(rest, "rest"), checked_vertices(tip_path, "tip_path")
    if matrix not in _MATRICES:
        raise ValueError(f"matrix must be one of {', '.join(_MATRICES)}; got {matrix!r}")
    edges = (vertices[1:] - vertices[0]).T
    if np.linalg.cond(edges) > 1e6:  # as many digits as float32 has
        raise ValueError("rest must be a tetrahedron with a volume; got a flat one")
    shape = np.linalg.inv(edges)
    if matrix == "shape_matching":
        offsets = vertices - np.mean(vertices, axis=0)
        shape = shape @ (offsets.T @ offsets)
    arrays = (jnp.asarray(array, dtype=dtype) for array in (path, vertices[:3], shape))
    return State(jnp.eye(3, dtype=dtype), jnp.int32(0)), Parameters(*arrays)


def vertices_in(parameters: Parameters, frame: jax.Array) -> jax.Array:
    """Returns the four vertices in a frame, the tip last, m, shape (4, 3)."""
    last = len(parameters.tip_path) - 1
    return jnp.concatenate([parameters.base, parameters.tip_path[jnp.minimum(frame, last)][None]])


def matrix_in(parameters: Parameters, frame: jax.Array) -> jax.Array:
    """Returns the matrix whose rotation is extracted in a frame, shape (3, 3)."""
    vertices = vertices_in(parameters, frame)
    edges = vertices[1:] - vertices[:1]
    return jnp.sum(edges[:, :, None] * parameters.shape[:, None, :], axis=0)


def step(
    state: State,
    parameters: Parameters,
    *,
    rotation_step: str = "torque",
    iterations: int = 1,
    escape: bool = False,
    method: str | None = None,
) -> State:
    """Returns the state one frame later: the tip moves on, and the rotation of the matrix is extracted.

    Args:
        state: See `State`.
        parameters: See `Parameters`.
        rotation_step: A name in `STEPS`, run from the rotation of the last frame. Static.
        iterations: The number of these steps. Static.
        escape: Leave a start half a turn from the solution, see `refine_rotation`. Static.
        method: A name in `METHODS`, run from a cold start instead of the steps, or None. Static.

    Raises:
        ValueError: Unknown step or method, negative iterations.

    Derivative:
        With steps that of the computation, through all frames; with a method that of the nearest rotation.

    Example:
        >>> from jaxrot.scenes import tetrahedron
        >>> first, parameters = tetrahedron.build(tetrahedron.slanted_tetrahedron(), tetrahedron.pushed_through())
        >>> tetrahedron.step(first, parameters).frame.item()
        1
    """
    frame = state.frame + 1
    matrix = matrix_in(parameters, frame)
    if method is not None:
        return State(nearest_rotation(matrix, method=method), frame)
    # Unrolled: one iteration a frame does not converge, and the implicit derivative would be wrong.
    rotation = refine_rotation(
        matrix, state.rotation, step=rotation_step, iterations=iterations, escape=escape, derivative="unrolled"
    )
    return State(rotation, frame)


def follow(state: State, parameters: Parameters, **choices: Any) -> jax.Array:
    """Returns the rotations of all frames, the first as given, shape (frames, 3, 3); options as for `step`."""

    def advance(now: State, _: None) -> tuple[State, jax.Array]:
        after = step(now, parameters, **choices)
        return after, after.rotation

    rotations = lax.scan(advance, state, None, length=len(parameters.tip_path) - 1)[1]
    return jnp.concatenate([state.rotation[None], rotations])


def tetrahedron() -> Scene:
    """Returns the scene of Fig. 3: the tip is pushed through the base in 320 frames of one torque iteration each."""
    start, parameters = build(slanted_tetrahedron(), pushed_through())

    def health(state: State) -> dict[str, jax.Array]:
        matrix = matrix_in(parameters, state.frame)
        identity = jnp.eye(3, dtype=matrix.dtype)
        return {
            "det F (1)": jnp.dot(jnp.cross(matrix[0], matrix[1]), matrix[2], precision="highest"),
            "gap (s2+s3)/s1 (1)": rotation_gap(matrix),
            "turned by (rad)": angle_between(state.rotation, identity),
            "distance to the nearest rotation (rad)": angle_between(state.rotation, nearest_rotation(matrix)),
            "orthonormality error (1)": orthonormality_error(state.rotation),
        }

    def points(state: State) -> jax.Array:
        vertices = vertices_in(parameters, state.frame)
        middle = jnp.mean(parameters.base, axis=0, keepdims=True)
        drawn = jnp.concatenate([vertices, middle, middle + 0.5 * jnp.swapaxes(state.rotation, 0, 1)])
        return jnp.roll(drawn, -1, axis=-1)  # the path, along x, upright

    lines = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3), (4, 5), (4, 6), (4, 7)])
    title = "A tetrahedron pushed through its base, one torque iteration a frame"
    return Scene(title, start, lambda state: step(state, parameters), health, points, 1 / 60, _FRAMES, lines)

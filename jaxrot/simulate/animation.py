"""The animation of a run, as a GIF."""

import tempfile
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from jaxrot.simulate.recording import Recording

_FRAMES_A_SECOND = 20
_COLOR = "#0072B2"  # Okabe and Ito's blue


def draw_animation(recording: Recording, lines: np.ndarray, title: str) -> bytes:
    """The points, or the lines between them, frame by frame, from one side and at one scale."""
    # By its backend and without pyplot: nothing global is touched.
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 5), dpi=100)
    FigureCanvasAgg(figure)
    axes: Any = figure.add_axes((0.0, 0.0, 1.0, 0.92), projection="3d")
    axes.set_axis_off()
    axes.view_init(elev=15, azim=-65)
    # In float64: the width of a body that has exploded may be beyond float32. For an infinity, unlike a NaN, Matplotlib
    # would print a warning.
    points = np.where(np.isfinite(recording.points), recording.points, np.nan).astype(np.float64)
    _set_limits(axes, points)
    figure.text(0.5, 0.98, textwrap.fill(title, 60), ha="center", va="top", fontsize=11)
    clock = figure.text(0.02, 0.02, "", fontsize=10, family="monospace")
    move = _lines(axes, lines) if len(lines) else _points(axes, points.shape[1])

    def frame(index: int) -> list[Any]:
        move(points[index])
        clock.set_text(f"t = {recording.times[index]:.3g} s")
        return []

    animation = FuncAnimation(figure, frame, frames=len(points), init_func=lambda: [])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "animation.gif"
        animation.save(path, writer=PillowWriter(fps=_FRAMES_A_SECOND))
        return path.read_bytes()


def _points(axes: Any, count: int) -> Any:
    size = float(np.clip(2e4 / count, 1, 40))
    scatter = axes.scatter([0.0], [0.0], [0.0], s=size, color=_COLOR, edgecolors="none", depthshade=True)

    def move(points: np.ndarray) -> None:
        scatter._offsets3d = tuple(points.T)

    return move


def _lines(axes: Any, lines: np.ndarray) -> Any:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    collection = axes.add_collection3d(Line3DCollection(np.zeros((len(lines), 2, 3)), colors=_COLOR, linewidths=0.8))

    def move(points: np.ndarray) -> None:
        collection.set_segments(points[lines])

    return move


def _set_limits(axes: Any, points: np.ndarray) -> None:
    """One cube for all frames, as large as needed by all points but the few that fly away furthest."""
    finite = points[np.isfinite(points).all(axis=-1)]
    lower, upper = np.quantile(finite, [0.001, 0.999], axis=0) if len(finite) else (np.zeros(3), np.ones(3))
    centre = (lower + upper) / 2
    # A cube of no width cannot be drawn.
    smallest = max(np.finfo(np.float32).tiny, np.finfo(np.float32).eps * np.abs(centre).max())
    half = max(float(np.max(upper - lower)) / 2, smallest)
    for set_limits, middle in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), centre, strict=True):
        set_limits(middle - half, middle + half)
    axes.set_box_aspect((1, 1, 1), zoom=1.3)

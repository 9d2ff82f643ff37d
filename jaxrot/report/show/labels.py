"""Labels of points that cover neither each other nor points and lines."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

Array = np.ndarray

_DISTANCE = 6.0  # from a point to its label, in typographic points; farther labels take multiples of it
_RINGS, _DIRECTIONS = 16, 16
_MARKER, _LINE = 5.0, 1.5  # half widths, likewise


class _Place(NamedTuple):
    """A candidate place of a label: its box (left, bottom, right, top) in pixels, and its cost."""

    box: np.ndarray
    cost: float
    has_leader: bool


def place_labels(
    axes: Any, labels: Sequence[tuple[str, float, float]], lines: Sequence[tuple[float, float]] = ()
) -> None:
    """Writes each label near its point.

    A label goes to the first place where it covers nothing, is nearest to its own point and stays inside the axes. If
    there is none, it goes to the place of least cost. A label far from its point gets a leader line.

    Args:
        axes: Matplotlib axes whose limits and layout are final.
        labels: Name, x and y of every point.
        lines: Places x, y along lines that labels should not cover.
    """
    figure = axes.figure
    renderer = figure.canvas.get_renderer()
    to_pixels = figure.dpi / 72
    points = axes.transData.transform([(x, y) for _, x, y in labels]).reshape(-1, 2)
    soft = _squares(axes.transData.transform(lines) if lines else np.empty((0, 2)), _LINE * to_pixels)
    # Text that is already in the axes is an obstacle too.
    texts = [text.get_window_extent(renderer).extents for text in axes.texts]
    hard = np.concatenate([_squares(points, _MARKER * to_pixels), np.reshape(texts, (-1, 4))])
    inside = np.array(axes.get_window_extent(renderer).extents)
    for number, (name, x, y) in enumerate(labels):
        probe = axes.text(x, y, name, fontsize=8)
        extent = probe.get_window_extent(renderer)
        probe.remove()
        size, others = np.array([extent.width, extent.height]), np.delete(points, number, axis=0)
        distance = _DISTANCE * to_pixels
        place = _best_place(points[number], others, size, hard=hard, soft=soft, inside=inside, distance=distance)
        hard = np.concatenate([hard, place.box[None]])
        offset = tuple((place.box[:2] - points[number]) / to_pixels)
        leader = {"arrowstyle": "-", "color": "0.5", "linewidth": 0.6, "shrinkB": 4} if place.has_leader else None
        axes.annotate(name, (x, y), offset, textcoords="offset points", fontsize=8, zorder=4, arrowprops=leader)


def _best_place(
    point: Array, others: Array, size: Array, *, hard: Array, soft: Array, inside: Array, distance: float
) -> _Place:
    """The place of least cost for a label of a size in pixels; covering a `hard` box costs ten times a `soft` one."""
    best = _Place(np.zeros(4), np.inf, False)
    area = np.prod(size)
    angles = _angles(point, others, 15 * distance)
    for ring in range(1, _RINGS + 1):
        for angle in angles:
            # The distance is that of the label's nearest edge.
            centre = point + np.array([np.cos(angle), np.sin(angle)]) * (ring * distance + size / 2)
            box = np.concatenate([centre - size / 2, centre + size / 2])
            cost = 10 * _overlaps(box, hard).sum() + _overlaps(box, soft).sum()
            cost += 10 * (area - _overlaps(box, inside[None])[0])
            has_leader = ring > 2
            if not has_leader and np.any(_gaps(box, others) < 1.3 * _gaps(box, point[None])):
                cost += 0.3 * area  # the reader would take it for the other point's label
            if cost < best.cost - 1e-6:
                best = _Place(box, float(cost), has_leader)
        if best.cost <= 1e-6:
            break
    return best


def _angles(point: np.ndarray, others: np.ndarray, near: float) -> np.ndarray:
    """The directions to try: first away from near points, or to the right."""
    away = point - others
    square = np.sum(away**2, axis=1)
    is_near = (square > 0) & (square < near**2)
    x, y = np.sum(away[is_near] / square[is_near, None], axis=0)
    turns = np.arange(_DIRECTIONS)
    return np.arctan2(y, x) + 2 * np.pi / _DIRECTIONS * ((turns + 1) // 2) * (-1.0) ** turns


def _squares(centres: np.ndarray, half_width: float) -> np.ndarray:
    return np.concatenate([centres - half_width, centres + half_width], axis=1)


def _overlaps(box: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The area a box shares with each of the others."""
    sides = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    return np.prod(np.maximum(sides, 0), axis=1)


def _gaps(box: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How far each of the points lies from a box."""
    return np.linalg.norm(np.maximum(np.maximum(box[:2] - points, points - box[2:]), 0), axis=1)

"""Error against time as a picture, with the Pareto front."""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxrot.report.measure.front import APPROXIMATION, EXACT, PEER, Point, pareto_front
from jaxrot.report.show.figures import as_png, new_figure, prepare_error_axes
from jaxrot.report.show.labels import place_labels

# The colours of Okabe and Ito differ without red or green vision. Shape and filling differ in grey too.
_STYLES = {
    EXACT: {"color": "#0072B2", "marker": "o"},
    APPROXIMATION: {"color": "#D55E00", "marker": "^"},
    PEER: {"color": "#8A4B73", "marker": "s"},
}
_FRONT_COLOR = "#009E73"
# ‖R - R*‖_F is at most 2√2 between rotations. Larger and infinite errors are drawn there.
_LARGEST_ERROR = 8**0.5
_VALUE_ERROR = "forward error ‖R - R*‖$_F$, 99th percentile"


class Panel(NamedTuple):
    """The points of one dtype, with the batch size of their times."""

    dtype: str
    batch: int
    points: Sequence[Point]


def draw_pareto(panels: Sequence[Panel], title: str, error_name: str = _VALUE_ERROR) -> bytes:
    """The picture as PNG, one panel for each dtype. The front is that of jaxrot; a filled peer is beyond it."""
    figure = new_figure((1.5 + 5.7 * len(panels), 5.8), title)
    all_axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for axes, panel in zip(all_axes, panels, strict=True):
        _draw_panel(axes, panel)
        axes.set_ylabel(error_name)
    _draw_legend(figure, panels)
    figure.canvas.draw()
    # The layout must not change any more, because each label is placed relative to drawn neighbours.
    figure.set_layout_engine("none")
    for axes, panel in zip(all_axes, panels, strict=True):
        floor = _floor(panel.dtype)
        names = [f"{point.name}{'' if np.isfinite(point.error_max) else ' (NaN)'}" for point in panel.points]
        places = [(point.time_ns, _clip(point.error, floor)) for point in panel.points]
        labels = [(name, *place) for name, place in zip(names, places, strict=True)]
        whiskers = [
            (point.time_ns, _clip(error, floor))
            for point in panel.points
            for error in np.geomspace(_clip(point.error_median, floor), _clip(point.error_max, floor), 12)
        ]
        place_labels(axes, labels, whiskers + _front_line(panel, floor))
    return as_png(figure)


def _own_front(panel: Panel) -> list[Point]:
    return pareto_front([point for point in panel.points if point.kind != PEER])


def _front_line(panel: Panel, floor: float) -> list[tuple[float, float]]:
    """Places along the front, so close that no label fits between them."""
    front = [(point.time_ns, _clip(point.error, floor)) for point in _own_front(panel)]
    line = []
    for (x, y), (next_x, next_y) in itertools.pairwise(front):
        line += [(place, y) for place in np.geomspace(x, next_x, 60).tolist()]
        line += [(next_x, place) for place in np.geomspace(y, next_y, 60).tolist()]
    return line


def _draw_panel(axes: Any, panel: Panel) -> None:
    floor, front = _floor(panel.dtype), _own_front(panel)
    prepare_error_axes(axes, panel.dtype, panel.batch)
    axes.plot(
        [point.time_ns for point in front], [_clip(point.error, floor) for point in front],
        color=_FRONT_COLOR, linewidth=2, alpha=0.6, zorder=1, drawstyle="steps-post",
    )  # fmt: skip
    for point in panel.points:
        style = _STYLES[point.kind]
        ends = [_clip(point.error_median, floor), _clip(point.error_max, floor)]
        axes.plot([point.time_ns] * 2, ends, color=style["color"], linewidth=1, alpha=0.5, zorder=2)
        axes.plot(
            point.time_ns, _clip(point.error, floor), linestyle="none", markersize=8, zorder=3,
            markerfacecolor=style["color"] if point in front or point.is_beyond else "white",
            markeredgecolor=style["color"], marker=style["marker"],
        )  # fmt: skip
    # Leave room for the labels of the outermost points.
    times = [point.time_ns for point in panel.points]
    axes.set_xlim(min(times) / 2.2, max(times) * 2.2)
    lower, upper = axes.get_ylim()
    axes.set_ylim(lower / 2, upper * 2)
    axes.set_xlabel("time per matrix [ns], median")


def _draw_legend(figure: Any, panels: Sequence[Panel]) -> None:
    from matplotlib.lines import Line2D

    points = [point for panel in panels for point in panel.points]

    def marker(label: str, **style: Any) -> Any:
        return Line2D([], [], linestyle="none", markersize=8, label=label, **style)

    handles = [marker(kind, **style) for kind, style in _STYLES.items() if any(point.kind == kind for point in points)]
    handles += [
        marker("hollow: another is faster and more accurate", marker="o", color="0.3", markerfacecolor="white"),
        Line2D([], [], color=_FRONT_COLOR, linewidth=2, alpha=0.6, label="Pareto front of jaxrot"),
        Line2D([], [], color="0.3", linewidth=1, label="from median to largest error"),
    ]
    if any(point.error_median < _floor(panel.dtype) for panel in panels for point in panel.points):
        handles.append(marker("errors below eps/10 are drawn there"))
    if any(not np.isfinite(point.error_max) for point in points):
        handles.append(marker("(NaN): some results are not finite, drawn at 2√2"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(3, 1 + len(panels)), fontsize=8, frameon=False)


def _floor(dtype: str) -> float:
    """The place of an error of zero."""
    return float(np.finfo(dtype).eps) / 10


def _clip(error: float, floor: float) -> float:
    return min(max(error, floor), _LARGEST_ERROR)

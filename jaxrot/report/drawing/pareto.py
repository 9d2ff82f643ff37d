"""Error against time as a picture, and which methods nothing else beats in both."""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxrot.report.drawing.figures import as_png, new_figure
from jaxrot.report.drawing.labels import place_labels

# Okabe and Ito's colours, told apart without seeing red or green; shape and filling tell the kinds apart in grey too.
EXACT, APPROXIMATION, PEER = "exact method", "approximation", "another package"
_STYLES = {
    EXACT: {"color": "#0072B2", "marker": "o"},
    APPROXIMATION: {"color": "#D55E00", "marker": "^"},
    PEER: {"color": "#8A4B73", "marker": "s"},
}
_FRONT_COLOR = "#009E73"
# ‖R - R*‖_F is at most 2√2 between rotations; what is larger or no number is drawn there.
_LARGEST_ERROR = 8**0.5
_VALUE_ERROR = "forward error ‖R - R*‖$_F$, 99th percentile"


class Point(NamedTuple):
    """One method or peer in the picture.

    Attributes:
        name: Its label.
        time_ns: Median time a matrix.
        error: The error that places it: the 99th percentile.
        error_median: Lower end of its whisker.
        error_max: Upper end.
        kind: `EXACT`, `APPROXIMATION` or `PEER`.
        is_beyond: For a peer: it is beyond the front of the others.
    """

    name: str
    time_ns: float
    error: float
    error_median: float
    error_max: float
    kind: str
    is_beyond: bool = False


class Panel(NamedTuple):
    """One dtype.

    Attributes:
        dtype: "float32" or "float64".
        batch: The batch size of the times.
        points: The methods.
    """

    dtype: str
    batch: int
    points: Sequence[Point]


def pareto_front(points: Sequence[Point]) -> list[Point]:
    """The points that no other beats: none is at least as fast and as accurate, and better in one. Fastest first.

    A point whose error is infinite is on no front, however fast it is.
    """
    front: list[Point] = []
    is_number = [point for point in points if np.isfinite(point.error)]
    for point in sorted(is_number, key=lambda point: (point.time_ns, point.error)):
        is_twin = bool(front) and (point.time_ns, point.error) == (front[-1].time_ns, front[-1].error)
        if not front or point.error < front[-1].error or is_twin:
            front.append(point)
    return front


def draw_pareto(panels: Sequence[Panel], title: str, error_name: str = _VALUE_ERROR) -> bytes:
    """The picture as PNG, one panel a dtype. The front is jaxrot's own; a filled peer is beyond it."""
    figure = new_figure((1.5 + 5.7 * len(panels), 5.8))
    all_axes = figure.subplots(1, len(panels), squeeze=False)[0]
    figure.suptitle(title, fontsize=11)
    for axes, panel in zip(all_axes, panels, strict=True):
        _draw_panel(axes, panel)
        axes.set_ylabel(error_name)
    _draw_legend(figure, panels)
    figure.canvas.draw()
    # From here the layout must hold still: a label is placed where its neighbours are drawn.
    figure.set_layout_engine("none")
    for axes, panel in zip(all_axes, panels, strict=True):
        floor = _floor(panel.dtype)
        labels = [
            (point.name if np.isfinite(point.error_max) else f"{point.name} (NaN)", point.time_ns, y)
            for point in panel.points
            for y in [_clip(point.error, floor)]
        ]
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
    """Places along the drawn front, close enough together that no word fits between."""
    front = [(point.time_ns, _clip(point.error, floor)) for point in _own_front(panel)]
    line = []
    for (x, y), (next_x, next_y) in itertools.pairwise(front):
        line += [(place, y) for place in np.geomspace(x, next_x, 60).tolist()]
        line += [(next_x, place) for place in np.geomspace(y, next_y, 60).tolist()]
    return line


def _draw_panel(axes: Any, panel: Panel) -> None:
    eps, floor = np.finfo(panel.dtype).eps, _floor(panel.dtype)
    front = _own_front(panel)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.axhline(eps, color="0.6", linewidth=0.8, linestyle=":")
    axes.annotate(
        f"eps = {eps:.1e}", (1, eps), xycoords=("axes fraction", "data"), xytext=(-3, 2), textcoords="offset points",
        ha="right", va="bottom", fontsize=7, color="0.4",
    )  # fmt: skip
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
    # Room for labels beside the outermost points.
    times = [point.time_ns for point in panel.points]
    axes.set_xlim(min(times) / 2.2, max(times) * 2.2)
    lower, upper = axes.get_ylim()
    axes.set_ylim(lower / 2, upper * 2)
    axes.grid(True, which="major", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_title(f"{panel.dtype}, batch {panel.batch:,}", fontsize=10)
    axes.set_xlabel("time a matrix [ns], median")


def _draw_legend(figure: Any, panels: Sequence[Panel]) -> None:
    from matplotlib.lines import Line2D

    points = [point for panel in panels for point in panel.points]
    handles = []
    for kind, style in _STYLES.items():
        if any(point.kind == kind for point in points):
            handles.append(
                Line2D([], [], linestyle="none", markersize=8, label=kind, color=style["color"], marker=style["marker"])
            )
    handles.append(
        Line2D([], [], linestyle="none", markersize=8, marker="o", color="0.3", markerfacecolor="white",
               label="hollow: another is faster and more accurate")
    )  # fmt: skip
    handles.append(Line2D([], [], color=_FRONT_COLOR, linewidth=2, alpha=0.6, label="Pareto front of jaxrot"))
    handles.append(Line2D([], [], color="0.3", linewidth=1, label="from median to largest error"))
    if any(point.error_median < _floor(panel.dtype) for panel in panels for point in panel.points):
        handles.append(Line2D([], [], linestyle="none", label="errors below eps/10 are drawn there"))
    if any(not np.isfinite(point.error_max) for panel in panels for point in panel.points):
        handles.append(Line2D([], [], linestyle="none", label="(NaN): some results are no numbers, drawn at 2√2"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(3, 1 + len(panels)), fontsize=8, frameon=False)


def _floor(dtype: str) -> float:
    """Where an error of zero is drawn."""
    return float(np.finfo(dtype).eps) / 10


def _clip(error: float, floor: float) -> float:
    return min(max(error, floor), _LARGEST_ERROR)

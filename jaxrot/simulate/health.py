"""The health of a run: a plot of what was watched, the same numbers as a table, and what went wrong."""

import csv
import io
import textwrap
from typing import Any

import numpy as np

from jaxrot.simulate.recording import Recording

# Okabe and Ito's colours, told apart without seeing red or green.
_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#000000")


def draw_health(recording: Recording, title: str) -> bytes:
    """A panel for each unit. Values that are never negative and span decades get a logarithmic axis."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = _by_unit(recording.health)
    columns = min(len(panels), 2)
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(5 * columns, 2.7 * rows + 0.5), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(textwrap.fill(title, 50 * columns), fontsize=11)
    for number, (unit, numbers) in enumerate(panels.items(), start=1):
        axes = figure.add_subplot(rows, columns, number)
        axes.set_prop_cycle(color=_COLORS)
        for name, values in numbers.items():
            axes.plot(recording.times, values, label=name, linewidth=1.4)
        _scale(axes, np.concatenate(list(numbers.values())))
        axes.set_xlabel("simulated time (s)")
        axes.set_ylabel("without unit" if unit == "1" else unit)
        axes.legend(fontsize=8, frameon=False)
        axes.grid(alpha=0.3)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def as_csv(recording: Recording) -> str:
    """A row a frame."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["time (s)", *recording.health])
    writer.writerows(np.stack([recording.times, *recording.health.values()], axis=1).tolist())
    return buffer.getvalue()


def complaints(recording: Recording) -> list[str]:
    """One line for each watched number, and for the points, that did not stay finite."""
    positions = np.isfinite(recording.points).all(axis=(1, 2))
    finite = {"a position": positions, **{name: np.isfinite(values) for name, values in recording.health.items()}}
    return [
        f"{name} is not finite from t = {recording.times[np.argmin(ok)]:.3g} s on"
        for name, ok in finite.items()
        if not ok.all()
    ]


def _by_unit(health: dict[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
    """The numbers by unit and name; one named "speed (m/s)" has the unit m/s, one without parentheses none."""
    panels: dict[str, dict[str, np.ndarray]] = {}
    for full_name, values in health.items():
        name, _, unit = full_name.removesuffix(")").rpartition(" (")
        panels.setdefault(unit if name else "1", {})[name or full_name] = values
    return panels


def _scale(axes: Any, values: np.ndarray) -> None:
    positive = values[np.isfinite(values) & (values > 0)]
    if (values < 0).any() or not len(positive) or positive.max() < 1e3 * positive.min():
        return
    # What is 0 stays visible, at the lower edge.
    axes.set_yscale("symlog", linthresh=max(float(positive.min()), 1e-12 * float(positive.max())))

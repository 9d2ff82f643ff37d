"""Figures, colours and legends that the pictures share."""

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

# Pale for the contract, and for failures two colours outside of viridis: the vermilion of Okabe and Ito, and black.
# The errors between take viridis, which is readable without red or green vision.
KEPT = "#DDE5EA"
NOT_A_ROTATION = "#D55E00"
NOT_FINITE = "#000000"


def new_figure(size: tuple[float, float], title: str) -> Any:
    """A figure of a size in inches, with 150 pixels per inch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # pyplot would open a display and keep the figure for the whole process.
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=11)
    return figure


def prepare_error_axes(axes: Any, dtype: str, batch: int) -> None:
    """Logarithmic axes of an error against a time, with a line at eps."""
    eps = float(np.finfo(dtype).eps)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.axhline(eps, color="0.6", linewidth=0.8, linestyle=":")
    axes.annotate(
        f"eps = {eps:.1e}", (1, eps), xycoords=("axes fraction", "data"), xytext=(-3, 2), textcoords="offset points",
        ha="right", va="bottom", fontsize=7, color="0.4",
    )  # fmt: skip
    axes.grid(True, which="major", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_title(f"{dtype}, batch {batch:,}", fontsize=10)


def as_png(figure: Any) -> bytes:
    """The picture as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def patches(colors: Mapping[str, Any]) -> list[Any]:
    """Coloured patches for a legend, by their labels."""
    from matplotlib.patches import Patch

    return [Patch(facecolor=color, edgecolor="0.5", linewidth=0.4, label=word) for word, color in colors.items()]

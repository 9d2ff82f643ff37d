"""What the pictures of maps and of survivors share: figures, the colours of what came out, patches for a legend."""

import io
from collections.abc import Mapping
from typing import Any

# Pale where all is well; the steps of viridis between, even with and without seeing red or green; and for failures of
# another kind what viridis does not hold: Okabe and Ito's vermilion, and black.
KEPT = "#DDE5EA"
NOT_A_ROTATION = "#D55E00"
NOT_FINITE = "#000000"


def new_figure(size: tuple[float, float]) -> Any:
    """An empty figure of a size in inches, 150 pixels each."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # Not pyplot: it would pick a display and keep the figure for the whole process.
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def as_png(figure: Any) -> bytes:
    """The picture as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def patches(colors: Mapping[str, Any]) -> list[Any]:
    """Coloured patches for a legend, by their words."""
    from matplotlib.patches import Patch

    return [Patch(facecolor=color, edgecolor="0.5", linewidth=0.4, label=word) for word, color in colors.items()]

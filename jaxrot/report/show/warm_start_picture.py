"""Error against time of warm starts: a line for every step, with a point for every number of iterations."""

from collections.abc import Sequence

import numpy as np

from jaxrot.report.measure.warm_starts import ANGLE_DEGREES, COLD_START, PAPER, WarmStart
from jaxrot.report.show.figures import as_png, new_figure, prepare_error_axes

# The colours of Okabe and Ito. The markers differ in grey too.
_STYLES = {
    "torque": ("#D55E00", "^"),
    "torque_exact_angle": ("#E69F00", "v"),
    "newton": ("#0072B2", "o"),
    "cayley": ("#56B4E9", "D"),
    "quest": ("#009E73", "P"),
    PAPER: ("#8A4B73", "s"),
}


def draw_warm_starts(entries: Sequence[WarmStart], input_name: str) -> bytes:
    """The picture as PNG, one panel for each dtype."""
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    dtypes = list(dict.fromkeys(entry.dtype for entry in entries))
    title = f"Warm starts, {ANGLE_DEGREES:.0f}° off: error after k iterations against time ({input_name})"
    figure = new_figure((1.5 + 5.7 * len(dtypes), 5.4), title)
    handles = {}
    for axes, dtype in zip(figure.subplots(1, len(dtypes), squeeze=False)[0], dtypes, strict=True):
        eps = float(np.finfo(dtype).eps)
        of_dtype = [entry for entry in entries if entry.dtype == dtype]
        prepare_error_axes(axes, dtype, of_dtype[0].batch)
        for step, (color, marker) in _STYLES.items():
            line = sorted((entry for entry in of_dtype if entry.step == step), key=lambda entry: entry.iterations)
            if not line:
                continue
            times = [entry.time.median for entry in line]
            errors = [max(entry.error.percentile_99, eps / 10) for entry in line]
            (handles[step],) = axes.plot(times, errors, color=color, marker=marker, markersize=6, linewidth=1.5)
            for k, entry in enumerate(line):
                # After convergence the points coincide, and their numbers would overlap.
                if k == 0 or errors[k] < 0.8 * errors[k - 1]:
                    axes.annotate(
                        str(entry.iterations), (times[k], errors[k]), fontsize=8, color=color,
                        xytext=(5, -11 if step == PAPER else 4), textcoords="offset points",
                    )  # fmt: skip
        for entry in (entry for entry in of_dtype if entry.step == COLD_START):
            axes.axvline(entry.time.median, color="0.4", linewidth=1, linestyle="--")
            error = max(entry.error.percentile_99, eps / 10)
            (handles[COLD_START],) = axes.plot(entry.time.median, error, "k*", markersize=11)
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("time per matrix, all iterations [ns], median")
        axes.set_ylabel("forward error ‖R - R*‖$_F$, 99th percentile")
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return as_png(figure)

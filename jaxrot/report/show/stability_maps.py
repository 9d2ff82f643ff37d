"""Maps of the error over the bound of the contract: over the singular values and over the scale."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxrot.report.measure.stability import Cells, ConditionMap, Kind, ScaleMap, summarise_conditions
from jaxrot.report.show.figures import KEPT, NOT_A_ROTATION, NOT_FINITE, as_png, new_figure, patches

CONDITIONS_CAPTION = """\
Each map is the region |s3| ≤ s2 ≤ s1 = 1 of the signed singular values. The upper corner holds the rotations, the left
corner the matrices of rank 1, the line s3 = 0 those of rank 2. Below this line det A < 0. On the lower edge s3 = -s2 R
is not unique, and the forward error is not judged. *Error* is the largest error over its bound in the contract; the
colour is pale if the contract is kept. *Not a rotation* means a reflection, or ‖RᵀR - 1‖_F > 1e-3. A point shows the
worst of its matrices. Most are U diag(s) Vᵀ with random rotations U and V. In the others U and V are symmetries of the
cube, so that the matrices are exactly singular, or have exactly equal singular values."""

SCALES_CAPTION = """\
The same matrices with κ < 10 at every scale, from the smallest to the largest power of ten of the dtype, in the same
colours. Left of a dotted line R depends on subnormal entries, and must only be a rotation. Dashed lines mark 1e±38, the
range of float32. A row that alternates between two colours has its error near their border at every scale."""

# Upper ends of the levels of the error over its bound, in powers of 10. The first is the contract. The levels are fine
# for the errors of approximations, 1e-3 to 1.
_LEVELS = {"float32": (0, 1, 2, 3, 4, 5, 6), "float64": (0, 1, 3, 6, 12, 13, 14)}
# The darkest end of viridis is left out: it looks like black.
_LIGHTEST, _DARKEST = 1.0, 0.12
_LINE = {"color": "0.25", "linewidth": 0.6}
_COLUMNS = 6
_FLOAT32_ENDS = 38  # its largest and smallest normal numbers, as powers of 10
# An explanation of the axes takes the first place of a picture, and the legend the last two.
_PLACES_AROUND = 3


def sorted_methods(found: Sequence[ConditionMap]) -> list[str]:
    """The methods by the share of cells with the contract kept, then by the share of failures."""

    def badness(name: str) -> tuple[float, float]:
        shares = [summarise_conditions(part)[name] for part in found]
        failing = sum(share["not_finite"] + share["not_a_rotation"] for share in shares)
        return -sum(share["kept"] for share in shares), failing

    return sorted(found[0].methods, key=badness)


def color_cells(cells: Cells, dtype: str) -> np.ndarray:
    """The RGB colour of each cell, shape (cells, 3), from 0 to 1."""
    from matplotlib.colors import to_rgb

    palette = np.array([to_rgb(color) for color in _palette()])
    level = np.searchsorted(10.0 ** np.array(_LEVELS[dtype]), cells.excess)
    level[cells.kind == Kind.NOT_A_ROTATION] = len(palette) - 2
    level[cells.kind == Kind.NOT_FINITE] = len(palette) - 1
    return palette[level]


def draw_condition_maps(found: ConditionMap, names: Sequence[str]) -> bytes:
    """A map of each of the methods over s2/s1 and s3/s1, as PNG."""
    keeping = sum(share["kept"] == 1 for name, share in summarise_conditions(found).items() if name in names)
    title = (
        f"Error over the singular values, {found.dtype}: {keeping} of {len(names)} methods keep the contract on"
        f" the whole map\nWorst of {found.matrices_a_cell} matrices with s1 = 1 at each of {len(found.s2):,} points;"
        " the number is the share of them where the contract is kept"
    )
    figure = new_figure((10, 2.35 * _rows(len(names)) + 0.7), title)
    all_axes = figure.subplots(_rows(len(names)), _COLUMNS, squeeze=False)
    key, *places = all_axes.ravel()
    _explain_region(key)
    for number, name in enumerate(names):
        _draw_region(places[number], found, name)
        if (number + 1) % _COLUMNS:
            places[number].tick_params(labelleft=False)
    for axes in places[len(names) :]:
        axes.axis("off")
    legend = _add_legend(places[-2], found.dtype, loc="upper left", bbox_to_anchor=(-0.1, 1.0))
    # The legend takes two places, but the layout knows only the first.
    legend.set_in_layout(False)
    return as_png(figure)


def draw_scale_map(found: Sequence[ScaleMap], names: Sequence[str]) -> bytes:
    """The methods over the scale, as PNG: a column of panels for each dtype, a panel for each sign of det A."""
    row, legend = 0.4 + 0.15 * len(names), 1.2
    title = (
        "Error over the scale of well-conditioned matrices\n"
        f"Worst of {found[0].matrices_a_cell}, the same at each scale; a row of one colour does not depend on it"
    )
    figure = new_figure((2.2 + 4 * len(found), 0.6 + 2 * row + legend), title)
    all_axes = figure.subplots(3, len(found), squeeze=False, height_ratios=(row, row, legend))
    for number, (part, (upright, inverted, below)) in enumerate(zip(found, all_axes.T, strict=True)):
        _draw_scales(upright, part, names, is_inverted=False)
        _draw_scales(inverted, part, names, is_inverted=True)
        upright.tick_params(labelbottom=False, labelleft=number == 0)
        inverted.tick_params(labelleft=number == 0)
        inverted.set_xlabel("log$_{10}$ s1", fontsize=8.5)
        below.axis("off")
        _add_legend(below, part.dtype, loc="upper center", ncols=2)
    return as_png(figure)


def _palette() -> list[Any]:
    from matplotlib import colormaps

    outside = colormaps["viridis"](np.linspace(_LIGHTEST, _DARKEST, 7)).tolist()
    return [KEPT, *outside, NOT_A_ROTATION, NOT_FINITE]


def _rows(methods: int) -> int:
    return -(-(methods + _PLACES_AROUND) // _COLUMNS)


def _draw_region(axes: Any, found: ConditionMap, name: str) -> None:
    steps, cells = found.steps, found.methods[name]
    image = np.ones((2 * steps + 1, steps + 1, 3))
    row, column = np.rint((found.s3 + 1) * steps).astype(int), np.rint(found.s2 * steps).astype(int)
    image[row, column] = color_cells(cells, found.dtype)
    half = 0.5 / steps
    extent = (-half, 1 + half, -1 - half, 1 + half)
    axes.imshow(image, origin="lower", aspect="auto", interpolation="nearest", extent=extent)
    _outline(axes, margin=half)
    axes.set_title(name, fontsize=8.5)
    kept = np.mean(cells.kind == Kind.KEPT)
    axes.text(0.05, 0.97, _percent(kept), transform=axes.transAxes, ha="left", va="top", fontsize=8)


def _percent(share: float) -> str:
    """Whole percent; 0 and 100 only if the share is exactly 0 or 1."""
    if 0 < share < 0.01:
        return "< 1 %"
    return f"{'> 99' if 0.99 < share < 1 else format(100 * share, '.0f')} %"


def _outline(axes: Any, margin: float) -> None:
    """Draws the axes, and the edge of the region outside of the outermost points."""
    right, left = 1 + margin, -2 * margin
    axes.plot((right, left, right, right), (right - left, 0, left - right, right - left), **_LINE)
    axes.set(xlim=(-0.03, 1.03), ylim=(-1.05, 1.05), xticks=(0, 0.5, 1), yticks=(-1, -0.5, 0, 0.5, 1))
    axes.tick_params(labelsize=7)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _explain_region(axes: Any) -> None:
    """Draws an explanation of the axes, lines and corners instead of the first map."""
    _outline(axes, margin=0)
    axes.plot((0, 1), (0, 0), color="0.4", linewidth=0.7, linestyle=":")
    axes.plot((0, 1), (0, -1), color="0.25", linewidth=2)
    axes.set_xlabel("s2/s1", fontsize=8, labelpad=1)
    axes.set_ylabel("s3/s1", fontsize=8, labelpad=-2)
    at_right = {"rotation": (0.86, 1), "det A > 0": (0.96, 0.4), "rank 2": (0.96, 0.08), "det A < 0": (0.96, -0.32)}
    for word, (x, y) in (at_right | {"reflection": (0.86, -1.0)}).items():
        axes.text(x, y, word, ha="right", va="center", fontsize=7)
    axes.text(0.0, 0.42, "rank 1", ha="left", va="center", fontsize=7)
    axes.text(0.34, -0.62, "R not unique", ha="center", va="center", rotation=-54, fontsize=7)
    axes.annotate("", (0, 0.02), (0.06, 0.36), arrowprops={"arrowstyle": "->", **_LINE})
    axes.set_title("the region", fontsize=8.5, style="italic")


def _draw_scales(axes: Any, found: ScaleMap, names: Sequence[str], is_inverted: bool) -> None:
    part = found.is_inverted == is_inverted
    exponents = found.exponents[part]
    image = np.stack([color_cells(found.methods[name], found.dtype)[part] for name in names])
    half = (exponents[1] - exponents[0]) / 2
    left, right = exponents[0] - half, exponents[-1] + half
    axes.imshow(image, aspect="auto", interpolation="nearest", extent=(left, right, len(names) - 0.5, -0.5))
    axes.hlines(np.arange(len(names) - 1) + 0.5, left, right, color="white", linewidth=1)
    axes.set_yticks(range(len(names)), names, fontsize=7.5)
    axes.tick_params(axis="x", labelsize=7.5)
    axes.set_title(f"{found.dtype}, det A {'<' if is_inverted else '>'} 0", fontsize=9)
    if right > 2 * _FLOAT32_ENDS:
        axes.set_xticks([-300, -200, -100, -_FLOAT32_ENDS, 0, _FLOAT32_ENDS, 100, 200, 300])
        for end in (-_FLOAT32_ENDS, _FLOAT32_ENDS):
            axes.axvline(end, color="0.2", linewidth=0.7, linestyle="--")
    subnormal = exponents[~found.is_scored[part]]
    if subnormal.size:
        axes.axvline(subnormal.max() + half, color="0.2", linewidth=0.7, linestyle=":")


def _add_legend(axes: Any, dtype: str, **place: Any) -> Any:
    powers = _LEVELS[dtype]
    ends = [f"10$^{{{power}}}$" if power not in (0, 1) else str(10**power) for power in powers]
    words = [f"to {ends[0]}: the contract is kept", *(f"to {end}" for end in ends[1:])]
    words += [f"above {ends[-1]}", "not a rotation", "NaN or infinity"]
    return axes.legend(
        handles=patches(dict(zip(words, _palette(), strict=True))), title="error, times the contract's bound",
        title_fontsize=8, fontsize=7.5, frameon=False, borderaxespad=0, alignment="left", **place,
    )  # fmt: skip

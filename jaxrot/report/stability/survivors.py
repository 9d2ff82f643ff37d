"""Stiff and extreme cases: which methods survive them, as a table and as a picture."""

from collections.abc import Collection, Mapping, Sequence
from enum import IntEnum
from typing import Any

import numpy as np

import jaxrot
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.evaluation.formatting import listed
from jaxrot.families import FAMILIES
from jaxrot.report.drawing.figures import KEPT, NOT_A_ROTATION, NOT_FINITE, as_png, new_figure, patches
from jaxrot.report.stability.cells import ROTATION_TOLERANCE
from jaxrot.report.writing.tables import Table

# What a usable rotation may lose of the trace, as a multiple of s1. It grows with the square of the angle between R and
# R*: near a rotation it allows for six degrees.
TRACE_TOLERANCE = 1e-2

SURVIVORS_CAPTION = """\
A method **keeps the contract** on a case if it does on every one of its matrices. It is **usable** if it does not, but
each R is a rotation, ‖RᵀR - 1‖_F ≤ 1e-3 and det R > 0, and not far from the best, tr(R\\*ᵀA) - tr(RᵀA) ≤ 0.01 s1;
the dtype does not matter here. Near a rotation that is an angle of 6° at most; for a needle it leaves the turn about
the long axis open. The others return a rotation that is far off, no rotation or NaN for at least one matrix. Where
subnormal entries carry R, a rotation is all that is asked. Three numbers in parentheses are the signed singular
values."""

CASES = {
    "ordinary": ("gaussian",),
    "near a rotation": (
        "rotation", "identity", "scaled_rotation", "drifted_rotation", "noisy_rotation_0.1", "noisy_rotation_0.3",
        "noisy_rotation_0.5",
    ),
    "half a turn": ("half_turn", "swap", "near_half_turn"),
    "equal singular values": ("equal_large", "equal_small", "signed_permutation", "small_integers"),
    "singular": ("zero", "rank_one", "single_entry", "rank_two", "planar", "planar_motion", "vanishing_rank"),
    "stiff": ("log_uniform", "needle", "stretch_1e7", "ill_conditioned"),
    "inverted": (
        "minus_rotation_1e-1", "minus_rotation_1e-2", "minus_rotation_1e-4", "minus_rotation_graded", "sparse_inverted",
    ),
    "R not unique, or nearly": (
        "minus_identity", "minus_rotation", "reflection", "exact_tie", "near_tie", "nearly_not_unique", "vanishing_gap",
    ),
    "scale": ("scale_small", "scale_tiny", "subnormal", "scale_large", "scale_huge", "scale_mixed"),
}  # fmt: skip


class Grade(IntEnum):
    """How a method did on a case, from good to bad; `SURVIVORS_CAPTION` has the first two in words.

    WRONG: rotations all, but one of them far from the best. The last two have the words of `stability.Kind`.
    """

    KEPT = 0
    USABLE = 1
    WRONG = 2
    NOT_A_ROTATION = 3
    NOT_FINITE = 4


_WORDS = {
    Grade.KEPT: ("keeps the contract", KEPT),
    Grade.USABLE: ("usable", "#FDE725"),
    Grade.WRONG: ("a rotation, but far off", "#443983"),
    Grade.NOT_A_ROTATION: ("not a rotation", NOT_A_ROTATION),
    Grade.NOT_FINITE: ("NaN or infinity", NOT_FINITE),
}


def grade(entry: Accuracy) -> Grade:
    """The grade of one method on one case; its worst matrix counts."""
    eps = float(np.finfo(entry.dtype).eps)
    orthogonality, lost_trace = entry.orthogonality_max or 0.0, entry.lost_trace_max or 0.0
    if entry.outside == 0:
        return Grade.KEPT
    if np.isinf(orthogonality):
        return Grade.NOT_FINITE
    if orthogonality * eps > ROTATION_TOLERANCE:
        return Grade.NOT_A_ROTATION
    return Grade.WRONG if lost_trace * eps > TRACE_TOLERANCE else Grade.USABLE


def survivors_table(accuracy: Sequence[Accuracy]) -> Table:
    """A row a family, grouped by what makes it hard, and by dtype who keeps the contract and who else is usable.

    Args:
        accuracy: Any entries; those of the group "families" are used, of one dtype or of both.
    """
    grades, dtypes, names = _grades(accuracy)
    counts = {entry.set_name: entry.matrices for entry in accuracy if entry.group == "families"}
    always = [name for name in names if _survives_all(grades, name)]
    others = [name for name in names if name not in always]
    header = ["case", "family", "what it is", "matrices"]
    header += [f"{what}, {dtype}" for dtype in dtypes for what in ("keep the contract", "usable")]
    rows = []
    for case, families in _cases(counts).items():
        for family in families:
            row = [case if family == families[0] else "", f"`{family}`"]
            row += [FAMILIES[family].description, f"{counts[family]:,}"]
            for dtype in dtypes:
                keeping, usable = (
                    [name for name in others if grades[family, name, dtype] == wanted]
                    for wanted in (Grade.KEPT, Grade.USABLE)
                )
                row += [_described(keeping, others), _described(usable, others)]
            rows.append(row)
    verb = "keeps" if len(always) == 1 else "keep"
    besides = f"; {listed(always)} {verb} the contract in every case, and these besides" if always else ""
    return Table(f"Who survives what{besides}", header, rows)


def draw_survival(accuracy: Sequence[Accuracy], names: Sequence[str]) -> bytes:
    """The grade of every method on every family, as PNG: a panel a dtype.

    Args:
        accuracy: As for `survivors_table`.
        names: The methods from left to right.
    """
    grades, dtypes, _ = _grades(accuracy)
    cases = _cases({family for family, _, _ in grades})
    # A row of its own for the name of each group: None in the place of a family.
    lines = [line for case, families in cases.items() for line in ((case, None), *((case, name) for name in families))]
    figure = new_figure((max(7.0, 2.2 + 0.2 * len(names) * len(dtypes)), 2.2 + 0.16 * len(lines)))
    all_axes = figure.subplots(1, len(dtypes), sharey=True, squeeze=False)[0]
    always = [name for name in names if _survives_all(grades, name)]
    figure.suptitle(
        f"Stiff and extreme cases: {len(always)} of {len(names)} methods survive all of them within the contract",
        fontsize=11,
    )
    for axes, dtype in zip(all_axes, dtypes, strict=True):
        image = np.stack([_colors([grades.get((family or "", name, dtype)) for name in names]) for _, family in lines])
        axes.imshow(image, aspect="auto", interpolation="nearest")
        _draw_grid(axes, lines, len(names))
        axes.set_xticks(range(len(names)), names, rotation=90, fontsize=7.5)
        axes.xaxis.tick_top()
        axes.tick_params(length=0)
        axes.set_title(dtype, fontsize=9)
    all_axes[0].set_yticks(range(len(lines)), [family or case for case, family in lines], fontsize=7.5)
    for label, (_, family) in zip(all_axes[0].get_yticklabels(), lines, strict=True):
        label.set_fontweight("normal" if family else "bold")
    figure.legend(
        handles=patches(dict(_WORDS.values())), loc="outside lower center", ncols=len(_WORDS), fontsize=8, frameon=False
    )
    return as_png(figure)


def _grades(accuracy: Sequence[Accuracy]) -> tuple[dict[tuple[str, str, str], Grade], list[str], list[str]]:
    """The grades by family, method and dtype; the dtypes; the methods in the order of `jaxrot.METHODS`."""
    entries = [entry for entry in accuracy if entry.group == "families"]
    grades = {(entry.set_name, entry.method, entry.dtype): grade(entry) for entry in entries}
    measured = {entry.method for entry in entries}
    dtypes = list(dict.fromkeys(entry.dtype for entry in entries))
    return grades, dtypes, [name for name in jaxrot.METHODS if name in measured]


def _survives_all(grades: Mapping[tuple[str, str, str], Grade], name: str) -> bool:
    return all(found == Grade.KEPT for (_, method, _), found in grades.items() if method == name)


def _cases(measured: Collection[str]) -> dict[str, list[str]]:
    """The groups with what was measured of them."""
    found = {case: [family for family in families if family in measured] for case, families in CASES.items()}
    return {case: families for case, families in found.items() if families}


def _described(some: Sequence[str], names: Sequence[str]) -> str:
    """The names of some of all methods, or of the others where these are few."""
    others = [name for name in names if name not in some]
    if not others:
        return "all"
    if 2 * len(others) < len(some):
        return f"all but {', '.join(others)}"
    return ", ".join(some) or "none"


def _colors(grades: Sequence[Grade | None]) -> np.ndarray:
    from matplotlib.colors import to_rgb

    return np.array([to_rgb("white" if grade is None else _WORDS[grade][1]) for grade in grades])


def _draw_grid(axes: Any, lines: Sequence[tuple[str, str | None]], columns: int) -> None:
    """White lines between the cells, so that one can be followed to its names."""
    axes.hlines(np.arange(len(lines) - 1) + 0.5, -0.5, columns - 0.5, color="white", linewidth=0.8)
    axes.vlines(np.arange(columns - 1) + 0.5, -0.5, len(lines) - 0.5, color="white", linewidth=0.8)
    for side in axes.spines.values():
        side.set_visible(False)

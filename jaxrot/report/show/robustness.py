"""Every method on stiff and extreme cases, as a table and as a picture."""

import itertools
from collections.abc import Collection, Mapping, Sequence
from enum import IntEnum

import numpy as np

import jaxrot
from jaxrot.console.tables import Table
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.families import FAMILIES
from jaxrot.report.measure.stability import ROTATION_TOLERANCE
from jaxrot.report.show.figures import KEPT, NOT_A_ROTATION, NOT_FINITE, as_png, new_figure, patches

# Largest lost trace of a usable rotation, as a multiple of s1. It grows with the square of the angle between R and R*:
# if A is near a rotation, it allows six degrees.
TRACE_TOLERANCE = 1e-2

ROBUSTNESS_CAPTION = """\
A method **keeps the contract** on a family if it does so for each of its matrices. Otherwise it is **usable** if each R
is a rotation, ‖RᵀR - 1‖_F ≤ 1e-3 and det R > 0, and if it loses little trace, tr(R\\*ᵀA) - tr(RᵀA) ≤ 0.01 s1. These
bounds do not depend on the dtype. They allow an angle of 6° if A is near a rotation, and any turn about the long axis
of a needle. The other methods return a rotation far off, no rotation, or NaN for some matrix. If R depends on subnormal
entries, it must only be a rotation. Three numbers in parentheses are the signed singular values."""

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
    """The result of a method for the worst matrix of a family, from good to bad.

    `ROBUSTNESS_CAPTION` explains KEPT and USABLE. WRONG is a rotation that is not usable. The last two are those of
    `stability.Kind`.
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
    """The grade of one method on one family."""
    eps = float(np.finfo(entry.dtype).eps)
    orthogonality, lost_trace = entry.orthogonality_max or 0.0, entry.lost_trace_max or 0.0
    if entry.outside == 0:
        return Grade.KEPT
    if np.isinf(orthogonality):
        return Grade.NOT_FINITE
    if orthogonality * eps > ROTATION_TOLERANCE:
        return Grade.NOT_A_ROTATION
    return Grade.WRONG if lost_trace * eps > TRACE_TOLERANCE else Grade.USABLE


def robustness_table(accuracy: Sequence[Accuracy]) -> Table:
    """The methods that keep the contract and those that are usable, for each family and dtype."""
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
            for dtype, wanted in itertools.product(dtypes, (Grade.KEPT, Grade.USABLE)):
                row.append(_described([name for name in others if grades[family, name, dtype] == wanted], others))
            rows.append(row)
    keeping_all = f", in addition to those that keep the contract on all: {', '.join(always)}" if always else ""
    return Table(f"Methods by family{keeping_all}", header, rows)


def draw_robustness(accuracy: Sequence[Accuracy], names: Sequence[str]) -> bytes:
    """The grade of the methods on every family, as PNG: a panel for each dtype."""
    grades, dtypes, _ = _grades(accuracy)
    cases = _cases({family for family, _, _ in grades})
    # A row with the name of each group has None instead of a family.
    lines = [line for case, families in cases.items() for line in ((case, None), *((case, name) for name in families))]
    always = sum(_survives_all(grades, name) for name in names)
    title = f"Stiff and extreme cases: {always} of {len(names)} methods keep the contract on all"
    figure = new_figure((max(7.0, 2.2 + 0.2 * len(names) * len(dtypes)), 2.2 + 0.16 * len(lines)), title)
    all_axes = figure.subplots(1, len(dtypes), sharey=True, squeeze=False)[0]
    for axes, dtype in zip(all_axes, dtypes, strict=True):
        colors = [[_color(grades.get((family or "", name, dtype))) for name in names] for _, family in lines]
        axes.imshow(np.array(colors), aspect="auto", interpolation="nearest")
        # White lines between the cells, so that the eye can follow a row or column.
        axes.hlines(np.arange(len(lines) - 1) + 0.5, -0.5, len(names) - 0.5, color="white", linewidth=0.8)
        axes.vlines(np.arange(len(names) - 1) + 0.5, -0.5, len(lines) - 0.5, color="white", linewidth=0.8)
        for side in axes.spines.values():
            side.set_visible(False)
        axes.set_xticks(range(len(names)), names, rotation=90, fontsize=7.5)
        axes.xaxis.tick_top()
        axes.tick_params(length=0)
        axes.set_title(dtype, fontsize=9)
    all_axes[0].set_yticks(range(len(lines)), [family or case for case, family in lines], fontsize=7.5)
    for label, (_, family) in zip(all_axes[0].get_yticklabels(), lines, strict=True):
        label.set_fontweight("normal" if family else "bold")
    legend = patches(dict(_WORDS.values()))
    figure.legend(handles=legend, loc="outside lower center", ncols=len(legend), fontsize=8, frameon=False)
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
    """The groups, with the measured families of each."""
    found = {case: [family for family in families if family in measured] for case, families in CASES.items()}
    return {case: families for case, families in found.items() if families}


def _described(some: Sequence[str], names: Sequence[str]) -> str:
    """The names of some of the methods, or those of the others if these are few."""
    others = [name for name in names if name not in some]
    if not others:
        return "all"
    if 2 * len(others) < len(some):
        return f"all but {', '.join(others)}"
    return ", ".join(some) or "none"


def _color(grade: Grade | None) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb("white" if grade is None else _WORDS[grade][1])

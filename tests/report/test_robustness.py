"""Who survives: the grades, their words, and the picture."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import jaxrot
from jaxrot.evaluation.accuracy import Accuracy
from jaxrot.families import FAMILIES
from jaxrot.report.show import figures
from jaxrot.report.show.robustness import CASES, Grade, draw_robustness, grade, robustness_table

NAMES = list(jaxrot.METHODS)


def accuracy(method="singular_pair", family="zero", *, outside=0, orthogonality=1.0, lost_trace=1.0, dtype="float32"):
    """An entry; orthogonality and lost trace in units of eps."""
    errors = [1e-7] * 5
    return Accuracy._make(
        [method, dtype, "families", family, 200, 0, 200, *errors, orthogonality, lost_trace, 1.0, outside, 200, 0]
    )


def broken(*names, **errors):
    """All methods on one case, which some do not survive."""
    return [accuracy(name, outside=3, **errors) if name in names else accuracy(name) for name in NAMES]


def cells(entries, row=0):
    table = robustness_table(entries)
    return dict(zip(table.header, table.rows[row], strict=True))


def test_every_family_is_in_one_case():
    families = [family for case in CASES.values() for family in case]
    assert sorted(families) == sorted(FAMILIES)


@pytest.mark.parametrize(
    ("orthogonality", "lost_trace", "expected"),
    [
        (0.9e-3, 0.9e-2, Grade.USABLE),
        (0.9e-3, None, Grade.USABLE),
        (0.9e-3, 1.1e-2, Grade.WRONG),
        (1.1e-3, 0.0, Grade.NOT_A_ROTATION),
        (2.0, 4.0, Grade.NOT_A_ROTATION),
        (np.inf, np.inf, Grade.NOT_FINITE),
    ],
)
def test_grades_outside_the_contract(orthogonality, lost_trace, expected, dtype):
    eps = float(np.finfo(dtype).eps)
    trace = None if lost_trace is None else lost_trace / eps
    assert grade(accuracy(outside=0, lost_trace=None)) == Grade.KEPT
    assert grade(accuracy(outside=1, orthogonality=orthogonality / eps, lost_trace=trace, dtype=dtype)) == expected


def test_who_survives_everything_is_named_once():
    table = robustness_table(broken(*NAMES[2:]))
    assert table.title.endswith(f"keep the contract on all: {NAMES[0]}, {NAMES[1]}")
    assert table.rows[0][4:] == ["none", "all"]


def test_few_survivors_are_named_and_where_nearly_all_survive_the_others():
    entries = [accuracy(name, outside=1, lost_trace=1e6) for name in NAMES if name not in ("svd", "foam", "torque")]
    entries += [accuracy("torque"), accuracy("svd"), accuracy("foam", outside=2)]
    entries += [accuracy(name, "rank_one", outside=1) for name in NAMES]
    zero, rank_one = cells(entries), cells(entries, 1)
    assert zero["keep the contract, float32"] == "svd, torque"
    assert zero["usable, float32"] == "foam"
    assert rank_one["keep the contract, float32"] == "none"
    assert rank_one["usable, float32"] == "all"
    entries = broken("foam", "svd", lost_trace=1e6) + [
        accuracy(name, "rank_one", outside=1, lost_trace=1e6) for name in NAMES
    ]  # fmt: skip
    singular = cells(entries)
    # In the order of the registry.
    assert singular["keep the contract, float32"] == "all but svd, foam"
    assert singular["usable, float32"] == "none"
    assert "contract on all" not in robustness_table(entries).title


def test_dtypes_stand_side_by_side_cases_follow_their_order_and_words_do_not_break_a_markdown_table():
    entries = [
        accuracy(name, family, dtype=dtype)
        for dtype in ("float32", "float64")
        for family in ("subnormal", "zero", "rank_one")
        for name in NAMES
    ]
    table = robustness_table(entries)
    assert [row[:2] for row in table.rows] == [["singular", "`zero`"], ["", "`rank_one`"], ["scale", "`subnormal`"]]
    columns = ("keep the contract", "usable")
    assert table.header[4:] == [f"{what}, {dtype}" for dtype in ("float32", "float64") for what in columns]
    entries = [accuracy(name, family) for family in FAMILIES for name in NAMES]
    assert not [word for row in robustness_table(entries).rows for word in row if "|" in word or "\n" in word]


def test_the_picture_holds_the_failure_that_is_there():
    def share_of(color, picture):
        return np.mean(np.abs(picture - to_rgb(color)).max(-1) < 0.01)

    def picture(**errors):
        entries = [
            accuracy(name, family, **errors if (name, family) == ("svd", "zero") else {})
            for family in FAMILIES
            for name in NAMES
        ]
        return imread(io.BytesIO(draw_robustness(entries, NAMES)))[..., :3]

    fine, failed = picture(), picture(outside=1, orthogonality=1e7)
    assert fine.shape == failed.shape
    gained = share_of(figures.NOT_A_ROTATION, failed) - share_of(figures.NOT_A_ROTATION, fine)
    lost = share_of(figures.KEPT, fine) - share_of(figures.KEPT, failed)
    assert gained > 0
    # One cell of 44 families and 21 methods.
    np.testing.assert_allclose(gained, lost, rtol=0.2)
    np.testing.assert_allclose(gained, share_of(figures.KEPT, fine) / (44 * 21), rtol=0.3)

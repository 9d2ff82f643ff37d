"""What is measured is seen: the colours of the cells, in their places."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from jaxrot.report.measure.stability import Cells, ConditionMap, Kind, ScaleMap
from jaxrot.report.show import figures, stability_maps

NOT_A_ROTATION, NOT_FINITE, KEPT = (
    to_rgb(color) for color in (figures.NOT_A_ROTATION, figures.NOT_FINITE, figures.KEPT)
)
CELLS = 9


def cells(excess=0.5, kind=Kind.KEPT, at=(), count=CELLS):
    """Cells within the contract, but for some."""
    found = Cells(np.full(count, 0.5), np.full(count, 0.5), np.zeros(count, np.int8))
    for number in at:
        found.excess[number], found.kind[number] = excess, kind
    return found


def condition_map(methods, dtype="float32"):
    s2, s3 = np.array([(i / 2, j / 2) for i in range(3) for j in range(-i, i + 1)]).T
    return ConditionMap(dtype, 2, s2, s3, 16, methods)


def scale_map(methods, dtype="float32"):
    exponents = np.arange(-2, 3)
    return ScaleMap(
        dtype, np.tile(exponents, 2), np.repeat((False, True), 5), np.tile(exponents > -2, 2), 16, methods
    )  # fmt: skip


def pixels(png):
    return imread(io.BytesIO(png))[..., :3]


def where_they_differ(one, other):
    """The box of the pixels in which two pictures differ: top, bottom, left and right as shares of the picture."""
    rows, columns = np.nonzero(np.abs(one - other).max(-1) > 0.02)
    height, width = one.shape[:2]
    return rows.min() / height, rows.max() / height, columns.min() / width, columns.max() / width


def test_colors_follow_the_excess_and_the_failures_have_their_own(dtype):
    excess = np.array([0, 1, 1.01, 1e2, 1e6, 1e20, 1e20, np.inf])
    kind = np.array([0, 0, 1, 1, 1, 1, Kind.NOT_A_ROTATION, Kind.NOT_FINITE], np.int8)
    colors = stability_maps.color_cells(Cells(excess, excess, kind), dtype)
    np.testing.assert_allclose(colors[:2], [KEPT, KEPT])
    np.testing.assert_allclose(colors[6:], [NOT_A_ROTATION, NOT_FINITE])
    luminance = colors @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance[1:6]) < 0).all()
    assert len(np.unique(colors.round(3), axis=0)) == 7


def test_a_failure_is_drawn_in_its_cell_of_its_map():
    # s2 = 1 and s3 = -1 is the lower right corner of a map; three of them in the first row, behind the explanation.
    def picture(kind):
        planted = cells(1e3, kind, at=[4])
        return pixels(
            stability_maps.draw_condition_maps(condition_map({"a": cells(), "b": planted, "c": cells()}), ["a", "b"])
        )

    outside, reflected = picture(Kind.OUTSIDE), picture(Kind.NOT_A_ROTATION)
    top, bottom, left, right = where_they_differ(outside, reflected)
    height, width = outside.shape[:2]
    middle = reflected[int((top + bottom) / 2 * height), int((left + right) / 2 * width)]
    np.testing.assert_allclose(middle, NOT_A_ROTATION, atol=0.01)
    assert top > 0.5
    # The third of six places.
    assert left > 2 / 6
    assert right < 3.5 / 6
    assert right - left < 0.1


def test_every_method_has_a_map_and_the_legend_a_place():
    names = [f"method_{number}" for number in range(10)]
    few = pixels(stability_maps.draw_condition_maps(condition_map({"method_0": cells()}), ["method_0"]))
    many = pixels(stability_maps.draw_condition_maps(condition_map({name: cells() for name in names}), names))
    assert many.shape[0] > 2 * few.shape[0]
    background = np.all(np.abs(many - KEPT) < 0.01, axis=-1).sum()
    assert background > 8 * np.all(np.abs(few - KEPT) < 0.01, axis=-1).sum()


def test_a_failure_is_drawn_at_its_scale_and_sign():
    def picture(kind):
        # The last cell: inverted, largest scale. The second method is the lower row of a panel.
        planted = {"a": cells(count=10), "b": cells(1e3, kind, at=[9], count=10)}
        return pixels(stability_maps.draw_scale_map([scale_map(planted), scale_map(planted, "float64")], ["a", "b"]))

    outside, failed = picture(Kind.OUTSIDE), picture(Kind.NOT_FINITE)
    differing = np.abs(outside - failed).max(-1) > 0.02
    height, width = differing.shape
    rows, columns = np.nonzero(differing)
    assert rows.min() > height / 3
    # One box a panel, each a fifth of it wide.
    assert not differing[:, : width // 3].any()
    assert differing.any(0).sum() < 0.25 * width
    np.testing.assert_allclose(failed[(rows.min() + rows.max()) // 2, columns.max() - 3], NOT_FINITE, atol=0.01)


def test_methods_are_sorted_by_what_they_keep_then_by_their_failures():
    methods = {
        "nan": cells(np.inf, Kind.NOT_FINITE, at=[0, 1]),
        "wrong": cells(1e3, Kind.OUTSIDE, at=[0, 1]),
        "all": cells(),
        "nearly": cells(2, Kind.OUTSIDE, at=[3]),
        "all too": cells(),
    }
    assert stability_maps.sorted_methods([condition_map(methods)]) == ["all", "all too", "nearly", "wrong", "nan"]


@pytest.mark.parametrize(
    ("share", "words"), [(0, "0 %"), (1e-4, "< 1 %"), (0.5, "50 %"), (0.9999, "> 99 %"), (1, "100 %")]
)
def test_all_and_nothing_are_said_only_of_all_and_nothing(share, words):
    assert stability_maps._percent(share) == words

import io
import itertools

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

from jaxrot.report.measure.front import EXACT, PEER, Point, pareto_front
from jaxrot.report.show.labels import place_labels
from jaxrot.report.show.pareto import Panel, draw_pareto


def point(name, time, error):
    return Point(name, time, error, error / 3, error * 30, EXACT)


def names(points):
    return [entry.name for entry in points]


@pytest.mark.parametrize(
    ("points", "front"),
    [
        ([("slow", 100, 1e-7), ("beaten", 90, 1e-5), ("middle", 50, 1e-6), ("fast", 10, 1e-2)], "fast middle slow"),
        ([("slower", 20, 1e-6), ("faster", 10, 1e-6)], "faster"),
        ([("worse", 10, 1e-3), ("better", 10, 1e-6)], "better"),
        ([("one", 10, 1e-6), ("twin", 10, 1e-6)], "one twin"),
        ([], ""),
    ],
)
def test_the_front_is_what_nothing_beats(points, front):
    assert names(pareto_front([point(*each) for each in points])) == front.split()


def test_the_front_agrees_with_its_definition_on_random_points():
    random = np.random.default_rng(0)
    points = [point(str(k), *pair) for k, pair in enumerate(random.integers(1, 12, (60, 2)).tolist())]

    def is_beaten(a):
        return any(
            b.time_ns <= a.time_ns and b.error <= a.error and (b.time_ns, b.error) != (a.time_ns, a.error)
            for b in points
        )

    assert set(names(pareto_front(points))) == {entry.name for entry in points if not is_beaten(entry)}


def test_zero_and_infinite_errors_are_drawn():
    points = [point("zero", 10, 0.0), point("infinite", 20, float("inf")), point("usual", 15, 1e-6)]
    image = imread(io.BytesIO(draw_pareto([Panel("float32", 1000, points), Panel("float64", 100, points)], "title")))
    assert image.ndim == 3
    assert image.shape[1] > image.shape[0]


@pytest.mark.parametrize("count", [1, 8, 22])
def test_labels_overlap_neither_each_other_nor_a_point(count):
    random = np.random.default_rng(count)
    figure = Figure(figsize=(6, 5), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set(xlim=(0, 1), ylim=(0, 1))
    # Crowded on purpose: half the points in a corner.
    places = np.where(
        random.random((count, 1)) < 0.5, random.uniform(0.1, 0.9, (count, 2)), random.uniform(0.4, 0.5, 2)
    )
    places = places + random.uniform(-0.05, 0.05, (count, 2))
    canvas.draw()
    place_labels(axes, [(f"method_name_{k}", *place) for k, place in enumerate(places.tolist())])
    canvas.draw()
    # An annotation's extent holds its leader line, too: ask for the words alone.
    boxes = [type(text).__mro__[1].get_window_extent(text, canvas.get_renderer()) for text in axes.texts]
    assert len(boxes) == count
    assert not [pair for pair in itertools.combinations(boxes, 2) if pair[0].padded(-1).overlaps(pair[1].padded(-1))]
    pixels = axes.transData.transform(places)
    assert not [1 for box in boxes for x, y in pixels.tolist() if box.contains(x, y)]
    inside = axes.get_window_extent()
    assert all(inside.x0 <= box.x0 and box.x1 <= inside.x1 for box in boxes)


def test_a_peer_does_not_move_the_front(monkeypatch):
    fronts, plot = [], Axes.plot

    def plot_and_note(axes, x, y, *arguments, **options):
        # The front alone is drawn as steps.
        if options.get("drawstyle") == "steps-post":
            fronts.append(list(x))
        return plot(axes, x, y, *arguments, **options)

    monkeypatch.setattr(Axes, "plot", plot_and_note)
    own, peer = point("own", 20, 1e-6), point("peer", 10, 1e-7)._replace(kind=PEER)
    draw_pareto([Panel("float32", 1000, [own, peer])], "title")
    assert fronts == [[20]]

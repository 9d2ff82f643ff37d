"""The report's pictures, by the names of their files."""

import functools
from collections.abc import Callable

from jaxrot.report.data import ReportData
from jaxrot.report.measure.front import Point, method_points, peer_points
from jaxrot.report.measure.results import largest_batch
from jaxrot.report.show.pareto import Panel, draw_pareto
from jaxrot.report.show.robustness import draw_robustness
from jaxrot.report.show.stability_maps import draw_condition_maps, draw_scale_map, sorted_methods
from jaxrot.report.show.warm_start_picture import draw_warm_starts

METHODS, PEERS, GRADIENTS, WARM_STARTS = "pareto.png", "peers.png", "gradients.png", "warm_starts.png"
SCALES, SURVIVAL = "stability_scales.png", "survival.png"


def conditions(dtype: str) -> str:
    """The name of a dtype's map over the singular values."""
    return f"stability_{dtype}.png"


def draw_pictures(data: ReportData) -> dict[str, bytes]:
    """Every picture for which something was measured, as PNG."""
    machine = f"{data.environment['device']}, {data.environment['threads']}"
    where = f"{data.given.name}, {sum(data.given.counts.values()):,} matrices\n{machine}"
    pictures = {}
    if panels := _panels(data, largest_batch(data.results.timing), lambda dtype: method_points(data.results, dtype)):
        pictures[METHODS] = draw_pareto(panels, f"Error against run time: {where}")
    compared = [] if data.peers is None else data.peers.contenders
    batch = max((entry.batch for entry in compared), default=0)
    for name, of_gradients in ((PEERS, False), (GRADIENTS, True)):
        points = functools.partial(peer_points, compared, of_gradients=of_gradients)
        if panels := _panels(data, batch, points):
            what = "value and gradient" if of_gradients else "values"
            errors = {"error_name": "relative error of the gradient, 99th percentile"} if of_gradients else {}
            pictures[name] = draw_pareto(panels, f"jaxrot and its peers, {what}: {where}", **errors)
    if data.warm_starts:
        pictures[WARM_STARTS] = draw_warm_starts(data.warm_starts, data.given.name)
    names = list(dict.fromkeys(entry.method for entry in data.results.accuracy))
    if data.conditions:
        names = sorted_methods(data.conditions)
        for found in data.conditions:
            pictures[conditions(found.dtype)] = draw_condition_maps(found, names)
        pictures[SCALES] = draw_scale_map(data.scales, names)
    pictures[SURVIVAL] = draw_robustness(data.results.accuracy, names)
    return pictures


def _panels(data: ReportData, batch: int, points: Callable[[str], list[Point]]) -> list[Panel]:
    """A panel for each dtype that has points."""
    return [Panel(dtype, batch, found) for dtype in data.dtypes if (found := points(dtype))]

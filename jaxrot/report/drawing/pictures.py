"""The report's pictures, by the names of their files."""

from collections.abc import Callable, Sequence

import jaxrot
from jaxrot.report.contenders import Contender, Quantiles, Spread, beyond_front
from jaxrot.report.content import Content
from jaxrot.report.drawing.pareto import APPROXIMATION, EXACT, PEER, Panel, Point, draw_pareto
from jaxrot.report.drawing.warm_starts import draw_warm_starts
from jaxrot.report.findings import on_input, times_at_largest_batch
from jaxrot.report.measurement import Results
from jaxrot.report.stability.maps import draw_condition_maps, draw_scale_map, sorted_methods
from jaxrot.report.stability.survivors import draw_survival

METHODS, PEERS, GRADIENTS, WARM_STARTS = "pareto.png", "peers.png", "gradients.png", "warm_starts.png"
SCALES, SURVIVAL = "stability_scales.png", "survival.png"


def conditions(dtype: str) -> str:
    """The name of a dtype's map over the singular values."""
    return f"stability_{dtype}.png"


def draw_pictures(content: Content) -> dict[str, bytes]:
    """Every picture for which something was measured, as PNG."""
    machine = f"{content.environment['device']}, {content.environment['threads']}"
    count = sum(map(len, content.given.sets.values()))
    where = f"{content.given.name}, {count:,} matrices\n{machine}"
    pictures = {}
    panels = _with_points([methods_panel(content.results, dtype) for dtype in content.dtypes])
    if panels:
        pictures[METHODS] = draw_pareto(panels, f"Error against run time: {where}")
    if content.beside is not None:
        contenders = content.beside.contenders
        values = _with_points([_panel(contenders, dtype, _value) for dtype in content.dtypes])
        if values:
            pictures[PEERS] = draw_pareto(values, f"jaxrot and its peers, values: {where}")
        gradients = _with_points([_panel(contenders, dtype, _gradient) for dtype in content.dtypes])
        if gradients:
            error_name = "relative error of the gradient, 99th percentile"
            pictures[GRADIENTS] = draw_pareto(
                gradients, f"jaxrot and its peers, value and gradient: {where}", error_name
            )
    if content.warm_starts:
        pictures[WARM_STARTS] = draw_warm_starts(content.warm_starts, content.given.name)
    names = list(dict.fromkeys(entry.method for entry in content.results.accuracy))
    if content.conditions:
        names = sorted_methods(content.conditions)
        for found in content.conditions:
            pictures[conditions(found.dtype)] = draw_condition_maps(found, names)
        pictures[SCALES] = draw_scale_map(content.scales, names)
    pictures[SURVIVAL] = draw_survival(content.results.accuracy, names)
    return pictures


def methods_panel(results: Results, dtype: str) -> Panel:
    """Every method on the whole input at the largest batch."""
    times, accuracy = times_at_largest_batch(results, dtype), on_input(results, dtype)
    points = [
        Point(name, time.median_ns, entry.forward_99th, entry.forward_median, entry.forward_max, _kind(name))
        for name, time in times.items()
        if (entry := accuracy[name]).forward_99th is not None
        and entry.forward_median is not None
        and entry.forward_max is not None
    ]
    return Panel(dtype, next(iter(times.values())).batch, points)


def _with_points(panels: Sequence[Panel]) -> list[Panel]:
    return [panel for panel in panels if panel.points]


def _panel(
    contenders: Sequence[Contender],
    dtype: str,
    place: Callable[[Contender], tuple[Quantiles | None, Spread | None]],
) -> Panel:
    points = []
    beyond = beyond_front(contenders, of_gradients=place is _gradient)
    for contender in (contender for contender in contenders if contender.dtype == dtype):
        error, time = place(contender)
        if error is not None and time is not None:
            kind = _kind(contender.name) if contender.is_own else PEER
            errors = (error.percentile_99, error.median, error.largest)
            points.append(Point(contender.name, time.median, *errors, kind, contender in beyond))
    return Panel(dtype, max((contender.batch for contender in contenders), default=0), points)


def _value(contender: Contender) -> tuple[Quantiles | None, Spread | None]:
    return contender.error, contender.time


def _gradient(contender: Contender) -> tuple[Quantiles | None, Spread | None]:
    return contender.gradient_error, contender.gradient_time


def _kind(name: str) -> str:
    """Of a method of jaxrot's, or of the default one in another dtype."""
    method = jaxrot.METHODS.get(name)
    return EXACT if method is None or method.exact else APPROXIMATION

"""All parts of a report, one dtype after the other."""

from collections.abc import Callable
from typing import NamedTuple

import jaxrot
from jaxrot.evaluation.ground_truth import judge
from jaxrot.report import beside, warm_starts
from jaxrot.report.contenders import Beside
from jaxrot.report.drawing.pareto import pareto_front
from jaxrot.report.drawing.pictures import methods_panel
from jaxrot.report.guards import prices
from jaxrot.report.inputs import Input, family_matrices
from jaxrot.report.measurement import WHOLE, Plan, Results, measure_methods
from jaxrot.report.measurement import number_of_steps as steps_of_methods
from jaxrot.report.stability.cells import ConditionMap, ScaleMap, map_conditions, map_scales
from jaxrot.report.warm_starts import WarmStart, measure_warm_starts


class Measured(NamedTuple):
    """What came of a plan; parts that it leaves out are None or empty."""

    results: Results
    beside: Beside | None
    warm_starts: tuple[WarmStart, ...]
    conditions: tuple[ConditionMap, ...] = ()
    scales: tuple[ScaleMap, ...] = ()
    guards: prices.Guards | None = None


def number_of_steps(plan: Plan) -> int:
    """How often `measure` calls `advance`, at most."""
    steps = 1 + steps_of_methods(plan)
    if plan.peers_budget_s is not None:
        steps += beside.number_of_steps([*plan.methods, jaxrot.DEFAULT_METHOD])
    if plan.warm_starts_budget_s is not None:
        steps += warm_starts.number_of_steps(with_peers=plan.peers_budget_s is not None)
    steps += plan.map_steps is not None
    return len(plan.dtypes) * steps + (0 if plan.guards_size is None else prices.number_of_steps(_guards_size(plan)))


def measure(plan: Plan, given: Input, advance: Callable[[str], object]) -> Measured:
    """Measures all parts of the plan, inside `measuring_configuration`.

    Args:
        plan: What to measure.
        given: On which matrices; the families come on top.
        advance: Called before each step with what it is.
    """
    results, contenders, skipped, starts = Results([], [], ()), [], {}, []
    conditions, scales = [], []
    for dtype in plan.dtypes:
        advance(f"{dtype}: the reference")
        judged = {
            "input": judge(given.sets, dtype, whole=WHOLE),
            "families": judge(family_matrices(plan.matrices_a_family, dtype), dtype),
        }
        found, run = measure_methods(plan, judged, advance)
        results = Results(
            results.accuracy + found.accuracy, results.timing + found.timing, results.remarks + found.remarks
        )
        if plan.map_steps is not None:
            advance(f"{dtype}: stability maps")
            conditions.append(map_conditions(plan.methods, run, dtype, plan.map_steps))
            scales.append(map_scales(plan.methods, run, dtype))
        if plan.peers_budget_s is not None:
            on_front = [point.name for point in pareto_front(methods_panel(found, dtype).points)]
            front = list(dict.fromkeys([*on_front, jaxrot.DEFAULT_METHOD]))
            measured = beside.measure_beside(
                front, judged, batch=plan.batches[-1], budget_s=plan.peers_budget_s / len(plan.dtypes), advance=advance
            )
            contenders += measured.contenders
            skipped |= dict.fromkeys(measured.skipped)
        if plan.warm_starts_budget_s is not None:
            starts += measure_warm_starts(
                judged["input"],
                batch=plan.batches[-1],
                budget_s=plan.warm_starts_budget_s / len(plan.dtypes),
                with_peers=plan.peers_budget_s is not None,
                advance=advance,
            )
    peers = None if plan.peers_budget_s is None else Beside(contenders, list(skipped))
    guards = None if plan.guards_size is None else prices.run_guards(_guards_size(plan), advance)
    return Measured(results, peers, tuple(starts), tuple(conditions), tuple(scales), guards)


def _guards_size(plan: Plan) -> prices.Size:
    assert plan.guards_size is not None
    return plan.guards_size._replace(dtypes=plan.dtypes)

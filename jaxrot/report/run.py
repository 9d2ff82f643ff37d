"""All measurements of a report, one dtype after the other."""

from collections.abc import Callable

import jaxrot
from jaxrot.evaluation.ground_truth import judge
from jaxrot.report.data import ReportData
from jaxrot.report.inputs import WHOLE, Input, family_matrices
from jaxrot.report.measure.ablation_cost import measure_guards
from jaxrot.report.measure.front import method_points, pareto_front
from jaxrot.report.measure.methods import Programs, judge_methods, precision_remarks, time_batches
from jaxrot.report.measure.peer_comparison import PeerComparison, compare_with_peers
from jaxrot.report.measure.results import Results
from jaxrot.report.measure.stability import map_conditions, map_scales
from jaxrot.report.measure.warm_starts import measure_warm_starts
from jaxrot.report.plan import Plan


def measure(plan: Plan, given: Input, say: Callable[[str], object]) -> ReportData:
    """Returns the measurements of the plan, taken inside `measuring_configuration`.

    Args:
        plan: What to measure.
        given: The input. The families are measured too.
        say: Called before each stage with its name.
    """
    accuracy, timing, remarks = [], [], []
    compared, skipped, warm_starts, conditions, scales = [], {}, [], [], []
    for dtype in plan.dtypes:
        say(f"{dtype}: reference rotations")
        judged = {
            "input": judge(given.sets, dtype, whole=WHOLE),
            "families": judge(family_matrices(plan.matrices_a_family, dtype), dtype),
        }
        say(f"{dtype}: compiling the methods")
        programs = Programs(plan.methods, dtype, plan.batches)
        say(f"{dtype}: errors of the methods")
        errors = judge_methods(programs, judged)
        say(f"{dtype}: times of the methods")
        times, left_out = time_batches(plan, programs, judged["input"].matrices)
        accuracy += errors
        timing += times
        remarks += precision_remarks(dtype) + left_out
        if plan.map_steps is not None:
            say(f"{dtype}: stability maps")
            conditions.append(map_conditions(plan.methods, programs.run, dtype, plan.map_steps))
            scales.append(map_scales(plan.methods, programs.run, dtype))
        if plan.peers_budget_s is not None:
            say(f"{dtype}: peers")
            points = pareto_front(method_points(Results(errors, times, ()), dtype))
            peers = compare_with_peers(
                list(dict.fromkeys([*(point.name for point in points), jaxrot.DEFAULT_METHOD])),
                judged,
                batch=plan.batches[-1],
                budget_s=plan.peers_budget_s / len(plan.dtypes),
            )
            compared += peers.contenders
            skipped |= dict.fromkeys(peers.skipped)
        if plan.warm_starts_budget_s is not None:
            say(f"{dtype}: warm starts")
            warm_starts += measure_warm_starts(
                judged["input"],
                batch=plan.batches[-1],
                budget_s=plan.warm_starts_budget_s / len(plan.dtypes),
                with_peers=plan.peers_budget_s is not None,
            )
    guards = None
    if plan.guards is not None:
        say("guards")
        guards = measure_guards(plan.guards, plan.dtypes)
    return ReportData(
        given=given,
        dtypes=plan.dtypes,
        results=Results(accuracy, timing, tuple(remarks)),
        peers=None if plan.peers_budget_s is None else PeerComparison(compared, list(skipped)),
        warm_starts=tuple(warm_starts),
        conditions=tuple(conditions),
        scales=tuple(scales),
        guards=guards,
    )

import numpy as np
import pytest

import jaxrot
from jaxrot.evaluation import reference
from jaxrot.evaluation.ground_truth import judge
from jaxrot.report.measure import warm_starts
from jaxrot.report.measure.warm_starts import ANGLE_DEGREES, COLD_START, PAPER, measure_warm_starts
from jaxrot.report.peers import paper_code
from jaxrot.report.peers.peer import UnavailableError
from jaxrot.report.show.comparison_tables import warm_starts_table


@pytest.fixture(scope="module")
def judged():
    return judge({"own": np.random.default_rng(0).standard_normal((20, 3, 3))}, "float64", whole="whole")


@pytest.fixture(scope="module")
def measured(judged):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(warm_starts, "_ITERATIONS", {"torque": (1, 3), "newton": (4,), PAPER: (1, 3)})
        # A batch that does not hold all of them, and one that is not filled.
        found = measure_warm_starts(judged, batch=16, budget_s=0.0, with_peers=True)
    return {(entry.step, entry.iterations): entry for entry in found}


def test_starts_are_the_angle_off_and_without_peers_the_paper_is_left_out(judged):
    starts = warm_starts._turned(judged)
    cosine = (np.einsum("nij,nij->n", starts, judged.solution.rotation) - 1) / 2
    np.testing.assert_allclose(np.rad2deg(np.arccos(cosine.astype(float))), ANGLE_DEGREES, rtol=1e-9)
    assert PAPER not in warm_starts.steps_to_measure(with_peers=False)
    assert PAPER in warm_starts.steps_to_measure(with_peers=True)


@pytest.mark.exhaustive
def test_errors_are_those_of_the_iterations_and_each_has_a_row(judged, measured):
    assert measured[COLD_START, 0].error.largest < 1e-13
    assert measured["newton", 4].error.largest < 1e-12
    refined = jaxrot.refine_rotation(judged.matrices, warm_starts._turned(judged), step="torque", iterations=3)
    error = reference.forward_error(np.asarray(refined), judged.matrices)
    assert measured["torque", 3].error.largest == pytest.approx(error.max())
    assert all(0 < entry.time.quartile_1 <= entry.time.median for entry in measured.values())
    table = warm_starts_table(list(measured.values()), "float64")
    assert len(table.rows) == len(measured)
    assert {row[0] for row in table.rows} == {step for step, _ in measured}


@pytest.mark.exhaustive
def test_the_papers_own_code_takes_the_same_steps(measured):
    if (PAPER, 1) not in measured:
        with pytest.raises(UnavailableError):
            paper_code.refine("float64")
        return
    for iterations in (1, 3):
        own, paper = measured["torque", iterations].error, measured[PAPER, iterations].error
        np.testing.assert_allclose(paper, own, rtol=1e-6)

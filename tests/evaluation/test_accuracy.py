import numpy as np
import pytest

import jaxrot
from jaxrot.evaluation import accuracy
from jaxrot.evaluation.domain import describe_domain, in_domain
from jaxrot.evaluation.ground_truth import judge

EPS = np.finfo(np.float32).eps


@pytest.fixture(scope="module")
def judged():
    random = np.random.default_rng(0).standard_normal((50, 3, 3))
    special = np.stack([np.zeros((3, 3)), -np.eye(3), np.full((3, 3), np.nan), np.full((3, 3), 1e-44)])
    return judge({"random": random, "special": special}, "float32", whole="whole")


@pytest.fixture(scope="module")
def best(judged):
    return judged.solution.rotation.astype(np.float32)


def outside(rotation, judged):
    return np.flatnonzero(accuracy.measure_errors(rotation, judged).is_outside).tolist()


def test_errors_are_defined_where_the_contract_speaks_of_them_and_counted_in_each_set(judged, best):
    errors = accuracy.measure_errors(best, judged)
    assert not np.isnan(errors.forward[:50]).any()
    assert np.isnan(errors.forward[50:]).all(), "R is not unique, not finite, or lost with the subnormal entries"
    np.testing.assert_array_equal(np.isnan(errors.orthogonality[50:]), [False, False, True, False])
    np.testing.assert_array_equal(np.isnan(errors.torque[50:]), [False, False, True, True])
    rotation = best.copy()
    rotation[7] = -rotation[7]
    method = jaxrot.METHODS[jaxrot.DEFAULT_METHOD]
    errors = accuracy.measure_errors(rotation, judged)
    whole, random, special = accuracy.summarise("name", method, errors, judged, "input")
    assert (whole.matrices, whole.not_finite, whole.judged, whole.outside) == (54, 1, 50, 1)
    assert (random.matrices, random.outside, random.outside_in_domain) == (50, 1, 1)
    assert (special.matrices, special.judged, special.forward_max, special.outside) == (4, 0, None, 0)
    assert whole.in_domain == 54


SPOILS = {
    "another rotation": (7, lambda r: r[[1, 2, 0]]),
    "a reflection": (7, lambda r: -r),
    "stretched": (7, lambda r: r * np.float32(1 + 20 * EPS)),
    "NaN": (7, lambda r: r * np.float32(np.nan)),
    "inf": (7, lambda r: np.full_like(r, np.inf)),
    "transposed": (7, lambda r: r.T),
    "a number where NaN is promised": (52, lambda r: np.eye(3)),
}


@pytest.mark.parametrize("name", SPOILS)
def test_what_is_wrong_and_only_that_is_outside(name, judged, best):
    assert outside(best, judged) == []
    number, spoil = SPOILS[name]
    rotation = best.copy()
    rotation[number] = spoil(rotation[number])
    assert outside(rotation, judged) == [number]


def test_the_domain_is_what_the_method_declares(judged):
    limited = jaxrot.METHODS["svd"]._replace(condition_limit={"float32": 2.0, "float64": 2.0})
    np.testing.assert_array_equal(in_domain(limited, judged), judged.condition <= 2)
    upright = limited._replace(handles_inversion=False)
    np.testing.assert_array_equal(in_domain(upright, judged), (judged.condition <= 2) & ~judged.is_inverted)
    silent = limited._replace(condition_limit={"float32": 0.0, "float64": 0.0})
    assert not in_domain(silent, judged).any()
    assert describe_domain(upright, "float32") == "exact, det ≥ 0, κ ≤ 2"


def test_chunks_are_filled_up_and_every_matrix_keeps_its_start():
    matrices = np.arange(7 * 9, dtype=np.float32).reshape(7, 3, 3)
    shapes = []

    def call(matrix, start=0):
        shapes.append((matrix.shape, np.shape(start)))
        return 2 * matrix - start

    np.testing.assert_array_equal(accuracy.run_in_chunks(call, matrices, 3), 2 * matrices)
    np.testing.assert_array_equal(accuracy.run_in_chunks(call, matrices, 3, -matrices), 3 * matrices)
    assert shapes == [((3, 3, 3), ())] * 3 + [((3, 3, 3), (3, 3, 3))] * 3

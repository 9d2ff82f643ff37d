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


def test_the_nearest_rotation_is_inside_the_contract(judged, best):
    assert outside(best, judged) == []


def test_errors_are_defined_where_the_contract_speaks_of_them(judged, best):
    errors = accuracy.measure_errors(best, judged)
    assert not np.isnan(errors.forward[:50]).any()
    assert np.isnan(errors.forward[50:]).all(), "R is not unique, not finite, or lost with the subnormal entries"
    np.testing.assert_array_equal(np.isnan(errors.orthogonality[50:]), [False, False, True, False])
    np.testing.assert_array_equal(np.isnan(errors.torque[50:]), [False, False, True, True])


@pytest.mark.parametrize(
    "spoil",
    {
        "another rotation": lambda r: r[[1, 2, 0]],
        "a reflection": lambda r: -r,
        "stretched": lambda r: r * np.float32(1 + 20 * EPS),
        "NaN": lambda r: r * np.float32(np.nan),
        "inf": lambda r: np.full_like(r, np.inf),
        "transposed": lambda r: r.T,
    }.items(),
    ids=lambda item: item[0],
)
def test_what_is_wrong_is_outside(spoil, judged, best):
    rotation = best.copy()
    rotation[7] = spoil[1](rotation[7])
    assert outside(rotation, judged) == [7]


def test_a_number_where_nan_is_promised_is_outside(judged, best):
    rotation = best.copy()
    rotation[52] = np.eye(3)
    assert outside(rotation, judged) == [52]


def test_the_summary_counts_each_set(judged, best):
    rotation = best.copy()
    rotation[7] = -rotation[7]
    method = jaxrot.METHODS[jaxrot.DEFAULT_METHOD]
    errors = accuracy.measure_errors(rotation, judged)
    whole, random, special = accuracy.summarise("name", method, errors, judged, "input")
    assert (whole.matrices, whole.not_finite, whole.judged, whole.outside) == (54, 1, 50, 1)
    assert (random.matrices, random.outside, random.outside_in_domain) == (50, 1, 1)
    assert (special.matrices, special.judged, special.forward_max, special.outside) == (4, 0, None, 0)
    assert whole.in_domain == 54


def test_the_domain_is_what_the_method_declares(judged):
    limited = jaxrot.METHODS["svd"]._replace(condition_limit={"float32": 2.0, "float64": 2.0})
    np.testing.assert_array_equal(in_domain(limited, judged), judged.condition <= 2)
    upright = limited._replace(handles_inversion=False)
    np.testing.assert_array_equal(in_domain(upright, judged), (judged.condition <= 2) & ~judged.is_inverted)
    silent = limited._replace(condition_limit={"float32": 0.0, "float64": 0.0})
    assert not in_domain(silent, judged).any()
    assert describe_domain(upright, "float32") == "exact, det ≥ 0, κ ≤ 2"


def test_chunks_fill_up_and_lose_nothing():
    matrices = np.arange(7 * 9, dtype=np.float32).reshape(7, 3, 3)
    shapes = []

    def double(part):
        shapes.append(part.shape)
        return 2 * part

    np.testing.assert_array_equal(accuracy.run_in_chunks(double, matrices, 3), 2 * matrices)
    assert shapes == [(3, 3, 3)] * 3


def test_chunks_are_filled_up_and_every_matrix_keeps_its_start():
    matrices = np.arange(5 * 9, dtype=np.float32).reshape(5, 3, 3)

    def call(matrix, start):
        assert len(matrix) == len(start) == 2
        return matrix - start

    np.testing.assert_array_equal(accuracy.run_in_chunks(call, matrices, 2, -matrices), 2 * matrices)

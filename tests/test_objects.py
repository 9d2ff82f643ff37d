"""What jaxrot hands out can be hashed, copied and pickled, and functions that return its records can be exported."""

import copy
import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrot
from jaxrot import METHODS, STEPS, in_blocks, nearest_rotation
from jaxrot._recommend import candidates
from jaxrot.scenes import drift

A = np.random.default_rng(0).standard_normal((4, 3, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def recommendation():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "TIMING_BUDGET_S", 0.02)
        patch.setattr("jaxrot._recommend.recommend.METHODS", {name: METHODS[name] for name in ("squaring", "foam")})
        return jaxrot.recommend(A, tolerance=1e-3)


OBJECTS = {
    "METHODS": METHODS,
    **{f"METHODS[{name!r}]": method for name, method in METHODS.items()},
    "STEPS": STEPS,
    **{f"STEPS[{name!r}]": step for name, step in STEPS.items()},
    "in_blocks": in_blocks(nearest_rotation, 7),
}


@pytest.mark.parametrize("name", OBJECTS)
def test_it_can_be_hashed_copied_and_pickled(name):
    thing = OBJECTS[name]
    for again in (copy.deepcopy(thing), copy.copy(thing), pickle.loads(pickle.dumps(thing))):
        assert again == thing
        assert hash(again) == hash(thing)


def test_a_recommendation_can_be_hashed_copied_and_pickled_and_a_registry_not_be_changed(recommendation):
    hash(recommendation)
    for again in (copy.deepcopy(recommendation), pickle.loads(pickle.dumps(recommendation))):
        assert again._replace(apply=recommendation.apply).statement == recommendation.statement
        np.testing.assert_array_equal(again.apply(A), recommendation.apply(A))
    with pytest.raises(TypeError):
        METHODS["svd"] = METHODS["foam"]  # pyright: ignore[reportIndexIssue]


RECORDS = {
    "polar_decomposition": jaxrot.polar_decomposition,
    "rotation_variant_svd": jaxrot.rotation_variant_svd,
    "twist_modes": jaxrot.twist_modes,
    "drift": lambda a: drift.State(*(a[..., 0, 0] for _ in drift.State._fields)),
}


@pytest.mark.parametrize("name", RECORDS)
def test_a_function_that_returns_a_record_can_be_serialised(name):
    exported = jax.export.export(jax.jit(RECORDS[name]))(jax.ShapeDtypeStruct(A.shape, jnp.float32))
    again = jax.eval_shape(jax.export.deserialize(exported.serialize()).call, A)
    assert again == jax.eval_shape(RECORDS[name], A)

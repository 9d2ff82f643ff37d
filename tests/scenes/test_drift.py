"""Drift: the reference is exact, and each repair does to the rotation what the notebook says of it."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrot import DEFAULT_METHOD
from jaxrot.scenes import cycles, drift
from jaxrot.scenes.free_top import tumbling_rates
from jaxrot.scenes.scene import flops

EPS = float(jnp.finfo(jnp.float32).eps)
PERIOD, BODIES, STEPS = 40, 16, 20_000


@pytest.fixture(scope="module")
def bodies():
    """Tumbling tops beside bodies that turn steadily: shape (2, BODIES)."""
    draw = np.random.default_rng(0)
    tumbling, time_step = tumbling_rates((1, 2, 3), draw.normal(size=(BODIES, 3)), PERIOD)
    steady = draw.normal(size=(BODIES, 3))
    steady *= 0.02 / np.linalg.norm(steady, axis=-1, keepdims=True)
    rates = np.stack([tumbling, np.tile(steady, (PERIOD, 1, 1))], axis=1)
    return drift.build(rates, np.stack([time_step, np.ones(BODIES)]))


@functools.cache
def _advance(repair, every):
    return jax.jit(functools.partial(drift.advance, repair=repair, every=every))


@jax.jit
def _measure(state, parameters):
    return drift.orientation_error(state, parameters), drift.orthonormality_error(state)


def _errors(bodies, repair, every=1, steps=STEPS):
    """Root mean square of the orientation error over the bodies of a kind, and the worst orthonormality."""
    start, parameters = bodies
    state = _advance(repair, every)(start, parameters, steps)
    orientation, orthonormality = _measure(state, parameters)
    return np.sqrt(np.mean(np.square(orientation), axis=-1)), float(np.max(orthonormality))


def test_the_reference_is_exact_after_millions_of_steps(bodies):
    state, parameters = bodies
    dense = np.asarray(parameters.increments, dtype=np.float64)
    for _ in range(3):
        dense = 1.5 * dense - 0.5 * dense @ np.swapaxes(dense, -1, -2) @ dense
    cycle = functools.reduce(np.matmul, dense)
    reference = jax.jit(drift.reference)
    for whole, rest in ((0, 7), (3, 0), (25_000, 1), (3 * 2**16 + 5, 2)):
        exact = functools.reduce(np.matmul, dense[:rest], np.linalg.matrix_power(cycle, whole))
        state = state._replace(step_count=jnp.int32(whole * PERIOD + rest))
        error = np.asarray(reference(state, parameters), dtype=np.float64) - exact
        assert np.max(np.linalg.norm(error, axis=(-2, -1))) < 6 * EPS


def test_no_repair_loses_orthonormality_in_proportion_to_the_steps_and_not_orientation(bodies):
    few, many = (_errors(bodies, None, steps=steps)[1] for steps in (STEPS // 10, STEPS))
    assert few > 200 * EPS
    assert 8 < many / few < 12
    assert np.all(_errors(bodies, None)[0] < 0.5 * EPS * STEPS**0.5)


@pytest.mark.parametrize("every", [1, 1000])
def test_taylor_keeps_orthonormality_and_the_random_walk_of_rounding(bodies, every):
    orientation, orthonormality = _errors(bodies, "taylor", every)
    assert np.all(orientation < 0.5 * EPS * STEPS**0.5)
    assert orthonormality < 3 * EPS


def test_the_default_drifts_about_as_far_as_taylor(bodies):
    """Both repair after every product. A method whose rounding has a mean drifts 20 times as far."""
    orientation, orthonormality = _errors(bodies, DEFAULT_METHOD)
    assert (orientation <= 1.5 * _errors(bodies, "taylor")[0]).all()
    assert orthonormality < 1e-6


def test_gram_schmidt_drifts_from_a_steady_body_in_proportion_to_the_steps(bodies):
    few, many = (_errors(bodies, "gram_schmidt", steps=steps) for steps in (STEPS // 10, STEPS))
    # Random rounding would grow by √10.
    assert many[0][1] > 6 * few[0][1]
    assert many[1] < 5 * EPS


def test_between_repairs_the_product_is_that_without_repair(bodies):
    start, parameters = bodies
    steps = 999
    rare, without = (_advance(*choice)(start, parameters, steps) for choice in (("taylor", 1000), (None, 1)))
    np.testing.assert_array_equal(rare.rotation, without.rotation)
    repaired = _advance("taylor", 1000)(rare, parameters, 1)
    assert np.max(_measure(repaired, parameters)[1]) < 3 * EPS


def test_what_is_switched_off_is_not_in_the_program(bodies):
    def step(repair, every):
        return functools.partial(drift.step, repair=repair, every=every)

    # 27 products, 18 sums, and the few operations on the step's number.
    assert flops(step(None, 1), *bodies) == pytest.approx(45 * 2 * BODIES, rel=0.02)
    assert flops(step("taylor", 1), *bodies) > 4 * 45 * 2 * BODIES
    asked = {every: "cond[" in str(jax.make_jaxpr(step("taylor", every))(*bodies)) for every in (1, 7)}
    assert asked == {1: False, 7: True}


def test_a_free_top_keeps_energy_and_momentum_and_comes_back_and_a_cycle_needs_no_axis():
    moments = np.array([1.0, 2, 3])
    starts = np.random.default_rng(1).normal(size=(8, 3))
    rates, time_step = tumbling_rates(moments, starts, 64)
    energy, momentum = np.sum(moments * rates**2, axis=-1), np.sum((moments * rates) ** 2, axis=-1)
    np.testing.assert_allclose(energy, energy[:1] + 0 * energy, rtol=1e-9)
    np.testing.assert_allclose(momentum, momentum[:1] + 0 * momentum, rtol=1e-9)
    # Half a step after the last of the rates the period is over.
    np.testing.assert_allclose(tumbling_rates(moments, rates[-1], 64)[0][0], starts, atol=1e-7)
    slow, slow_step = tumbling_rates(moments, starts / 7, 64)
    np.testing.assert_allclose(7 * slow, rates, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(slow_step, 7 * time_step)
    start, parameters = drift.build(np.zeros((2, 1, 3)), 1)
    np.testing.assert_array_equal(jax.jit(cycles.power)(parameters.cycle, jnp.int32(5)), start.rotation)


@pytest.mark.exhaustive
def test_the_scene_runs(monkeypatch):
    # Three of the five: compiling the others takes long.
    monkeypatch.setattr(drift, "_SHOWN", tuple(shown for shown in drift._SHOWN if shown[1] in (None, "taylor")))
    scene = drift.drift()
    assert jax.eval_shape(scene.step, scene.state) == jax.eval_shape(lambda s: s, scene.state)
    state = jax.jit(scene.step)(scene.state)
    points = jax.jit(scene.points)(state)
    assert points.shape == (np.max(scene.lines) + 1, 3)
    lengths = np.linalg.norm(points[scene.lines[:, 1]] - points[scene.lines[:, 0]], axis=-1)
    np.testing.assert_allclose(lengths, 1, atol=0.02)
    health = jax.jit(scene.health)(state)
    assert all(float(value) < 1e-4 for value in health.values())
    assert float(health["orthonormality error, no repair (1)"]) > 10 * EPS
    assert float(health["orthonormality error, taylor (1)"]) < 3 * EPS


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: drift.build(np.full((1, 3), np.nan), 1), "rates must be finite"),
        (lambda: drift.build(np.zeros((1, 2)), 1), "rates must have shape"),
        (lambda: drift.build(np.zeros((1, 3)), 0), "time_step must be finite and > 0"),
        (lambda: drift.build(np.zeros((1, 3)), -1), "time_step must be finite and > 0"),
        (lambda: drift.build(np.zeros((1, 3)), [1, 1]), "time_step must have shape"),
        (lambda: drift.build(np.full((1, 3), 2), 1), "a quarter turn"),
        (lambda: drift.step(*drift.build(np.zeros((1, 3)), 1), repair="magic"), "repair must be None or one of"),
        (lambda: drift.step(*drift.build(np.zeros((1, 3)), 1), every=0), "every must be a static integer"),
        (lambda: tumbling_rates((1, 1, 2), (1, 1, 1), 64), "inertia must be"),
        (lambda: tumbling_rates((1, 2, 3), (1, 1, np.inf), 64), "rates must be finite"),
        (lambda: tumbling_rates((1, 2, 3), (0, 1, 0), 64), "no period"),
        (lambda: tumbling_rates((1, 2, 3), (1, 1, 1), 4), "period_steps must be"),
    ],
)
def test_bad_input_gets_one_line(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)

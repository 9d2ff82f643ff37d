"""What is recommended, on matrices that differ in what they need; times are those of a table, but in one test."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import stretched, turned

import jaxrot
from jaxrot import DEFAULT_METHOD, METHODS, STEPS, recommend
from jaxrot._recommend import candidates
from jaxrot._recommend import recommend as recommend_module
from jaxrot._recommend import sample as sample_module
from jaxrot._recommend.candidates import outside_domain, start_outside_domain
from jaxrot._recommend.sample import take_sample
from jaxrot.evaluation import reference
from jaxrot.evaluation.timing import Timing
from jaxrot.families import FAMILIES

# What the report measured; a step is as fast as so many ns for each of its iterations.
NS = {"taylor": 15, "quaternion_average": 15, "higham_noferini": 36, DEFAULT_METHOD: 52, "squaring": 132}
NS_A_STEP = {"newton": 25, "cayley": 24, "quest": 27, "torque": 10, "torque_exact_angle": 20}
ALWAYS = {"singular_pair", "squaring", "jacobi_svd", "implicit_qr_svd"}
SLOW_TO_COMPILE = {"squaring", "jacobi_svd", "implicit_qr_svd", "horn_quartic"}
APPROXIMATIONS = {name for name, method in METHODS.items() if not method.exact}
LIMITED_TO_ROTATIONS = {"foam", "higham_newton", "taylor_iterated"}
CLOSED = {"horn_quartic", "higham_noferini"}
FEW_STEPS = ("newton", "torque_exact_angle")


def fake_times(compiled, matrices, batch, *, budget_s, starts=None):
    def entry(name):
        step, _, iterations = name.partition(" (")
        ns = NS_A_STEP[step] * int(iterations.split()[0]) if iterations else NS.get(name, 300)
        return Timing(name, matrices.dtype.name, batch, ns, 0.96 * ns, 1.04 * ns, ns, 5, 1, 1.0)

    return [entry(name) for name in compiled]


@pytest.fixture(scope="module")
def patch():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "time_methods", fake_times)
        yield patch


def rotations(count, seed=0):
    return FAMILIES["rotation"].sample(count, dtype=np.float32, seed=seed).matrices


def noisy(count, noise, seed=0):
    random = np.random.default_rng(seed)
    return (rotations(count, seed) + noise * random.standard_normal((count, 3, 3))).astype(np.float32)


@pytest.fixture(scope="module")
def on_noise(patch):
    methods = {name: method for name, method in METHODS.items() if name not in SLOW_TO_COMPILE}
    with pytest.MonkeyPatch.context() as own:
        own.setattr(recommend_module, "METHODS", methods)
        return recommend(noisy(500, 0.01), tolerance=1e-2)


@pytest.fixture(scope="module")
def inverted():
    matrices = np.random.default_rng(0).standard_normal((203, 3, 3)).astype(np.float32)
    matrices[7, 1, 2], matrices[8, 0, 0], matrices[9] = np.nan, np.inf, 0
    return matrices


@pytest.fixture(scope="module")
def on_inverted(patch, inverted):
    return recommend(inverted, tolerance=1e-2)


def admitted(matrices):
    sample = take_sample(matrices, None, None)
    return {name for name, method in METHODS.items() if outside_domain(method, sample) is None}


def test_noisy_rotations_are_spared_what_they_do_not_need_and_inverted_matrices_are_not(on_noise, on_inverted):
    assert (on_noise.meets, on_noise.name, on_noise.method, on_noise.step) == (True, "taylor", "taylor", None)
    assert not METHODS[on_noise.method].handles_inversion
    assert 0 < on_noise.error <= 1e-2 / on_noise.margin
    matrices = noisy(500, 0.01)
    error = reference.forward_error(np.asarray(on_noise.apply(matrices)), matrices).max()
    assert on_noise.error == pytest.approx(error, rel=1e-3)
    dearer = {each.name: each.time_ns for each in on_noise.runners_up}
    assert dearer[DEFAULT_METHOD] > on_noise.time_ns
    assert f"The default, {DEFAULT_METHOD}, takes 52 ns" in on_noise.statement
    assert on_inverted.meets
    assert on_inverted.name == DEFAULT_METHOD
    assert "det A < 0" in on_inverted.excluded["taylor"]
    assert {each.name for each in on_inverted.runners_up} == ALWAYS - {DEFAULT_METHOD}


def test_every_method_is_in_exactly_one_place_and_what_was_left_out_is_counted(on_noise, on_inverted):
    for result, methods in ((on_noise, METHODS.keys() - SLOW_TO_COMPILE), (on_inverted, METHODS)):
        others = [each.name for each in (*result.runners_up, *result.too_inaccurate)]
        assert sorted([result.name, *others, *result.excluded]) == sorted(methods)
        for each in result.runners_up:
            assert each.error <= result.tolerance / result.margin
            assert each.time_ns > 0
        for each in result.too_inaccurate:
            assert each.error > result.tolerance / result.margin
            assert np.isnan(each.time_ns)
    assert (on_inverted.given, on_inverted.not_finite, on_inverted.sample) == (203, 2, 201)
    assert on_inverted.undetermined == 1
    assert "2 of 203 matrices left out: NaN or infinity" in on_inverted.statement
    assert "of 1 matrix is not determined" in on_inverted.statement


@pytest.mark.parametrize(
    ("s", "expected"),
    [
        ((1, 1, 1), ALWAYS | APPROXIMATIONS | LIMITED_TO_ROTATIONS | CLOSED),
        ((1, 0.9, 0.8), ALWAYS | APPROXIMATIONS | CLOSED),
        *(((1, *others), ALWAYS | CLOSED) for others in ((0.4, 0.3), (0.9, -0.3), (0.9, 0))),
        *(((1, *others), ALWAYS) for others in ((0.1, 0.1), (1e-4, 1e-5), (1, -1), (0, 0))),
    ],
)
def test_the_declared_domain_decides_who_is_a_candidate_at_every_scale(s, expected):
    for scale in (1, 1e-30, 1e30):
        assert admitted(np.float32(scale) * stretched(s)) == expected


def test_the_reasons_name_the_numbers():
    sample = take_sample(np.concatenate([stretched((1, 0.05, 0.05), 9), noisy(4, 0.01) * [1, 1, -1]]), None, None)
    assert "κ ≤ 2, and κ is up to" in outside_domain(METHODS["horn_quartic"], sample)
    assert "4 of 13 have det A < 0" in outside_domain(METHODS["cayley"], sample)
    assert "no κ" in outside_domain(METHODS["svd"], sample)
    sample = take_sample(stretched((1, 0.05, 0.05)), None, None)
    assert outside_domain(METHODS["foam"], sample) == "declared for κ ≤ 0.5, and κ is up to 10"
    # What is beyond a limit in the sixth digit is not shown as if it were equal.
    sample = take_sample(stretched((1, 0.99999, 0.99999)), None, None)
    assert "κ is up to 0.500005" in outside_domain(METHODS["foam"], sample)


def test_the_domain_is_asked_of_all_matrices_and_the_extremes_are_in_the_sample(monkeypatch):
    monkeypatch.setattr(sample_module, "MOST_MATRICES", 20)
    monkeypatch.setattr(sample_module, "EXTREMES", 1)
    matrices = np.concatenate([noisy(500, 0.01), stretched((1, 0.05, 0.05), 1), stretched((1, 1, -0.5), 2)])
    sample = take_sample(matrices[np.random.default_rng(0).permutation(503)], None, None)
    assert (sample.given, sample.finite, sample.n_inverted, len(sample.judged.matrices)) == (503, 503, 2, 20)
    assert sample.largest_condition == pytest.approx(10, rel=1e-5)
    assert sample.judged.condition.max() == pytest.approx(10, rel=1e-5)
    assert sample.judged.is_inverted.any()


def test_a_tolerance_that_nothing_meets_gets_the_best_and_says_so(patch, inverted):
    result = recommend(inverted, tolerance=1e-12)
    assert not result.meets
    assert result.runners_up == ()
    assert result.error == min([result.error, *(each.error for each in result.too_inaccurate)])
    assert result.statement.startswith("Nothing meets the tolerance 1.0e-12 on 201 matrices in float32")
    assert f"{result.name} comes nearest" in result.statement
    assert np.isfinite(result.apply(inverted[:5])).all()
    # Met without the margin is not met, and said so.
    almost = recommend(inverted, tolerance=1.5 * result.error)
    assert not almost.meets
    assert "within the tolerance, but without the margin" in almost.statement


def test_the_spread_of_times_decides_nothing_and_the_error_does():
    def candidate(name, error, ns):
        return candidates.Candidate(name, name, None, None, error, ns, (0.9 * ns, 1.1 * ns))

    fastest, tied, slow = candidate("a", 3.0, 10.0), candidate("b", 2.0, 11.0), candidate("c", 1.0, 20.0)
    assert recommend_module._cheapest([fastest, tied, slow]) is tied


@pytest.fixture(scope="module")
def frames():
    """Matrices that need the default from cold, and rotations of a frame before, 0.1 rad off."""
    matrices = stretched((1, 0.6, -0.2), 300)
    solution = reference.reference_rotation(matrices)
    return matrices, (solution @ turned([0, 0, 1], 0.1)).astype(np.float32)


@pytest.fixture(scope="module")
def few_methods(patch):
    methods = {name: METHODS[name] for name in (DEFAULT_METHOD, "taylor")}
    with pytest.MonkeyPatch.context() as own:
        own.setattr(recommend_module, "METHODS", methods)
        own.setattr(recommend_module, "STEPS", {name: STEPS[name] for name in FEW_STEPS})
        yield


@pytest.fixture(scope="module")
def warm(few_methods, frames):
    return recommend(frames[0], previous=frames[1], tolerance=1e-2)


def test_with_previous_rotations_a_step_and_few_iterations_are_recommended(warm, frames):
    assert warm.meets
    assert warm.step in FEW_STEPS
    assert (warm.method, warm.iterations) == (None, 1)
    names = [warm.name, *(each.name for each in (*warm.runners_up, *warm.too_inaccurate)), *warm.excluded]
    assert [sum(name.startswith(f"{step} (") for name in names) for step in FEW_STEPS] == [1] * len(FEW_STEPS)
    assert DEFAULT_METHOD in names
    rotation = jax.jit(warm.apply)(*frames)
    assert reference.forward_error(np.asarray(rotation), frames[0]).max() <= 1e-2
    # The smallest number of iterations.
    linear = {each.step: each for each in warm.runners_up if each.step}["torque_exact_angle"]
    assert linear.iterations > 1
    fewer = jaxrot.refine_rotation(*frames, step=linear.step, iterations=linear.iterations - 1)
    assert reference.forward_error(np.asarray(fewer), frames[0]).max() > 1e-2 / warm.margin >= linear.error


def test_a_method_from_cold_wins_where_it_is_cheaper_and_is_called_alike(few_methods, frames):
    matrices = noisy(300, 0.01)
    result = recommend(matrices, previous=rotations(300), tolerance=1e-2)
    assert (result.method, result.step, result.iterations) == ("taylor", None, None)
    one_start = result.apply(matrices[0], rotations(300).astype(np.float64))
    assert (one_start.shape, one_start.dtype) == ((300, 3, 3), np.float32)
    expected = jaxrot.nearest_rotation(matrices, method="taylor")
    np.testing.assert_array_equal(result.apply(matrices, rotations(300)), expected)


def test_a_step_is_left_out_where_the_starts_are_too_far(frames):
    matrices, _ = frames
    half_turn = reference.reference_rotation(matrices) * np.array([1, -1, -1])
    sample = take_sample(matrices, half_turn.astype(np.float32), None)
    assert "from within 90°, and a start is 180° off" in start_outside_domain("cayley", sample)
    assert start_outside_domain("quest", sample) is not None
    assert start_outside_domain("newton", sample) is None


def test_the_function_is_for_jit_vmap_and_grad(on_noise):
    matrices = jnp.asarray(noisy(4, 0.01))
    rotation = on_noise.apply(matrices)
    np.testing.assert_allclose(jax.jit(jax.vmap(on_noise.apply))(matrices), rotation, atol=1e-6)
    gradient = jax.jit(jax.grad(lambda a: on_noise.apply(a)[0, 1]))(matrices[0])
    expected = jax.jit(jax.grad(lambda a: jaxrot.nearest_rotation(a, method="taylor")[0, 1]))(matrices[0])
    np.testing.assert_allclose(gradient, expected, atol=1e-6)
    assert repr(on_noise.apply) == "<nearest_rotation(..., method='taylor')>"


def test_where_no_error_is_defined_a_wrong_rotation_counts(patch):
    """At rank 1 and at 0 the nearest rotation is not unique."""
    sample = take_sample(np.concatenate([stretched((1, 0, 0), 5), np.zeros((1, 3, 3), np.float32)]), None, None)
    assert candidates.undetermined(sample) >= 1
    right = sample.judged.solution.rotation.astype(np.float32)
    where = sample.judged.condition > 1e9
    assert candidates.error_on(right, sample.judged) < 1e-2
    for wrong in (1.5 * right, right @ np.diag([1, 1, -1]).astype(np.float32), np.nan * right):
        spoiled = np.where(where[:, None, None], wrong, right)
        assert candidates.error_on(spoiled, sample.judged) > 0.5


def test_times_are_measured_on_this_machine(inverted, monkeypatch):
    monkeypatch.setattr(candidates, "TIMING_BUDGET_S", 0.1)
    monkeypatch.setattr(recommend_module, "METHODS", {DEFAULT_METHOD: METHODS[DEFAULT_METHOD]})
    with pytest.MonkeyPatch.context() as own:
        own.setattr(candidates, "time_methods", jaxrot.evaluation.timing.time_methods)
        result = recommend(inverted, tolerance=1e-2)
    low, high = result.time_quartiles_ns
    assert 0 < low <= result.time_ns <= high < 1e5
    assert result.batch == sample_module.SMALLEST_BATCH


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"matrices": np.ones((3, 4))}, ValueError, r"matrices must be a real array of shape \(..., 3, 3\)"),
        ({"matrices": np.ones((3, 3), complex)}, TypeError, "matrices must be a real array"),
        ({"matrices": np.ones((0, 3, 3))}, ValueError, r"at least one matrix; got shape \(0, 3, 3\)"),
        ({"matrices": np.full((2, 3, 3), np.nan)}, ValueError, "a finite one, with a finite start .*; got none of 2"),
        ({"tolerance": 0.0}, ValueError, "tolerance must be finite and > 0; got 0.0"),
        ({"tolerance": -1e-3}, ValueError, "tolerance must be finite and > 0"),
        ({"tolerance": np.nan}, ValueError, "tolerance must be finite and > 0; got nan"),
        ({"tolerance": "small"}, TypeError, "tolerance must be a Python number; got str"),
        ({"dtype": "float16"}, ValueError, "dtype must be float32 or float64; got float16"),
        ({"dtype": "single-ish"}, TypeError, "dtype must be float32 or float64; got 'single-ish'"),
        ({"previous": np.ones((2, 3, 3))}, ValueError, "previous must hold rotations.* got 2 of 2"),
        ({"previous": -np.eye(3)}, ValueError, "previous must hold rotations"),
        ({"previous": np.broadcast_to(np.eye(3), (5, 3, 3))}, ValueError, "must broadcast"),
        ({"previous": np.eye(2)}, ValueError, "previous must be a real array"),
    ],
)
def test_a_wrong_argument_is_named(arguments, error, message):
    arguments = {"matrices": np.ones((2, 3, 3)), "tolerance": 1e-3} | arguments
    with pytest.raises(error, match=message):
        recommend(**arguments)


def test_inside_a_program_it_says_that_it_must_be_outside():
    with pytest.raises(TypeError, match=r"matrices must be concrete.*outside jit"):
        jax.jit(lambda a: recommend(a, tolerance=1e-3).apply(a))(np.eye(3))


def test_float64_without_x64_says_how_to_get_it(without_x64):
    with pytest.raises(ValueError, match="jax_enable_x64"):
        recommend(np.eye(3), tolerance=1e-3, dtype="float64")
    assert take_sample(np.eye(3), None, None).dtype == "float32"


@pytest.mark.parametrize(("given", "computed"), [("float16", "float32"), ("int8", "float64"), ("float64", "float64")])
def test_the_dtype_is_that_of_the_other_functions(given, computed):
    assert take_sample(np.eye(3, dtype=given), None, None).dtype == computed
    assert take_sample(np.eye(3, dtype=given), None, jnp.float32).dtype == "float32"

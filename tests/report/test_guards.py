"""The price of every guard, on tiny batches: what breaks is named, and a time is that of the program it names."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import quaternion_rotations

from jaxrot import STEPS, _refine, nearest_rotation
from jaxrot.evaluation.ground_truth import judge
from jaxrot.families import FAMILIES
from jaxrot.report.measure import ablated_method, ablated_steps, ablation_cost
from jaxrot.report.measure.ablation_cost import Guards, Price, Time, compare_times
from jaxrot.report.measure.ablation_starts import FAR, HALF_TURN, NEAR, NEAREST, judge_step, pose
from jaxrot.report.measure.verdict import NOT_FINITE, Broken, Verdict, broken_families, judge_contract, sample_families
from jaxrot.report.plan import GuardsPlan
from jaxrot.report.show.guard_tables import guards_table

TINY = GuardsPlan(batch=1, matrices_a_family=3, starts_a_family=1, budget_s=0.0)
SECONDS = {"": 4.0, "largest column": 3.0, "renormalisation": 4.0, "escape": 8.0}


def told_times(programs, given, budget_s):
    return {name: np.full(5, SECONDS[name]) for name in programs}


@pytest.fixture(scope="module")
def default():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ablated_method, "GUARDS", ("largest column", "renormalisation"))
        patch.setattr(ablation_cost, "time_side_by_side", told_times)
        return {price.guard: price for price in ablation_cost.price_default(TINY, "float32")}


@pytest.fixture(scope="module")
def step():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ablated_steps, "GUARDS", {"torque_exact_angle": ("renormalisation", "escape")})
        patch.setattr(ablation_cost, "time_side_by_side", told_times)
        posed = pose(sample_families(TINY.starts_a_family, "float32"), "float32")
        return {price.guard: price for price in ablation_cost.price_step("torque_exact_angle", posed, TINY)}


def names(price):
    return {entry.family for entry in price.broken}


@pytest.mark.exhaustive
def test_the_default_with_nothing_left_out_breaks_nothing(default):
    assert list(default) == ["", "largest column", "renormalisation"]
    assert default[""].broken == ()
    assert default[""].judged == 3 * (len(FAMILIES) + 1)
    assert default[""].gained == 0


@pytest.mark.exhaustive
def test_without_a_guard_the_families_that_it_is_there_for_break(default):
    price = default["largest column"]
    assert {"planar", "planar_motion"} <= names(price)
    assert not {"rotation", "identity", "zero", NOT_FINITE} & names(price)
    worst = {entry.family: entry.worst for entry in price.broken}
    assert [entry.worst for entry in price.broken] == sorted(worst.values(), reverse=True)
    assert price.outside == sum(entry.matrices for entry in price.broken) > 3
    assert names(default["renormalisation"]) == {"drifted_rotation"}


@pytest.mark.exhaustive
def test_a_ratio_is_that_of_the_times_it_names(default, step):
    # As many are timed as are judged, where those are more than the batch.
    matrices = default["largest column"].judged
    assert default["largest column"].time == Time(3 / matrices * 1e9, 4 / matrices * 1e9, 0.75, 0.75, 0.75)
    # Escape is off by default: what is left out is the default program, what it is compared with has it.
    assert step["escape"].time.ratio == 0.5
    assert step[""].time.ratio == step["renormalisation"].time.ratio == 1


def test_programs_are_timed_side_by_side_and_quartiles_are_of_the_ratios_in_the_same_round():
    time = compare_times(np.array([1.0, 2, 3, 4, 50]), np.array([1.0, 1, 1, 1, 10]))
    assert time == Time(3e9, 1e9, 3, 2, 4)
    slow = jax.jit(lambda a: jnp.sin(jnp.sin(jnp.sin(a))))
    given = jnp.zeros(200_000, jnp.float32)
    seconds = ablation_cost.time_side_by_side({"fast": lambda a: a, "slow": slow}, (given,), 0.0)
    assert len(seconds["fast"]) == len(seconds["slow"]) >= 10
    assert np.median(seconds["fast"]) < np.median(seconds["slow"])


@pytest.mark.exhaustive
def test_without_escape_half_turn_starts_break_and_without_renormalisation_lengths(step):
    assert {"identity", "half_turn", "swap"} <= names(step["escape"])
    assert not {"zero", NOT_FINITE} & names(step["escape"])
    assert step["escape"].judged * 3 == step[""].judged
    broken = {entry.family: entry for entry in step["renormalisation"].broken}
    assert broken["rotation"].promise == "length"
    assert broken["rotation"].worst > 1e3
    assert "zero" not in broken


def test_the_ablated_method_with_all_guards_is_the_librarys_own_program():
    matrix = np.zeros((2, 3, 3), np.float32)
    composed = jax.jit(lambda matrix: ablated_method.solve(jax.lax.optimization_barrier(matrix)))
    own = jax.jit(nearest_rotation)
    assert composed.lower(matrix).as_text().split("{", 1)[1] == own.lower(matrix).as_text().split("{", 1)[1]


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", STEPS)
@pytest.mark.parametrize("escape", [False, True])
def test_a_step_with_all_guards_is_the_librarys_own_program(name, escape):
    matrix, quaternion = np.zeros((2, 3, 3), np.float32), np.ones((2, 4), np.float32)

    def step_once(matrix, quaternion):
        return _refine._iterated(matrix, quaternion, name, 1, escape)

    composed = ablated_steps.one_step(name, () if escape else ("escape",))
    texts = [jax.jit(f).lower(matrix, quaternion).as_text() for f in (composed, step_once)]
    assert texts[0] == texts[1]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("name", "guard"), [(name, guard) for name in STEPS for guard in ablated_steps.GUARDS[name]])
def test_what_is_left_out_is_not_in_the_program(name, guard):
    matrix, quaternion = np.zeros((2, 3, 3), np.float32), np.ones((2, 4), np.float32)
    whole = jax.jit(ablated_steps.one_step(name)).lower(matrix, quaternion).as_text()
    assert jax.jit(ablated_steps.one_step(name, (guard,))).lower(matrix, quaternion).as_text() != whole


def test_starts_are_as_far_off_as_they_say():
    posed = pose({"gaussian": FAMILIES["gaussian"].sample(4, dtype=np.float64).matrices}, "float64")
    nearest = np.asarray(posed.judged.solution.rotation, float)
    np.testing.assert_allclose(np.linalg.norm(posed.starts, axis=1), 1)
    cosine = (np.einsum("nij,nij->n", nearest, quaternion_rotations(posed.starts.T)) - 1) / 2
    for kind, expected in ((NEAR, 45), (FAR, 135), (NEAREST, 0), (HALF_TURN, 180)):
        np.testing.assert_allclose(cosine[posed.kind == kind], np.cos(np.radians(expected)), atol=1e-14)
        assert (posed.kind == kind).sum() == 4


def test_a_step_that_does_nothing_keeps_the_nearest_start_and_one_that_turns_does_not():
    sets = {name: FAMILIES[name].sample(2, dtype=np.float64).matrices for name in ("rank_one", "gaussian")}
    posed = pose(sets, "float64")
    at_nearest = posed.kind == NEAREST
    stays = judge_step(lambda m, q: q, lambda m, q: q, iterations=3, posed=posed, batch=20)
    assert stays.is_kept[at_nearest].all()
    assert (stays.over_bound["rotation"][~at_nearest & (np.arange(16) >= 8)] > 1).all()
    assert stays.over_bound["length"].max() < 1
    longer = judge_step(lambda m, q: 2 * q, lambda m, q: q, iterations=3, posed=posed, batch=20)
    assert (longer.over_bound["length"] > 1e6).all()

    def turned(matrix, q):
        """To the start's negative first component: another rotation altogether."""
        return q * jnp.array([[-1.0, 1, 1, 1]])

    moved = judge_step(turned, lambda m, q: q, iterations=3, posed=posed, batch=20)
    is_rank_one = np.arange(16) < 8
    assert (moved.over_bound["kept"][at_nearest & is_rank_one] > 1).all()
    assert (moved.over_bound["kept"][~(at_nearest & is_rank_one)] == 0).all()


def test_results_that_are_no_rotations_are_judged_by_the_promise_they_break():
    finite = FAMILIES["gaussian"].sample(3, dtype=np.float64).matrices
    changed = np.full((1, 3, 3), np.inf)
    judged = judge({"finite": finite, NOT_FINITE: changed}, "float64")
    given = np.array(judged.solution.rotation, float)
    given[1] = np.nan
    given[2] *= 1.5
    given[3] = np.eye(3)
    verdict = judge_contract(given, judged)
    assert verdict.is_kept.tolist() == [True, False, False, False]
    assert verdict.is_finite.tolist() == [True, False, True, True]
    assert verdict.worst[1] == np.inf
    assert 1e10 < verdict.over_bound["orthogonality"][2] < np.inf
    assert verdict.over_bound["NaN"].tolist() == [0, 0, 0, np.inf]


def test_a_family_breaks_where_a_matrix_was_kept_before_and_counts():
    without = Verdict({"trace": np.array([2.0, 9, 9, 0, 3]), "length": np.array([0.0, 0, 0, 0, 5])}, np.ones(5, bool))
    sets = {"first": slice(0, 3), "second": slice(3, 5)}
    kept, counted = np.array([True, False, True, True, True]), np.array([True, True, False, True, True])
    broken = broken_families(sets, kept, without, counted)
    assert broken == (Broken("second", 1, 0, 5.0, "length"), Broken("first", 1, 0, 2.0, "trace"))


def priced(guard, dtype="float32", time=None, broken=(), of="torque", gained=0):
    return Price(of, guard, dtype, time or Time(12.0, 10.0, 1.2, 1.1, 1.3), 100, tuple(broken), gained)


@pytest.mark.parametrize(
    ("quartiles", "words"),
    [((1.1, 1.3), "1.2 (1.1-1.3)"), ((0.9, 1.1), "within the spread (0.9-1.1)"), ((0.7, 0.99), "1.2 (0.7-0.99)")],
)
def test_a_difference_is_stated_where_the_quartiles_are_on_one_side(quartiles, words):
    table = guards_table([priced("scale", time=Time(12.0, 10.0, 1.2, *quartiles))], "title")
    assert table.rows[0][1] == words


def test_the_table_names_the_steps_the_worst_families_of_both_dtypes_and_how_far_they_are_off():
    many = [Broken(f"family_{i}", 2, 1, 100.0 - i, "trace") for i in range(7)]
    prices = [priced(""), priced("scale", broken=many), priced("", "float64")]
    prices.append(priced("scale", "float64", broken=[Broken("family_6", 1500, 1, float("inf"), "rotation")], gained=3))
    table = guards_table(prices, "title")
    assert table.header[:2] == ["left out", "time over that with it, float32 / float64: median (quartiles)"]
    nothing, scale = table.rows
    assert nothing[:2] == ["nothing", "12 / 12 ns per matrix"]
    assert scale[2:6] == ["14 / 1,500", "7 / 1", "0 / 3", "100 trace / ∞ rotation"]
    assert scale[6].startswith("`family_6` ∞, `family_0` 100, `family_1` 99")
    assert scale[6].endswith("`family_4` 96 and 1 more")
    table = guards_table([priced("scale"), priced("scale", of="newton")], "title")
    assert table.header[:2] == ["step", "left out"]
    assert [row[:2] for row in table.rows] == [["torque", "scale"], ["newton", "scale"]]


def test_the_default_and_every_step_are_priced_in_both_dtypes(monkeypatch):
    monkeypatch.setattr(ablation_cost, "price_default", lambda size, dtype: [dtype])
    monkeypatch.setattr(ablation_cost, "price_step", lambda step, posed, size: [step])
    monkeypatch.setattr(ablation_cost, "pose", lambda sets, dtype: None)
    measured = ablation_cost.measure_guards(GuardsPlan(starts_a_family=1), ("float32", "float64"))
    assert measured == Guards(["float32", "float64"], [*STEPS, *STEPS])


@pytest.mark.exhaustive
def test_every_guard_of_every_step_is_priced_and_the_rest_of_the_default_breaks_what_it_is_there_for():
    small = TINY._replace(batch=64, matrices_a_family=12, starts_a_family=6)
    prices = {price.guard: price for price in ablation_cost.price_default(small, "float64")}
    assert {"scale_large", "scale_huge"} <= names(prices["scale"])
    assert {"signed_permutation", "sparse_inverted"} <= names(prices["nearer reflection"])
    assert {"planar", "planar_motion"} <= names(prices["largest column"])
    assert names(prices["rotations as they are"]) == set()
    posed = pose(sample_families(small.starts_a_family, "float64"), "float64")
    for name in STEPS:
        priced = {price.guard: price for price in ablation_cost.price_step(name, posed, small)}
        assert set(priced) == {"", *ablated_steps.GUARDS[name]}
        assert "scale_huge" in names(priced["scale"])
        assert priced["escape"].outside > 20
        assert all(price.time.ratio > 0 for price in priced.values())

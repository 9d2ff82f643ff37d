import numpy as np
import pytest

from jaxrot.evaluation import gradient_reference, reference
from jaxrot.evaluation.ground_truth import judge
from jaxrot.report import peers
from jaxrot.report.inputs import WHOLE
from jaxrot.report.measure import peer_comparison
from jaxrot.report.measure.peer_comparison import ComparedMethod, compare_with_peers
from jaxrot.report.peers.peer import Peer, Source, UnavailableError, make_peer
from jaxrot.report.show.comparison_tables import peers_table, sources_table, verdicts

MATRICES = np.random.default_rng(0).standard_normal((40, 3, 3))


def right(matrices):
    return reference.reference_rotation(matrices).astype(matrices.dtype)


def right_gradient(matrices, bar):
    return right(matrices), gradient_reference.pullback(matrices, bar).astype(matrices.dtype)


def fake(value=right, pullback=right_gradient):
    """A peer in NumPy."""
    return Source("fake", (), lambda dtype: Peer(np.array, value, pullback, np.asarray, 3, "float64"))


def candidate(peer, batch):
    return peer_comparison._Candidate(name="peer", description="", peer=peer, batch=batch)


def absent(dtype):
    raise UnavailableError("no such device")


def without_first(matrices):
    rotations = right(matrices)
    rotations[0] = np.nan
    return rotations


def nan_gradient(matrices, bar):
    return right(matrices), np.full_like(bar, np.nan)


@pytest.fixture(scope="module")
def measured():
    """One run with peers that are right, refuse a matrix, have no number for a gradient, and are not there."""
    fakes = {
        "right": fake(),
        "refuses": fake(value=without_first, pullback=None),
        "NaN": fake(pullback=nan_gradient),
        "absent": Source("absent", (), absent),
        "not installed": Source("", ("no_such_package",), absent),
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(peer_comparison, "PEERS", fakes)
        judged = {
            "input": judge({"own": MATRICES}, "float32", whole=WHOLE),
            "families": judge({"easy": MATRICES[:4]}, "float32"),
        }
        return compare_with_peers(["singular_pair"], judged, batch=16, budget_s=0.0)


def of(measured, name) -> ComparedMethod:
    (contender,) = [contender for contender in measured.contenders if contender.name == name]
    return contender


def test_jaxrot_and_its_peers_are_judged_alike(measured):
    for name, digits in (("right", 1e-7), ("singular_pair", 1e-6), ("singular_pair in float64", 1e-7)):
        contender = of(measured, name)
        assert 0 < contender.error.largest < 3 * digits
        assert 0 < contender.gradient_error.percentile_99 < 300 * digits
        assert contender.outside == contender.no_result == contender.gradient_no_number == 0
        assert contender.gradient_time.median > 0
        assert 0 < contender.time.quartile_1 <= contender.time.median <= contender.time.quartile_3
    assert of(measured, "singular_pair").is_own
    assert not of(measured, "right").is_own
    assert (of(measured, "right").threads, of(measured, "right").computes_in) == (3, "float64")


def test_what_is_refused_or_no_number_is_counted_and_infinitely_wrong(measured):
    # The first of every call of 16.
    refuses = of(measured, "refuses")
    assert refuses.no_result == refuses.outside == 3
    assert refuses.error.largest == np.inf
    assert refuses.error.median < 1e-6
    assert refuses.gradient_time is None
    contender = of(measured, "NaN")
    assert contender.gradient_no_number == 40
    assert contender.gradient_error.median == np.inf
    assert contender.families_no_number == ("easy",)
    assert of(measured, "right").families_no_number == ()


def test_the_tables_name_everybody_and_the_skipped_have_a_reason(measured):
    table = peers_table(measured.contenders, "float32")
    assert {row[0] for row in table.rows} == {"singular_pair", "singular_pair in float64", "right", "refuses", "NaN"}
    assert [row[0].startswith("singular_pair") for row in table.rows] == [True, True, False, False, False]
    assert all(len(row) == len(table.header) for row in table.rows)
    assert len(sources_table(measured.contenders).rows) == 5
    assert measured.skipped == [
        "absent is skipped: no such device.",
        "not installed is skipped: no_such_package not installed.",
    ]


def test_a_peer_beyond_the_front_is_said(measured):
    right = of(measured, "right")
    better = right._replace(name="better", error=right.error._replace(percentile_99=0.0))
    assert any("better in float32 is beyond" in words for words in verdicts([*measured.contenders, better]))


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", peers.PEERS)
def test_every_peer_that_is_here_finds_the_nearest_rotation(name):
    for dtype in ("float32", "float64"):
        try:
            peer = make_peer(peers.PEERS[name], dtype)
        except UnavailableError:
            continue
        matrices = (MATRICES * np.sign(np.linalg.det(MATRICES))[:, None, None]).astype(dtype)
        rotation = peer.unload(peer.value(peer.load(matrices)))
        assert rotation.shape == (40, 3, 3)
        error = reference.forward_error(rotation, matrices)
        assert np.median(error) < 1e-3 if "torque" in name else np.max(error) < 1e-2
        if peer.pullback is not None:
            bar = np.random.default_rng(1).standard_normal((40, 3, 3)).astype(dtype)
            gradient = peer.unload(peer.pullback(peer.load(matrices), peer.load(bar))[1])
            expected = gradient_reference.pullback(matrices, bar)
            relative = np.linalg.norm(gradient - expected, axis=(1, 2)) / np.linalg.norm(expected, axis=(1, 2))
            assert np.median(relative.astype(float)) < 0.3


def test_scipy_refuses_reflections_alone_and_what_takes_nothing_has_no_time():
    inverted = -np.eye(3) * np.ones((5, 1, 1))
    own = judge({"own": inverted}, "float64", whole=WHOLE)
    judged = {"input": own, "families": judge({"easy": inverted}, "float64")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(peer_comparison, "PEERS", {"SciPy from_matrix": peers.PEERS["SciPy from_matrix"]})
        measured = compare_with_peers([], judged, batch=2, budget_s=0.0)
    (contender,) = measured.contenders
    assert (contender.time, contender.no_result) == (None, 5)
    assert peers_table(measured.contenders, "float64").rows[0][7] == "-"
    peer = make_peer(peers.PEERS["SciPy from_matrix"], "float64")
    rotation = peer.unload(peer.value(peer.load(MATRICES)))
    np.testing.assert_array_equal(np.isnan(rotation[:, 0, 0]), np.linalg.det(MATRICES) <= 0)


def test_a_peer_is_timed_on_what_it_takes(monkeypatch):
    seen = []
    fast = Peer(lambda a: a, lambda a: seen.append(a) or a, None, np.asarray, 1, "float64", lambda a: a[:, 0, 0] > 0)
    peer_comparison._calls(candidate(fast, 7), MATRICES)["peer", False]()
    assert len(seen[0]) == 7
    assert (seen[0][:, 0, 0] > 0).all()


@pytest.mark.parametrize("rest", [MATRICES, MATRICES[:0]], ids=["some", "all"])
def test_a_nan_is_nobodys_fault(rest):
    peer = peers.PEERS["SciPy align_vectors"].make("float64")
    matrices = np.concatenate([rest, np.full((3, 3, 3), np.nan)])
    judged = {"input": judge({"own": matrices}, "float64", whole=WHOLE), "families": judge({"a": matrices}, "float64")}
    contender = peer_comparison._judge(candidate(peer, 2), judged)
    assert contender.no_result == contender.outside == 0
    assert (contender.error is None) == (len(rest) == 0)
    assert bool(peer_comparison._calls(candidate(peer, 7), matrices)) == (len(rest) > 0)

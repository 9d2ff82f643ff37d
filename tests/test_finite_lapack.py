"""LAPACK may never return from a matrix with an infinity: outside the solvers none gets there, whatever is given."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrot
from jaxrot import families
from jaxrot.__main__ import main
from jaxrot._recommend import candidates
from jaxrot._recommend import recommend as recommend_module
from jaxrot.evaluation.ground_truth import judge
from jaxrot.report.inputs import read_input
from jaxrot.report.measure import peer_comparison
from jaxrot.report.peers import PEERS, jax_linalg
from jaxrot.scenes import body, drop, tetrahedra, tetrahedron

MATRICES = np.random.default_rng(0).standard_normal((9, 3, 3)).astype(np.float32)
NOT_FINITE = families.with_non_finite(MATRICES)
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


@pytest.fixture(autouse=True)
def no_infinity(monkeypatch):
    """LAPACK, by NumPy and by JAX, with an assertion in front of it."""
    for name in ("svd", "eigh", "eig", "eigvalsh", "det", "slogdet", "inv", "solve", "cond", "qr", "cholesky", "pinv"):
        monkeypatch.setattr(np.linalg, name, _checking(getattr(np.linalg, name)))
    met = []
    for name in ("svd", "eigh"):
        monkeypatch.setattr(jnp.linalg, name, _noting(getattr(jnp.linalg, name), met))
    yield
    jax.effects_barrier()
    assert all(met)


def _checking(function):
    def checked(array, *rest, **options):
        assert np.isfinite(array).all(), f"{function.__name__} of a matrix that is not finite"
        return function(array, *rest, **options)

    return checked


def _noting(function, met):
    def noted(array, **options):
        jax.debug.callback(lambda is_finite: met.append(bool(is_finite)), jnp.isfinite(array).all())
        return function(array, **options)

    return noted


def test_the_assertion_fires():
    with pytest.raises(AssertionError, match="svd of a matrix that is not finite"):
        np.linalg.svd(NOT_FINITE)


@pytest.fixture
def one_method(monkeypatch):
    # `svd` and `davenport` call LAPACK too; their guard is the solvers' own.
    monkeypatch.setattr(recommend_module, "METHODS", {jaxrot.DEFAULT_METHOD: jaxrot.METHODS[jaxrot.DEFAULT_METHOD]})
    monkeypatch.setattr(candidates, "TIMING_BUDGET_S", 0.02)


def test_recommend_leaves_out_what_is_not_finite(one_method, monkeypatch):
    monkeypatch.setattr(recommend_module, "STEPS", {})
    starts = families.with_non_finite(np.broadcast_to(np.eye(3, dtype=np.float32), (9, 3, 3)), seed=1)
    starts = np.roll(starts, 1, axis=0)
    found = jaxrot.recommend(NOT_FINITE, tolerance=1e-3, previous=starts)
    assert found.not_finite == 6


def test_recommend_leaves_out_what_overflows(one_method, tmp_path, capsys):
    matrices = MATRICES.astype(np.float64)
    matrices[4] *= 1e300
    np.save(tmp_path / "own.npy", matrices)
    assert main(["recommend", str(tmp_path / "own.npy"), "--tolerance", "1e-3", "--dtype", "float32"]) == 0
    assert "on 8 matrices in float32" in " ".join(capsys.readouterr().out.split())


def test_peers_get_nothing_that_is_not_finite(tmp_path, monkeypatch):
    names = ("jnp.linalg.svd", "jnp.linalg.eigh", "SciPy from_matrix", "SciPy align_vectors")
    monkeypatch.setattr(peer_comparison, "PEERS", {name: PEERS[name] for name in names})
    monkeypatch.setattr(
        peer_comparison, "interleave", lambda calls, **options: ({name: [call()] for name, call in calls.items()}, {})
    )
    monkeypatch.setattr(peer_comparison, "spread", lambda seconds, batch: None)
    np.save(tmp_path / "own.npy", NOT_FINITE)
    huge = families.FAMILIES["scale_huge"].sample(8).matrices
    judged = {
        "input": judge(read_input(tmp_path / "own.npy").sets, "float32"),
        "families": judge({"scale_huge": huge}, "float32"),
    }
    found = peer_comparison.compare_with_peers([], judged, batch=8, budget_s=0.0)
    assert [entry.name for entry in found.contenders if not entry.is_own] == list(names)
    assert {entry.name for entry in found.contenders if entry.families_no_number} >= {"jnp.linalg.eigh"}


def test_davenports_matrix_may_overflow(dtype):
    largest = float(np.finfo(dtype).max)
    matrices = np.stack([np.eye(3), 0.9 * largest * np.eye(3)]).astype(dtype)
    peer = jax_linalg.eigh(dtype)
    np.testing.assert_allclose(peer.value(jnp.asarray(matrices))[0], np.eye(3), atol=1e-6)
    assert np.isnan(peer.value(jnp.asarray(matrices))[1]).all()
    assert peer.pullback is not None
    gradient = peer.pullback(jnp.asarray(matrices), jnp.ones_like(matrices))[1]
    assert np.isnan(gradient[1]).any(), "counted as a failure of the peer's"


def test_a_family_of_the_callers_may_hold_anything():
    family = families.Family("own", "with NaN and infinities", lambda draw: families.with_non_finite(draw.gaussian()))
    sample = family.sample(9, dtype=np.float64)
    is_finite = np.isfinite(sample.matrices).all(axis=(1, 2))
    assert is_finite.sum() == 6
    np.testing.assert_array_equal(np.isfinite(sample.singular_values).all(axis=1), is_finite)


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1.7e308"])
def test_a_mesh_that_is_not_finite_or_overflows_is_refused(word, tmp_path, capsys):
    vertices = CORNERS.tolist()
    vertices[1][0], vertices[2][0] = word, f"-{word}".replace("--", "")
    lines = [f"v {' '.join(map(str, vertex))}" for vertex in vertices] + ["f 1 2 3", "f 1 2 4"]
    (tmp_path / "own.obj").write_text("\n".join(lines))
    assert main(["simulate", "dragon", "--mesh", str(tmp_path / "own.obj"), "--out", str(tmp_path / "out")]) == 2
    assert "vertices must be" in capsys.readouterr().err


@pytest.mark.parametrize("scale", [np.nan, np.inf, 1.7e308])
def test_scenes_refuse_vertices_that_are_not_finite_or_overflow_and_take_large_ones(scale):
    vertices = CORNERS.copy()
    vertices[1:3, 0] = scale, -scale
    with pytest.raises(ValueError, match=r"finite|at most 1e\+100"):
        tetrahedra.checked(vertices, np.array([[0, 1, 2, 3]]))
    with pytest.raises(ValueError, match=r"finite|at most 1e\+100"):
        tetrahedron.build(vertices, np.zeros((1, 3)))
    with pytest.raises(ValueError, match=r"finite|at most 1e\+100"):
        body.checked_vertices(vertices)
    with pytest.raises(ValueError, match=r"finite|at most 1e\+100"):
        drop.drop(vertices)
    mesh = tetrahedra.checked(1e90 * CORNERS, np.array([[0, 1, 2, 3]]))
    np.testing.assert_allclose(tetrahedra.volumes(mesh), 1e270 / 6)

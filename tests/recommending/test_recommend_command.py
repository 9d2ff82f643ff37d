import jax
import numpy as np
import pytest
from commands import refused

import jaxrot
from jaxrot import DEFAULT_METHOD, METHODS
from jaxrot.__main__ import main
from jaxrot._recommend import candidates
from jaxrot._recommend import recommend as recommend_module
from jaxrot.families import FAMILIES


@pytest.fixture(autouse=True)
def few_methods(monkeypatch):
    """Compiling is what takes time: three methods, one of which inverted matrices leave out."""
    methods = {name: METHODS[name] for name in (DEFAULT_METHOD, "taylor", "svd")}
    monkeypatch.setattr(recommend_module, "METHODS", methods)
    monkeypatch.setattr(candidates, "TIMING_BUDGET_S", 0.05)


@pytest.fixture
def inverted(tmp_path):
    matrices = np.random.default_rng(0).standard_normal((4, 5, 3, 3)).astype(np.float32)
    np.save(tmp_path / "inverted.npy", matrices)
    return matrices


def test_it_prints_the_choice_and_the_rest(tmp_path, inverted, capsys):
    before = jax.config.jax_enable_x64
    assert main(["recommend", str(tmp_path / "inverted.npy"), "--tolerance", "1e-4"]) == 0
    assert jax.config.jax_enable_x64 == before
    shown = capsys.readouterr()
    assert shown.err == ""
    out = " ".join(shown.out.split())
    assert f"{DEFAULT_METHOD} is the cheapest that meets the tolerance 1.0e-4 on 20 matrices in float32" in out
    assert f'jaxrot.nearest_rotation(matrix, method="{DEFAULT_METHOD}")' in out
    assert "cores usable" in out
    table = {line.split("  ")[0]: line for line in shown.out.splitlines()}
    assert table[DEFAULT_METHOD].endswith("recommended")
    assert "of 20 have det A < 0" in table["taylor"]
    assert max(map(len, shown.out.splitlines())) <= 100


def test_previous_rotations_are_read_by_name(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(recommend_module, "STEPS", {"newton": jaxrot.STEPS["newton"]})
    monkeypatch.setattr(candidates, "time_methods", _steps_first)
    rotations = FAMILIES["rotation"].sample(6, dtype=np.float32).matrices
    matrices = rotations @ np.diag([1, 0.5, -0.2]).astype(np.float32)
    np.savez(tmp_path / "now.npz", a=matrices[:4], b=matrices[4:])
    np.savez(tmp_path / "last.npz", b=rotations[4:], a=rotations[:4])
    words = ["recommend", tmp_path / "now.npz", "--tolerance", "1e-3", "--previous", tmp_path / "last.npz"]
    assert main([str(word) for word in words]) == 0
    out = capsys.readouterr().out
    # The starts are the solution, if each is with its matrix.
    assert out.startswith("newton (1 iteration) is the cheapest")
    assert 'jaxrot.refine_rotation(matrix, rotation, step="newton", iterations=1)' in out


def _steps_first(compiled, matrices, batch, **options):
    timings = jaxrot.evaluation.timing.time_methods(compiled, matrices, batch, **options)
    return [
        entry._replace(median_ns=1, quartile_1_ns=1, quartile_3_ns=1) if "(" in entry.method else entry
        for entry in timings
    ]


@pytest.mark.parametrize("given", ["float16", "float32", "float64", "int8", "bool"])
def test_the_dtype_is_the_files(given, tmp_path, capsys):
    np.save(tmp_path / "own.npy", np.eye(3).astype(given))
    assert main(["recommend", str(tmp_path / "own.npy"), "--tolerance", "0.01"]) == 0
    computed = "float64" if given == "float64" else "float32"
    assert f"on 1 matrix in {computed}" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["{good}"], "required: --tolerance"),
        (["--tolerance", "1e-3"], "required: FILE"),
        (["{good}", "--tolerance", "small"], "--tolerance small: expected a number > 0"),
        (["{good}", "--tolerance", "0"], "--tolerance 0: expected a number > 0"),
        (["{good}", "--tolerance=-1e-3"], "expected a number > 0"),
        (["{good}", "--tolerance", "inf"], "expected a number > 0"),
        (["{good}", "--tolerance", "1e-3", "--dtype", "float16"], "--dtype float16: expected one of float32, float64"),
        (["{folder}/none.npy", "--tolerance", "1e-3"], "FILE {folder}/none.npy: no such file; expected a .npy or .npz"),
        (["{folder}/flat.npy", "--tolerance", "1e-3"], "FILE {folder}/flat.npy: shape (3, 5); expected"),
        (["{folder}/nan.npy", "--tolerance", "1e-3"], "must hold a finite one"),
        (["{good}", "--tolerance", "1e-3", "--previous", "{folder}/none.npy"], "--previous {folder}/none.npy: no such"),
        (["{good}", "--tolerance", "1e-3", "--previous", "{folder}/nan.npy"], "nan.npy: 2 rotations; expected 20"),
        (["{good}", "--tolerance", "1e-3", "--previous", "{good}"], "previous must hold rotations"),
        (["{good}", "--tolerance", "1e-3", "--previous", "{folder}/ab.npz"], "it holds a, b; expected arrays called"),
        (["{good}", "--tolerance", "1e-3", "--input", "x"], "unrecognized arguments"),
    ],
)
def test_a_mistake_is_refused_in_one_line(words, expected, tmp_path, inverted, capsys, monkeypatch):
    monkeypatch.setattr(candidates, "compile_method", lambda *arguments, **options: pytest.fail("measured"))
    np.save(tmp_path / "flat.npy", np.ones((3, 5)))
    np.save(tmp_path / "nan.npy", np.full((2, 3, 3), np.nan))
    np.savez(tmp_path / "ab.npz", a=np.eye(3), b=np.eye(3))
    places = {"good": tmp_path / "inverted.npy", "folder": tmp_path}
    assert expected.format(**places) in refused(["recommend", *(word.format(**places) for word in words)], capsys)

"""What the command refuses: in one line, with status 2, and before it writes anything."""

import sys

import numpy as np
import pytest
from commands import measure_nothing, refused

from jaxrot.report import command


def _save(array):
    def save(path):
        with path.open("wb") as file:
            np.save(file, array)

    return save


def _save_archive(**arrays):
    def save(path):
        with path.open("wb") as file:
            np.savez(file, **arrays)

    return save


def _save_torn_archive(path):
    _save_archive(a=np.ones((100, 3, 3)))(path)
    path.write_bytes(path.read_bytes()[:-100])


BAD_FILES = {
    "missing": (lambda path: None, "no such file"),
    "folder": (lambda path: path.mkdir(), "not a file"),
    "text": (lambda path: path.write_text("1 2 3\n"), "cannot be read"),
    "empty_file": (lambda path: path.touch(), "cannot be read"),
    "wrong_shape": (_save(np.ones((3, 4))), "shape (3, 4)"),
    "trailing_batch": (_save(np.ones((3, 3, 7))), "shape (3, 3, 7)"),
    "scalar": (_save(np.float64(1)), "shape ()"),
    "complex": (_save(np.ones((3, 3), complex)), "complex128"),
    "words": (_save(np.full((3, 3), "a")), "<U1"),
    "dates": (_save(np.full((3, 3), "2020-01-01", "datetime64[D]")), "datetime64"),
    "objects": (_save(np.array([[{}]], dtype=object)), "Python objects"),
    "empty": (_save(np.ones((0, 3, 3))), "empty"),
    "archive_without": (_save_archive(a=np.ones(3), b=np.ones((2, 2))), "no array of shape (..., 3, 3)"),
    "archive_of_nothing": (_save_archive(), "no array of shape (..., 3, 3)"),
    "torn_archive": (_save_torn_archive, "cannot be read"),
}


@pytest.mark.parametrize("kind", BAD_FILES)
def test_a_bad_file_is_refused_in_one_line(kind, tmp_path, capsys):
    save, expected = BAD_FILES[kind]
    save(tmp_path / "bad.npy")
    text = refused(["report", "--input", tmp_path / "bad.npy", "--out", tmp_path / "out"], capsys)
    assert expected in text
    assert "expected a .npy or .npz file with a real array of shape (..., 3, 3)" in text
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--methods", "svd,svdd"], "unknown 'svdd'; expected some of singular_pair,"),
        (["--methods", ""], "unknown ''"),
        (["--dtype", "float16"], "expected one of float32, float64, both"),
        *((["--batch", word], "expected whole numbers from 1") for word in ("10,x", "0", "-5", "100000000000", "")),
        (["--compare", "missing.json"], "missing.json: cannot be read (no such file or directory)"),
        (["--no-such-option"], "unrecognized arguments: --no-such-option"),
        (["--methods"], "expected one argument"),
    ],
)
def test_a_bad_option_is_refused_in_one_line(words, expected, tmp_path, capsys):
    assert expected in refused(["report", "--out", tmp_path / "out", *words], capsys)
    assert list(tmp_path.iterdir()) == []
    assert "required: COMMAND" in refused([], capsys)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("{", "this is no JSON"), ("[1]", "holds no report"), ('{"timing": []}', "holds no report"), ("\xff", "no text")],
)
def test_a_file_that_is_no_report_is_not_compared_with(text, expected, tmp_path, capsys):
    (tmp_path / "old.json").write_bytes(text.encode("latin-1"))
    words = ["report", "--compare", tmp_path / "old.json", "--out", tmp_path / "out"]
    assert expected in refused(words, capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("place", ["file", "file/below", "file/far/below"])
def test_a_file_in_the_way_of_out_isrefused(place, tmp_path, capsys):
    (tmp_path / "file").write_text("precious")
    text = refused(["report", "--out", tmp_path / place], capsys)
    assert "expected a folder, or a name for a new one" in text
    assert (tmp_path / "file").read_text() == "precious"


def test_an_unwritable_out_is_refused_before_anything_is_measured(tmp_path, capsys, monkeypatch):
    def refuse(*arguments, **options):
        raise PermissionError(13, "Permission denied")

    # Permission bits do not stop an administrator, and the tests may be run by one.
    monkeypatch.setattr("jaxrot.console.output.tempfile.TemporaryFile", refuse)
    monkeypatch.setattr(command, "measure", lambda *arguments: pytest.fail("measured"))
    assert "permission denied" in refused(["report", "--out", tmp_path / "out"], capsys)


def test_nothing_is_half_written(tmp_path, capsys, monkeypatch):
    measure_nothing(monkeypatch)

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("jaxrot.console.output.Path.rename", fail)
    text = refused(["report", "--out", tmp_path / "out", "--methods", "svd"], capsys)
    assert "no space left on device" in text
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("is_terminal", [False, True])
def test_a_missing_extra_is_named_with_what_brings_it(is_terminal, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("jaxrot.console.progress.importlib.util.find_spec", lambda name: None)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal)
    text = refused(["report", "--out", tmp_path / "out"], capsys)
    assert "pip install 'jaxrot[report]'" in text
    assert ("tqdm" in text) == is_terminal

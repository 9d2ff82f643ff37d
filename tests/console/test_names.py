"""Names of the user's: those with a newline in them, which stay in one line, and empty ones, which are refused."""

import os

import numpy as np
import pytest
from commands import refused

from jaxrot.console.errors import UserError, one_line, shown


@pytest.mark.parametrize("character", ["\n", "\r", "\t", "\x1b", "\x85", "\u2028", "\u202e", "\udcff"])
def test_what_does_not_print_is_shown_by_an_escape(character):
    for text in (shown(f"a{character}b"), one_line(f"a{character}b"), str(UserError(f"a{character}b"))):
        assert text.isprintable()
        assert "a\\" in text


def test_other_names_are_shown_as_they_are():
    assert shown("κ of my matrices.npy") == "κ of my matrices.npy"
    assert shown("") == "''"


@pytest.mark.parametrize(
    "words",
    [
        ["a\nb"],
        ["report", "--input", "a\nb.npy"],
        ["report", "--input", "d\nir"],
        ["report", "--input", "text\n.npy"],
        ["report", "--input", "shape\n.npy"],
        ["report", "--input", "shape\n.npz"],
        ["report", "--compare", "a\nb.json"],
        ["report", "--compare", "text\n.npy"],
        ["report", "--compare", "own\n.npy"],
        ["report", "--out", "text\n.npy"],
        ["report", "--out", "text\n.npy/below"],
        ["report", "--methods", "a\nb"],
        ["report", "--dtype", "a\nb"],
        ["report", "--batch", "a\nb"],
        ["report", "--batch", "0\n"],
        ["report", "a\nb"],
        ["report", "--a\nb"],
        ["recommend", "a\nb.npy", "--tolerance", "1"],
        ["recommend", "own\n.npy", "--tolerance", "1\n2"],
        ["recommend", "own\n.npy", "--tolerance", "1", "--dtype", "a\nb"],
        ["recommend", "own\n.npy", "--tolerance", "1", "--previous", "a\nb"],
        ["recommend", "own\n.npy", "--tolerance", "1", "--previous", "two\n.npy"],
        ["recommend", "names\n.npz", "--tolerance", "1", "--previous", "own\n.npy"],
        ["simulate", "a\nb"],
        ["simulate", "drift", "--steps", "a\nb"],
        ["simulate", "drift", "--mesh", "a\nb"],
        ["simulate", "drift", "--out", "text\n.npy"],
        ["simulate", "dragon", "--mesh", "a\nb.obj"],
        ["simulate", "dragon", "--mesh", "text\n.npy"],
    ],
    ids=lambda words: " ".join(words),
)
def test_a_newline_in_a_name_does_not_break_the_line(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    os.mkdir("d\nir")
    with open("text\n.npy", "w", encoding="utf-8") as file:
        file.write("text")
    np.save("own\n.npy", np.ones((1, 3, 3)))
    np.save("two\n.npy", np.ones((2, 3, 3)))
    np.save("shape\n.npy", np.ones(3))
    np.savez("shape\n.npz", **{"a\nb": np.ones(3)})
    np.savez("names\n.npz", **{"a\nb": np.ones((1, 3, 3)), "c": np.ones((1, 3, 3))})
    before = sorted(os.listdir())
    assert "\\n" in refused(words, capsys)
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize(
    "words",
    [
        ["report", "--out"],
        ["report", "--bench", "--out"],
        ["report", "--input"],
        ["report", "--compare"],
        ["recommend", "own.npy", "--tolerance", "1", "--previous"],
        ["recommend", "--tolerance", "1"],
        ["simulate", "drift", "--out"],
        ["simulate", "dragon", "--mesh"],
    ],
    ids=lambda words: " ".join(words),
)
def test_an_empty_name_is_not_the_current_folder(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = refused([*words, ""], capsys)
    assert "the name is empty" in text
    assert (words[-1] if words[-1].startswith("--") else "FILE") in text
    assert os.listdir() == []


@pytest.mark.parametrize("option", ["--dtype", "--methods", "--batch"])
def test_an_empty_word_is_not_the_default(option, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert f"{option} ''" in refused(["report", option, ""], capsys)
    assert "goes without" in refused(["report", "--bench", option, ""], capsys)

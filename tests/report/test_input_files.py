"""The files that `report` and `recommend` read: layouts, dtypes, and names."""

import numpy as np
import pytest

from jaxrot.console.errors import UserError
from jaxrot.report.inputs import read_input

MATRICES = np.random.default_rng(0).standard_normal((5, 3, 3)).astype(np.float32)


def _refusal(array, tmp_path):
    np.save(tmp_path / "own.npy", array)
    with pytest.raises(UserError) as error:
        read_input(tmp_path / "own.npy")
    assert str(error.value).isprintable(), "one line"
    return str(error.value)


@pytest.mark.parametrize(
    ("shape", "code"),
    [
        ((5, 4, 4), "array[..., :3, :3]"),
        ((5, 9), "array.reshape(-1, 3, 3)"),
        ((5, 12), "array.reshape(-1, 3, 4)[..., :3]"),
        ((3, 3, 5), "numpy.moveaxis(array, -1, 0)"),
    ],
)
def test_another_layout_is_refused_with_the_code_that_converts_it(shape, code, tmp_path):
    text = _refusal(np.ones(shape), tmp_path)
    assert f"shape {shape}; if " in text
    assert f"use {code}; expected a .npy" in text


def test_an_archive_says_so_for_every_array_and_objects_are_left_out(tmp_path):
    np.savez(tmp_path / "own.npz", poses=np.ones((5, 4, 4)), rows=np.ones((5, 9)))
    with pytest.raises(UserError, match=r"poses \(shape .*:3, :3\]\), rows \(shape .*reshape\(-1, 3, 3\)\)"):
        read_input(tmp_path / "own.npz")
    np.savez(tmp_path / "own.npz", names=np.array([{}], dtype=object), own=MATRICES)
    read = read_input(tmp_path / "own.npz")
    assert list(read.sets) == ["own"]
    assert "names (dtype object" in read.remarks[0]


def test_three_matrices_are_not_taken_for_a_trailing_batch(tmp_path):
    np.save(tmp_path / "own.npy", MATRICES[:3])
    np.testing.assert_array_equal(read_input(tmp_path / "own.npy").sets["own"], MATRICES[:3])


@pytest.mark.parametrize("dtype", [">f2", ">f4", ">f8", ">i4", "<f4"])
def test_the_byte_order_does_not_matter(dtype, tmp_path):
    given = (4 * MATRICES).astype(dtype)
    np.save(tmp_path / "own.npy", given)
    read = read_input(tmp_path / "own.npy")
    assert read.sets["own"].dtype == np.float64
    assert read.sets["own"].dtype.isnative
    np.testing.assert_array_equal(read.sets["own"], given.astype(np.float64))
    assert read.dtype == ("float64" if dtype == ">f8" else "float32")


@pytest.mark.skipif(np.finfo(np.longdouble).eps == np.finfo(np.float64).eps, reason="long double is float64 here")
@pytest.mark.parametrize("order", ["<", ">"])
def test_long_double_is_refused_with_what_to_do(order, tmp_path):
    text = _refusal(MATRICES.astype(np.dtype(np.longdouble).newbyteorder(order)), tmp_path)
    assert np.dtype(np.longdouble).name in text or "f16" in text
    assert "save array.astype(numpy.float64) instead" in text


@pytest.mark.parametrize(
    ("array", "dtype", "code"),
    [
        (MATRICES.astype(complex), "complex128", "array.real.astype(numpy.float64)"),
        (MATRICES.astype(str), "<U32", "array.astype(numpy.float64)"),
        (MATRICES.view("V4"), "|V4", "array.astype(numpy.float64)"),
        (np.zeros((5, 3, 3), [("x", "f4")]), "[('x', '<f4')]", "recfunctions.structured_to_unstructured(array"),
    ],
    ids=["complex", "words", "bytes", "structured"],
)
def test_another_dtype_is_refused_with_what_to_do(array, dtype, code, tmp_path):
    text = _refusal(array, tmp_path)
    assert f"dtype {dtype}; save " in text
    assert code in text


def test_names_are_shown_in_one_line(tmp_path):
    np.savez(tmp_path / "a\nb.npz", **{"c\nd": MATRICES, "e\nf": np.ones(3)})
    read = read_input(tmp_path / "a\nb.npz")
    assert read.name.isprintable()
    assert all(name.isprintable() for name in [*read.sets, *read.remarks])
    np.save(tmp_path / "g\nh.npy", MATRICES)
    read = read_input(tmp_path / "g\nh.npy")
    assert all(name.isprintable() for name in [read.name, *read.sets])

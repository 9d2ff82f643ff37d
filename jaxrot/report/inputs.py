"""The matrices that the report measures, as named sets: the dragon, or the user's own file."""

import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np

from jaxrot._inputs import layout_hint
from jaxrot.console.errors import UserError, shown
from jaxrot.families import FAMILIES
from jaxrot.report import deformed_dragon

WHOLE = "whole input"  # the name of all sets together
# The error of NumPy if it must not unpickle an array.
_OBJECTS = "Object arrays cannot be loaded"
_OBJECTS_REFUSED = "dtype object, which holds Python objects; save array.astype(numpy.float64) instead"
EXPECTED = "expected a .npy or .npz file with a real array of shape (..., 3, 3)"


class Input(NamedTuple):
    """The matrices of one report."""

    name: str  # What the report calls them
    sets: dict[str, np.ndarray]  # Named parts, each float64 of shape (n, 3, 3), n > 0
    remarks: tuple[str, ...] = ()  # What the reader must know about how they were read, one sentence each
    dtype: str = "float64"  # "float64" if the file holds float64, else "float32"

    @property
    def counts(self) -> dict[str, int]:
        """The number of matrices in each set."""
        return {name: len(part) for name, part in self.sets.items()}


def dragon_input(cluster_count: int) -> Input:
    """The matrices of the dragon, which ships with the report."""
    remark = (
        f"A_pq of {cluster_count} overlapping clusters of {deformed_dragon.CLUSTER_SIZE} vertices in each of 15"
        " deformations of the dragon (source: Stanford University Computer Graphics Laboratory)."
    )
    return Input(deformed_dragon.NAME, deformed_dragon.dragon_matrices(cluster_count), (remark,))


def family_matrices(count: int, dtype: str) -> dict[str, np.ndarray]:
    """`count` matrices of every family, from a fixed seed."""
    return {name: family.sample(count, dtype=np.dtype(dtype), seed=0).matrices for name, family in FAMILIES.items()}


def read_input(path: Path, option: str = "--input") -> Input:
    """Returns the user's own matrices from a .npy or .npz file.

    Every array of shape (..., 3, 3) in an archive is a set. A remark names the other arrays, which are left out.

    Args:
        path: The file.
        option: The option that names the file, for error messages.

    Raises:
        UserError: The file does not exist, is not readable without pickle, or has no real, non-empty array of shape
            (..., 3, 3).
    """
    name = f"{option} {shown(path)}"
    if not path.is_file():
        raise UserError(f"{name}: {'not a file' if path.exists() else 'no such file'}; {EXPECTED}")
    arrays = _load(path, name)
    if isinstance(arrays, np.ndarray):
        if (problem := _problem(arrays)) is not None:
            raise UserError(f"{name}: {problem}; {EXPECTED}")
        return Input(shown(path.name), {shown(path.stem): _flat(arrays)}, dtype=_dtype([arrays]))
    problems = {part: _problem(array) for part, array in arrays.items()}
    good = {part: array for part, array in arrays.items() if isinstance(array, np.ndarray) and problems[part] is None}
    left_out = [f"{shown(part)} ({problem})" for part, problem in problems.items() if problem is not None]
    if not good:
        held = ", ".join(left_out) if left_out else "nothing"
        raise UserError(f"{name}: no array of shape (..., 3, 3) in it, it holds {held}; {EXPECTED}")
    remarks = (f"Left out of the file: {', '.join(left_out)}.",) if left_out else ()
    sets = {shown(part): _flat(array) for part, array in good.items()}
    return Input(shown(path.name), sets, remarks, _dtype(list(good.values())))


def thinned(given: Input, most: int) -> Input:
    """A random sample of about `most` matrices, the same share of every set, because the reference is slow."""
    total = sum(given.counts.values())
    if total <= most:
        return given
    random = np.random.default_rng(0)
    sets = {}
    for name, part in given.sets.items():
        count = max(1, len(part) * most // total)
        sets[name] = part[np.sort(random.choice(len(part), count, replace=False))]
    sample = given._replace(sets=sets)
    remark = f"A random sample: {sum(sample.counts.values()):,} of the {total:,} matrices in the file."
    return sample._replace(remarks=(*given.remarks, remark))


def _load(path: Path, name: str) -> np.ndarray | dict[str, np.ndarray | str]:
    """The array in the file, or all arrays of an archive. An array that cannot be read is replaced by the reason."""
    # Pickle would run code from the file. The file is opened here, because `np.load` does not close a torn archive.
    try:
        with path.open("rb") as file:
            loaded = np.load(file, allow_pickle=False)
            return loaded if isinstance(loaded, np.ndarray) else {part: _member(loaded, part) for part in loaded.files}
    except (OSError, ValueError, EOFError, SyntaxError, RuntimeError, MemoryError, BadZipFile, zlib.error) as error:
        reason = " ".join(str(error).split())
        if reason.startswith(_OBJECTS):
            reason = _OBJECTS_REFUSED
        elif "allow_pickle" in reason or "pickled" in reason:
            reason = "it is no NumPy file"
        raise UserError(f"{name}: cannot be read ({reason}); {EXPECTED}") from None


def _member(archive: Mapping[str, np.ndarray], part: str) -> np.ndarray | str:
    try:
        return archive[part]
    except ValueError as error:
        if str(error).startswith(_OBJECTS):
            return _OBJECTS_REFUSED
        raise


def _problem(array: np.ndarray | str) -> str | None:
    """Why an array cannot be measured, or None."""
    if isinstance(array, str):
        return array
    if not isinstance(array, np.ndarray):
        return "no NumPy array"
    if array.shape[-2:] != (3, 3):
        return f"shape {array.shape}{layout_hint(array.shape)}"
    # Long double is the only floating dtype wider than float64. Its digits would be lost silently.
    if array.dtype.kind not in "fiub" or (array.dtype.kind == "f" and array.dtype.itemsize > 8):
        return f"dtype {array.dtype}; save {_conversion(array.dtype)} instead"
    if array.size == 0:
        return f"empty, shape {array.shape}"
    return None


def _conversion(dtype: np.dtype) -> str:
    if dtype.names is not None:
        return "numpy.lib.recfunctions.structured_to_unstructured(array, numpy.float64)"
    return f"array{'.real' if dtype.kind == 'c' else ''}.astype(numpy.float64)"


def _flat(array: np.ndarray) -> np.ndarray:
    return array.astype(np.float64).reshape(-1, 3, 3)


def _dtype(arrays: list[np.ndarray]) -> str:
    is_wide = any(array.dtype.kind == "f" and array.dtype.itemsize >= 8 for array in arrays)
    return "float64" if is_wide else "float32"

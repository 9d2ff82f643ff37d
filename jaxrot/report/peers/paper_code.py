"""The methods of Müller et al. 2016 in C++, compiled if a compiler and Eigen are found."""

import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from jaxrot.console.environment import usable_cores
from jaxrot.report.peers.peer import Peer, UnavailableError

_SOURCE = Path(__file__).with_name("paper_code.cpp")
_FOLDERS = ("/usr/include/eigen3", "/usr/local/include/eigen3", "/opt/homebrew/include/eigen3")
_ITERATIONS = 20


def irving(dtype: str) -> Peer:
    """Appendix C: the eigenvectors of AᵀA by Jacobi rotations, with the sign and small singular values corrected."""
    return _peer("irving", dtype)


def jacobi_svd(dtype: str) -> Peer:
    """Eigen's own singular value decomposition."""
    return _peer("jacobi_svd", dtype)


def torque(dtype: str) -> Peer:
    """Appendix D from a cold start: the normalised quaternion that Eigen makes of A, as section 3 recommends."""
    refined, threads = refine(dtype)
    return Peer(np.ascontiguousarray, lambda a: refined(a, None, _ITERATIONS), None, np.asarray, threads, dtype)


def refine(dtype: str) -> tuple[Callable[[np.ndarray, np.ndarray | None, int], np.ndarray], int]:
    """Appendix D from a warm start: (matrices, rotations, iterations) to rotations, and its threads.

    Raises:
        UnavailableError: No compiler, no Eigen, or it does not compile.
    """
    library, threads = _library()

    def refined(matrices: np.ndarray, starts: np.ndarray | None, iterations: int) -> np.ndarray:
        rotations = np.empty_like(matrices)
        start = None if starts is None else _pointer(starts)
        library[f"torque_{dtype}"](_pointer(matrices), start, _pointer(rotations), len(matrices), iterations)
        return rotations

    return refined, threads


def _peer(name: str, dtype: str) -> Peer:
    library, threads = _library()

    def value(matrices: np.ndarray) -> np.ndarray:
        rotations = np.empty_like(matrices)
        library[f"{name}_{dtype}"](_pointer(matrices), _pointer(rotations), len(matrices))
        return rotations

    return Peer(np.ascontiguousarray, value, None, np.asarray, threads, dtype)


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def _library() -> tuple[ctypes.CDLL, int]:
    """The compiled code and its threads."""
    library = _compiled()
    if isinstance(library, str):
        raise UnavailableError(library)
    return library


@functools.cache
def _compiled() -> tuple[ctypes.CDLL, int] | str:
    """The compiled code and its threads, or why there is none; tried once."""
    compiler = next(filter(None, map(shutil.which, (os.environ.get("CXX") or "c++", "g++", "clang++"))), None)
    if compiler is None:
        return "no C++ compiler"
    folder = next((place for place in _FOLDERS if (Path(place) / "Eigen").is_dir()), None)
    if folder is None:
        return "no Eigen headers"
    with tempfile.TemporaryDirectory() as place:
        target = Path(place) / "paper_code.so"
        command = [compiler, "-O3", "-march=native", "-DNDEBUG", "-shared", "-fPIC", f"-I{folder}"]
        command += [str(_SOURCE), "-o", str(target)]
        # A compiler without OpenMP compiles for one thread.
        for openmp, threads in ((["-fopenmp"], usable_cores()), ([], 1)):
            done = subprocess.run([*command, *openmp], capture_output=True, text=True, check=False)
            if done.returncode == 0:
                library = ctypes.CDLL(str(target))
                _declare(library)
                return library, threads
    return f"the C++ does not compile: {(done.stderr.strip().splitlines() or ['no message'])[0]}"


def _declare(library: ctypes.CDLL) -> None:
    for dtype in ("float32", "float64"):
        for name, arguments in (("irving", "ppn"), ("jacobi_svd", "ppn"), ("torque", "pppnn")):
            function = library[f"{name}_{dtype}"]
            function.argtypes = [ctypes.c_void_p if kind == "p" else ctypes.c_long for kind in arguments]
            function.restype = None

"""Methods of jaxrot compared with other packages: values and gradients on the same matrices, in the same rounds."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

import jaxrot
from jaxrot.evaluation import gradient_reference
from jaxrot.evaluation.accuracy import measure_errors, run_in_chunks
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.evaluation.timing import fill_batch, interleave
from jaxrot.report.measure.methods import method_function
from jaxrot.report.measure.results import Quantiles, Spread, quantiles, spread
from jaxrot.report.peers import PEERS
from jaxrot.report.peers.jax_linalg import in_jax
from jaxrot.report.peers.peer import Peer, UnavailableError, make_peer

_FEWEST_ROUNDS = 5


class ComparedMethod(NamedTuple):
    """One method of jaxrot, or one peer, on the input in one dtype."""

    name: str  # Its name
    description: str  # What it is
    is_own: bool  # It is a method of jaxrot
    dtype: str  # "float32" or "float64", of the matrices and of the result
    computes_in: str  # The dtype it computes in
    threads: int  # Threads that compute
    batch: int  # Matrices in a call
    no_result: int  # Finite matrices without a result: NaN, or it refuses them. Their error is infinite
    outside: int  # Matrices outside the contract, including those without a result
    error: Quantiles | None  # ‖R − R*‖_F, where R* is unique
    time: Spread | None = None  # Of the value; None if it refuses all matrices
    # ‖Ā − Ā*‖_F / ‖Ā*‖_F for a random cotangent of R, where κ ≤ 1/(128 eps). Infinite if Ā is not finite, None without
    # a derivative.
    gradient_error: Quantiles | None = None
    gradient_no_number: int = 0  # Finite matrices of the input with a gradient that is not finite
    families_no_number: tuple[str, ...] = ()  # Families with a finite matrix whose gradient is not finite
    gradient_time: Spread | None = None  # Of value and gradient together


class PeerComparison(NamedTuple):
    """Everything that was compared in any dtype, and which peers were skipped and why, one line each."""

    contenders: list[ComparedMethod]
    skipped: list[str]


class _Candidate(NamedTuple):
    """A method or peer, ready to run with `batch` matrices in a call."""

    name: str
    description: str
    peer: Peer
    batch: int
    is_own: bool = False


def compare_with_peers(
    methods: Sequence[str], judged: Mapping[str, Judged], *, batch: int, budget_s: float
) -> PeerComparison:
    """Returns errors and times of the methods and of every peer that is installed.

    Args:
        methods: Names from `jaxrot.METHODS`.
        judged: "input" and "families", in one dtype.
        batch: Matrices in a call; slow peers get fewer.
        budget_s: Seconds for the rounds.
    """
    matrices = judged["input"].matrices
    candidates, skipped = _candidates(methods, matrices.dtype.name, batch)
    compared = [_judge(candidate, judged) for candidate in candidates]
    calls = {name: call for candidate in candidates for name, call in _calls(candidate, matrices).items()}
    samples, _ = interleave(calls, budget_s=budget_s, fewest_rounds=_FEWEST_ROUNDS)

    def time(entry: ComparedMethod, of_gradient: bool) -> Spread | None:
        seconds = samples.get((entry.name, of_gradient))
        return None if seconds is None else spread(seconds, entry.batch)

    timed = [entry._replace(time=time(entry, False), gradient_time=time(entry, True)) for entry in compared]
    return PeerComparison(timed, skipped)


def _candidates(methods: Sequence[str], dtype: str, batch: int) -> tuple[list[_Candidate], list[str]]:
    """The methods and the peers that run here, and why the others do not."""
    found = [_Candidate(name, "jaxrot", in_jax(method_function(name), dtype), batch, is_own=True) for name in methods]
    if dtype == "float32":
        description = "jaxrot, `nearest_rotation(A.astype(float64)).astype(float32)`"
        peer = in_jax(_in_float64, dtype)._replace(computes_in="float64")
        found.append(_Candidate(f"{jaxrot.DEFAULT_METHOD} in float64", description, peer, batch, is_own=True))
    skipped = []
    for name, source in PEERS.items():
        try:
            peer = make_peer(source, dtype)
        except UnavailableError as reason:
            skipped.append(f"{name} is skipped: {reason}.")
        else:
            found.append(_Candidate(name, source.description, peer, min(batch, source.largest_batch)))
    return found, skipped


def _in_float64(matrix: jax.Array) -> jax.Array:
    return jaxrot.nearest_rotation(matrix.astype("float64")).astype(matrix.dtype)


def _calls(candidate: _Candidate, matrices: np.ndarray) -> dict[tuple[str, bool], Callable[[], object]]:
    """The calls to time, by name and whether they compute the gradient; on the matrices that the peer accepts."""
    peer = candidate.peer
    matrices = matrices[_is_finite(matrices)]
    if peer.accepts is not None:
        matrices = matrices[peer.accepts(matrices)]
    if not len(matrices):
        return {}
    own, bar = peer.load(fill_batch(matrices, candidate.batch)), peer.load(_cotangents(candidate.batch, matrices.dtype))
    calls: dict[tuple[str, bool], Callable[[], object]] = {(candidate.name, False): lambda: peer.value(own)}
    if (pullback := peer.pullback) is not None:
        calls[candidate.name, True] = lambda: pullback(own, bar)
    return calls


def _judge(candidate: _Candidate, judged: Mapping[str, Judged]) -> ComparedMethod:
    """Everything but the times."""
    peer, part, extreme = candidate.peer, judged["input"], judged["families"]
    rotation = _run(peer, peer.value, part.matrices, candidate.batch)
    errors = measure_errors(rotation, part)
    compared = ComparedMethod(
        name=candidate.name,
        description=candidate.description,
        is_own=candidate.is_own,
        dtype=part.matrices.dtype.name,
        computes_in=peer.computes_in,
        threads=peer.threads,
        batch=candidate.batch,
        no_result=int(np.sum(part.is_finite & ~_is_finite(rotation))),
        outside=int(errors.is_outside.sum()),
        error=quantiles(errors.forward),
    )
    if (pullback := peer.pullback) is None:
        return compared
    # Every chunk gets the same cotangents of R, as `_gradient_error` expects.
    bar = peer.load(_cotangents(candidate.batch, part.matrices.dtype))

    def call(own: Any) -> Any:
        return pullback(own, bar)[1]

    gradient = _run(peer, call, part.matrices, candidate.batch)
    of_families = _run(peer, call, extreme.matrices, candidate.batch)
    is_wrong = extreme.is_finite & ~_is_finite(of_families)
    return compared._replace(
        gradient_error=_gradient_error(gradient, part, candidate.batch),
        gradient_no_number=int(np.sum(part.is_finite & ~_is_finite(gradient))),
        families_no_number=tuple(family for family, place in extreme.sets.items() if is_wrong[place].any()),
    )


def _run(peer: Peer, call: Callable[[Any], Any], matrices: np.ndarray, batch: int) -> np.ndarray:
    """Results in chunks; NaN for matrices that are not finite: some packages refuse a whole batch for one NaN."""
    is_finite = _is_finite(matrices)[:, None, None]
    replaced = np.where(is_finite, matrices, np.eye(3, dtype=matrices.dtype))
    return np.where(is_finite, run_in_chunks(lambda part: peer.unload(call(peer.load(part))), replaced, batch), np.nan)


def _gradient_error(gradient: np.ndarray, judged: Judged, batch: int) -> Quantiles | None:
    bar = np.resize(_cotangents(batch, gradient.dtype), gradient.shape)
    expected = gradient_reference.pullback(judged.matrices, bar, reference=judged.solution)
    limit = 1 / (128 * float(np.finfo(judged.matrices.dtype).eps))
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        error = np.linalg.norm((gradient - expected).astype(np.float64), axis=(1, 2))
        relative = error / np.linalg.norm(expected.astype(np.float64), axis=(1, 2))
    is_judged = judged.is_finite & judged.is_normal & (judged.condition <= limit)
    return quantiles(np.where(_is_finite(gradient), relative, np.inf)[is_judged])


def _is_finite(arrays: np.ndarray) -> np.ndarray:
    return np.asarray(np.isfinite(arrays).all(axis=(1, 2)))


def _cotangents(count: int, dtype: np.dtype) -> np.ndarray:
    return np.random.default_rng(1).standard_normal((count, 3, 3)).astype(dtype)

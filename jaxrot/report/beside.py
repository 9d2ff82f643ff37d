"""jaxrot's fastest methods and its peers side by side: the same matrices, values and gradients, in the same rounds."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

import jaxrot
from jaxrot.evaluation import gradient_reference
from jaxrot.evaluation.accuracy import measure_errors, run_in_chunks
from jaxrot.evaluation.ground_truth import Judged
from jaxrot.evaluation.timing import fill_batch, interleave
from jaxrot.report.contenders import Beside, Contender, Quantiles, quantiles, spread
from jaxrot.report.measurement import method_function
from jaxrot.report.peers import PEERS
from jaxrot.report.peers.jax_linalg import in_jax
from jaxrot.report.peers.peer import Peer, UnavailableError, make_peer

_FEWEST_ROUNDS = 5


def measure_beside(
    methods: Sequence[str],
    judged: Mapping[str, Judged],
    *,
    batch: int,
    budget_s: float,
    advance: Callable[[str], object],
) -> Beside:
    """Judges and times the methods and every peer that is installed.

    Args:
        methods: Names from `jaxrot.METHODS`, jaxrot's own front and the default method.
        judged: "input" and "families", in one dtype.
        batch: Matrices in a call; a peer that is too slow for it gets fewer.
        budget_s: Seconds for the rounds.
        advance: Called before each contender, and before the rounds, with what it is: `number_of_steps` times.
    """
    dtype = judged["input"].matrices.dtype.name
    ready: dict[str, tuple[Peer, str, int]] = {}
    skipped = []
    for name in methods:
        ready[name] = (in_jax(method_function(name), dtype), "jaxrot", batch)
    if dtype == "float32":
        ready[f"{jaxrot.DEFAULT_METHOD} in float64"] = (
            in_jax(_in_float64, dtype)._replace(computes_in="float64"),
            "jaxrot, `nearest_rotation(A.astype(float64)).astype(float32)`",
            batch,
        )
    own = set(ready)
    for name, source in PEERS.items():
        try:
            ready[name] = (make_peer(source, dtype), source.description, min(batch, source.largest_batch))
        except UnavailableError as reason:
            skipped.append(f"{name} is skipped: {reason}.")
    unmeasured = {}
    calls: dict[str, Callable[[], object]] = {}
    for name, (peer, description, size) in ready.items():
        advance(f"{dtype}: {name}")
        unmeasured[name] = _judge(name, description, name in own, peer, size, judged)
        calls |= _calls(name, peer, size, judged["input"].matrices)
    for _ in range(len(methods) + 1 + len(PEERS) - len(ready)):
        advance(f"{dtype}: skipped")
    advance(f"{dtype}: timing methods and peers")
    samples, _ = interleave(calls, budget_s=budget_s, fewest_rounds=_FEWEST_ROUNDS)
    contenders = []
    for name, contender in unmeasured.items():
        gradient = samples.get(_gradient_of(name))
        contenders.append(
            contender._replace(
                time=spread(samples[name], contender.batch) if name in samples else None,
                gradient_time=None if gradient is None else spread(gradient, contender.batch),
            )
        )
    return Beside(contenders, skipped)


def number_of_steps(methods: Sequence[str]) -> int:
    """How often `measure_beside` calls `advance`."""
    return len(methods) + 1 + len(PEERS) + 1


def _in_float64(matrix: jax.Array) -> jax.Array:
    return jaxrot.nearest_rotation(matrix.astype("float64")).astype(matrix.dtype)


def _gradient_of(name: str) -> str:
    return f"{name}, with gradient"


def _calls(name: str, peer: Peer, batch: int, matrices: np.ndarray) -> dict[str, Callable[[], object]]:
    matrices = matrices[_is_number(matrices)]
    if peer.accepts is not None:
        matrices = matrices[peer.accepts(matrices)]
    if not len(matrices):
        return {}
    own, bar = peer.load(fill_batch(matrices, batch)), peer.load(_cotangents(batch, matrices.dtype))
    calls: dict[str, Callable[[], object]] = {name: lambda: peer.value(own)}
    if (pullback := peer.pullback) is not None:
        calls[_gradient_of(name)] = lambda: pullback(own, bar)
    return calls


def _judge(
    name: str, description: str, is_own: bool, peer: Peer, batch: int, judged: Mapping[str, Judged]
) -> Contender:
    """Everything but the times."""
    part, extreme = judged["input"], judged["families"]
    rotation = _rotations(peer, part.matrices, batch)
    errors = measure_errors(rotation, part)
    families: tuple[str, ...] = ()
    gradient_error = None
    no_number = 0
    if peer.pullback is not None:
        gradient = _gradients(peer, peer.pullback, part.matrices, batch)
        gradient_error = _gradient_error(gradient, part, batch)
        no_number = int(np.sum(part.is_finite & ~_is_number(gradient)))
        wrong = extreme.is_finite & ~_is_number(_gradients(peer, peer.pullback, extreme.matrices, batch))
        families = tuple(family for family, place in extreme.sets.items() if wrong[place].any())
    return Contender(
        name=name,
        description=description,
        is_own=is_own,
        dtype=part.matrices.dtype.name,
        computes_in=peer.computes_in,
        threads=peer.threads,
        batch=batch,
        no_result=int(np.sum(part.is_finite & ~_is_number(rotation))),
        outside=int(errors.is_outside.sum()),
        error=quantiles(errors.forward),
        time=None,
        gradient_error=gradient_error,
        gradient_no_number=no_number,
        families_no_number=families,
        gradient_time=None,
    )


def _rotations(peer: Peer, matrices: np.ndarray, batch: int) -> np.ndarray:
    return _run(lambda part: peer.unload(peer.value(peer.load(part))), matrices, batch)


def _gradients(
    peer: Peer, pullback: Callable[[Any, Any], tuple[Any, Any]], matrices: np.ndarray, batch: int
) -> np.ndarray:
    """Cotangents of A; those of R repeat from chunk to chunk, as `_gradient_error` expects."""
    bar = peer.load(_cotangents(batch, matrices.dtype))
    return _run(lambda part: peer.unload(pullback(peer.load(part), bar)[1]), matrices, batch)


def _run(call: Callable[[np.ndarray], np.ndarray], matrices: np.ndarray, batch: int) -> np.ndarray:
    """In chunks, NaN where the matrix is not finite: some packages refuse a whole batch for one NaN."""
    is_finite = _is_number(matrices)[:, None, None]
    found = run_in_chunks(call, np.where(is_finite, matrices, np.eye(3, dtype=matrices.dtype)), batch)
    return np.where(is_finite, found, np.nan)


def _gradient_error(gradient: np.ndarray, judged: Judged, batch: int) -> Quantiles | None:
    bar = np.resize(_cotangents(batch, gradient.dtype), gradient.shape)
    right = gradient_reference.pullback(judged.matrices, bar, reference=judged.solution)
    limit = 1 / (128 * float(np.finfo(judged.matrices.dtype).eps))
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        error = np.linalg.norm((gradient - right).astype(np.float64), axis=(1, 2))
        relative = error / np.linalg.norm(right.astype(np.float64), axis=(1, 2))
    is_judged = judged.is_finite & judged.is_normal & (judged.condition <= limit)
    return quantiles(np.where(_is_number(gradient), relative, np.inf)[is_judged])


def _is_number(arrays: np.ndarray) -> np.ndarray:
    return np.asarray(np.isfinite(arrays).all(axis=(1, 2)))


def _cotangents(count: int, dtype: np.dtype) -> np.ndarray:
    return np.random.default_rng(1).standard_normal((count, 3, 3)).astype(dtype)

"""The starts from which the steps are judged, and the promises that a step keeps from them."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxrot._algebra import mat3, quaternion
from jaxrot.evaluation import domain
from jaxrot.evaluation.ground_truth import Judged, judge
from jaxrot.families import half_turn_starts
from jaxrot.report.measure.verdict import Verdict, judge_contract

# Starts 45° off, 135° off, at the nearest rotation, and exactly half a turn off. The last is an equilibrium.
NEAR, FAR, NEAREST, HALF_TURN = range(4)

# Enough for each step to converge: a linear rate of ¾ reaches the last digit of float32.
ITERATIONS = {"torque": 60, "torque_exact_angle": 30, "newton": 8, "cayley": 8, "quest": 2}

# Promises in addition to the contract, in units of eps: the error of the quaternion's length, and how far a start may
# move that is one of several nearest rotations.
_LENGTH_BOUND = 4
_KEPT_BOUND = 32


class Posed(NamedTuple):
    """Matrices and starts."""

    judged: Judged  # The matrices, each repeated once for every kind of start
    starts: np.ndarray  # Unit quaternions, shape (n, 4)
    kind: np.ndarray  # `NEAR`, `FAR`, `NEAREST` or `HALF_TURN`, shape (n,)


def pose(sets: Mapping[str, np.ndarray], dtype: str) -> Posed:
    """The starts for matrices of shape (count, 3, 3), by name; about random axes from a fixed seed."""
    kinds = (NEAR, FAR, NEAREST, HALF_TURN)
    judged = judge({name: np.concatenate([part] * len(kinds)) for name, part in sets.items()}, dtype)
    kind = np.concatenate([np.repeat(kinds, len(part)) for part in sets.values()])
    count = len(kind)
    nearest = np.where(judged.is_finite[:, None, None], judged.solution.rotation, np.eye(3)).astype(dtype)
    axes = np.where(judged.is_finite[:, None, None], judged.solution.right, np.eye(3))
    opposite = half_turn_starts(nearest, axes)[np.arange(count) % 3, np.arange(count)]
    rotation = np.where((kind == HALF_TURN)[:, None, None], opposite, nearest)
    axis = np.random.default_rng(0).standard_normal((3, count))
    angle = np.choose(kind, (np.pi / 4, 3 * np.pi / 4, 0, 0))
    turn = np.stack([np.cos(angle / 2), *(np.sin(angle / 2) * axis / np.linalg.norm(axis, axis=0))], -1).astype(dtype)
    return Posed(judged, np.asarray(_turned(jnp.asarray(rotation), jnp.asarray(turn))), kind)


@jax.jit
def _turned(rotation: jax.Array, turn: jax.Array) -> jax.Array:
    q = quaternion.from_rotation(mat3.components(rotation))
    return quaternion.stack(quaternion.normalise(quaternion.product(q, quaternion.components(turn))))


@jax.jit
def _rotation(wxyz: jax.Array) -> jax.Array:
    return mat3.stack(quaternion.to_rotation(quaternion.components(wxyz)))


def judge_step(
    first: Callable[[jax.Array, jax.Array], jax.Array],
    others: Callable[[jax.Array, jax.Array], jax.Array],
    *,
    iterations: int,
    posed: Posed,
    batch: int,
) -> Verdict:
    """Returns the errors after some iterations from every start.

    They are the errors of the contract, "length" of the quaternion, and "kept": the distance from a start that is one
    of several nearest rotations.

    Args:
        first: The first step, from matrices and quaternions to quaternions, compiled for the batch.
        others: The steps after it.
        iterations: Number of steps, including the first.
        posed: The starts.
        batch: The size to fill the matrices and starts up to.
    """
    judged, count = posed.judged, len(posed.kind)
    matrices = jnp.asarray(np.resize(judged.matrices, (batch, 3, 3)))
    q = first(matrices, jnp.asarray(np.resize(posed.starts, (batch, 4))))
    for _ in range(iterations - 1):
        q = others(matrices, q)
    reached, rotation = np.asarray(q)[:count], np.asarray(_rotation(q))[:count]
    contract = judge_contract(rotation, judged)
    eps = float(np.finfo(judged.matrices.dtype).eps)
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.abs(np.linalg.norm(reached.astype(np.longdouble), axis=1) - 1) / (_LENGTH_BOUND * eps)
        moved = np.linalg.norm((rotation - np.asarray(_rotation(jnp.asarray(posed.starts)))).astype(float), axis=(1, 2))
    is_free = judged.is_normal & (judged.condition >= domain.largest_condition(judged.matrices.dtype.name))
    kept = np.where(is_free & (posed.kind == NEAREST), moved / (_KEPT_BOUND * eps), 0)
    is_finite = contract.is_finite & np.isfinite(reached).all(axis=1)
    more = {
        name: np.where(judged.is_finite, np.where(is_finite, over, np.inf), 0.0).astype(float)
        for name, over in (("length", length), ("kept", kept))
    }
    return Verdict({**contract.over_bound, **more}, is_finite)

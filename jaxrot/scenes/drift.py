"""Drift: the product of a million small rotations, with and without repair.

Rounding makes the product deviate from a rotation, and from the exact product. This scene measures which repair
prevents that, and how often it is needed. The error of its reference does not grow.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jaxrot import DEFAULT_METHOD, METHODS, nearest_rotation, refine_rotation
from jaxrot._compiled import exportable
from jaxrot.scenes import cycles, rotations
from jaxrot.scenes.checks import check
from jaxrot.scenes.cycles import Cycle
from jaxrot.scenes.free_top import tumbling_rates
from jaxrot.scenes.rotations import angle_between, product
from jaxrot.scenes.scene import Scene

# The columns of `drift`: a name, the repair, and the number of products between repairs.
_SHOWN = (
    ("no repair", None, 1),
    ("gram_schmidt", "gram_schmidt", 1),
    ("taylor", "taylor", 1),
    ("taylor every 1,000", "taylor", 1000),
    (DEFAULT_METHOD, DEFAULT_METHOD, 1),
)
_PRODUCTS = 1000  # a frame of `drift`
_MAGNIFIED = 50  # the deviation in its pictures: without repair it is a twentieth of the axes at the end


@exportable
class State(NamedTuple):
    """The orientations of any number of bodies."""

    rotation: jax.Array  # From the body's axes to space, shape (..., 3, 3)
    step_count: jax.Array  # The number of steps so far, int32, shape (): one for all bodies


@exportable
class Parameters(NamedTuple):
    """The increments of the rotation, a cycle that repeats."""

    increments: jax.Array  # The rotations of the steps, in the body's axes, shape (period, ..., 3, 3)
    cycle: Cycle  # The same cycle in the form that the reference needs


def build(rates: ArrayLike, time_step: ArrayLike, *, dtype: type = np.float32) -> tuple[State, Parameters]:
    """Returns the state and the parameters of bodies that turn at these rates, from the identity.

    The increments are exp([ω]× Δt), rounded to the dtype. The reference uses the rotations nearest to the rounded ones.
    So the deviation from it is caused only by the repair and by the rounding of the products.

    Args:
        rates: Body rates ω of every step of a cycle, shape (period, ..., 3), rad/s; a constant rate has the period 1.
        time_step: Δt, shape () or (...), s. A step must turn by less than a quarter turn.
        dtype: Of the rotations, float32 or float64.
    """
    w, h = np.asarray(rates, dtype=np.float64), np.asarray(time_step, dtype=np.float64)
    if w.ndim < 2 or w.shape[-1] != 3 or w.size == 0:
        raise ValueError(f"rates must have shape (period, ..., 3), none of them 0; got {w.shape}")
    check("finite", rates=w)
    if h.shape not in ((), w.shape[1:-1]):
        raise ValueError(f"time_step must have shape () or {w.shape[1:-1]}, that of the bodies; got {h.shape}")
    check("finite and > 0", time_step=h)
    vectors = w * h[..., None]
    angle = np.max(np.linalg.norm(vectors, axis=-1))
    if angle >= np.pi / 2:
        raise ValueError(f"a step must turn by less than a quarter turn, pi/2; got {angle:.3g} rad")
    increments = cycles.rotations(vectors).astype(dtype)
    rotation = jnp.broadcast_to(jnp.eye(3, dtype=dtype), increments.shape[1:])
    return State(rotation, jnp.int32(0)), Parameters(jnp.asarray(increments), cycles.of(increments))


def step(state: State, parameters: Parameters, *, repair: str | None = DEFAULT_METHOD, every: int = 1) -> State:
    """Returns the state after one product R ← R exp([ω]× Δt), and its repair.

    Args:
        state: See `State`.
        parameters: See `Parameters`.
        repair: A name in `METHODS`, or None for no repair at no cost. Static.
        every: Repair after this many products. Static. With 1 the program has no condition. A `vmap` over `step_count`
            would repair in every step and select afterwards: put the bodies on a batch axis of the arrays instead.

    Raises:
        ValueError: Unknown repair, or `every` below 1.

    Example:
        >>> from jaxrot.scenes import drift
        >>> state, parameters = drift.build([[0.0, 0.0, 1.0]], 0.5)
        >>> round(drift.step(state, parameters).rotation[1, 0].item(), 3)
        0.479
    """
    if repair is not None and repair not in METHODS:
        raise ValueError(f"repair must be None or one of {', '.join(sorted(METHODS))}; got {repair!r}")
    if not isinstance(every, int) or every < 1:
        raise ValueError(f"every must be a static integer, 1 or more; got {every}")
    rotation = product(state.rotation, parameters.increments[state.step_count % len(parameters.increments)])
    count = state.step_count + 1
    if repair is not None and every == 1:
        rotation = nearest_rotation(rotation, method=repair)
    elif repair is not None:
        rotation = lax.cond(count % every == 0, lambda r: nearest_rotation(r, method=repair), lambda r: r, rotation)
    return State(rotation, count)


def advance(
    state: State, parameters: Parameters, steps: ArrayLike, *, repair: str | None = DEFAULT_METHOD, every: int = 1
) -> State:
    """Returns the state after many steps. Their number may be traced, so one program serves every number of steps."""
    return lax.fori_loop(0, steps, lambda _, s: step(s, parameters, repair=repair, every=every), state)


def reference(state: State, parameters: Parameters) -> jax.Array:
    """The exact rotation after `state.step_count` steps, shape (..., 3, 3), by a closed form, always to a few eps."""
    return cycles.power(parameters.cycle, state.step_count)


def orientation_error(state: State, parameters: Parameters) -> jax.Array:
    """The angle between the reference and the rotation nearest to the state's matrix, rad, shape (...)."""
    exact = jnp.broadcast_to(reference(state, parameters), state.rotation.shape)
    # Three steps from the reference are enough: `newton` converges cubically from any start.
    nearest = refine_rotation(state.rotation, exact, step="newton", iterations=3)
    return angle_between(nearest, exact)


def orthonormality_error(state: State) -> jax.Array:
    """‖RᵀR − 1‖_F, without unit, shape (...)."""
    return rotations.orthonormality_error(state.rotation)


def drift() -> Scene:
    """A tumbling top without repair, with four repairs, and exact. A step is 1,000 products.

    The picture shows the axes of each. Their deviation from the exact axes, drawn above, is magnified 50 times.
    """
    rates, time_step = tumbling_rates((1.0, 2.0, 3.0), (0.05, 1.0, 0.05), 500)
    start, parameters = build(rates, time_step)

    def frame(states: tuple[State, ...]) -> tuple[State, ...]:
        return tuple(
            advance(state, parameters, _PRODUCTS, repair=repair, every=every)
            for state, (_, repair, every) in zip(states, _SHOWN, strict=True)
        )

    def health(states: tuple[State, ...]) -> dict[str, jax.Array]:
        together = State(jnp.stack([state.rotation for state in states]), states[0].step_count)
        watched = {"orientation error, {} (rad)": orientation_error(together, parameters)}
        watched |= {"orthonormality error, {} (1)": orthonormality_error(together)}
        return {key.format(shown[0]): errors[i] for key, errors in watched.items() for i, shown in enumerate(_SHOWN)}

    def points(states: tuple[State, ...]) -> jax.Array:
        exact = reference(states[0], parameters)
        axes = [exact, *(exact + _MAGNIFIED * (state.rotation - exact) for state in states)]
        places = np.array([[2.5 * len(states), 0, 5], *([5.0 * i + 2.5, 0, 0] for i in range(len(states)))])
        origins = jnp.asarray(places, dtype=exact.dtype)[:, None, :]
        # The columns are the axes; the origin is the first point of each frame.
        tips = jnp.swapaxes(jnp.stack(axes), -1, -2)
        return jnp.concatenate([origins, origins + tips], axis=1).reshape(-1, 3)

    lines = np.array([(4 * i, 4 * i + axis) for i in range(len(_SHOWN) + 1) for axis in (1, 2, 3)])
    names = ", ".join(name for name, _, _ in _SHOWN)
    title = f"Drift of a tumbling top, deviation x{_MAGNIFIED}: {names}; above: exact"
    return Scene(title, (start,) * len(_SHOWN), frame, health, points, float(_PRODUCTS * time_step), 1000, lines)

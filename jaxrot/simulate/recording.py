"""Runs a scene: frames and health at equal distances in time, and the time of the steps alone."""

import contextlib
import time
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from jaxrot.console.interrupts import Interrupts
from jaxrot.scenes.scene import Scene, State

# XLA does not return before a call is done, and Python sees a Ctrl-C only then.
_CALL_S = 0.3
_MOST_STEPS_A_CALL = 10**6


class _Frame(NamedTuple):
    made: int  # Steps so far
    seconds: float  # Their time
    points: np.ndarray
    health: list[np.ndarray]


class Recording(NamedTuple):
    """The frames of a run, from its first state on."""

    times: np.ndarray  # Simulated seconds, shape (frames,)
    points: np.ndarray  # The points to draw, shape (frames, n, 3)
    health: dict[str, np.ndarray]  # The monitored scalars, each of shape (frames,)
    steps: int  # The number of steps made
    seconds: float  # Their time, without the compilation
    compile_seconds: float


def record(
    scene: Scene, steps: int, frames: int, advance: Callable[[str], None], interrupts: Interrupts | None = None
) -> Recording:
    """Makes the steps, or fewer if the user interrupts, and records about so many frames of them.

    `advance` is called before each stretch between two frames, with what is done. `interrupts` is held from the first
    step on.

    Raises:
        KeyboardInterrupt: No step was made before the interruption.
    """
    interrupts = interrupts or Interrupts()
    stretch = -(-steps // min(frames, steps))
    begun = time.perf_counter()
    # The number of steps is an argument: the last stretch may be shorter, and needs no program of its own.
    run = jax.jit(lambda state, count: jax.lax.fori_loop(0, count, lambda _, state: scene.step(state), state))
    run = run.lower(scene.state, stretch).compile()
    names: list[str] = []

    @jax.jit
    def look(state: State) -> tuple[jax.Array, list[jax.Array]]:
        health = scene.health(state)
        # JAX returns a dictionary in the order of the alphabet.
        names[:] = health
        return scene.points(state), list(health.values())

    points, health = jax.device_get(look(scene.state))
    seen = [_Frame(0, 0.0, points, health)]
    compile_seconds = time.perf_counter() - begun
    interrupts.hold()
    state, calls = scene.state, _Calls(run, interrupts)
    with contextlib.suppress(KeyboardInterrupt):
        while seen[-1].made < steps:
            made, seconds = seen[-1].made, seen[-1].seconds
            advance(f"step {made:,} of {steps:,}")
            interrupts.check()
            state, count, took = calls.make(state, min(stretch, steps - made))
            points, health = jax.device_get(look(state))
            seen.append(_Frame(made + count, seconds + took, points, health))
    interrupts.forget()
    if not seen[-1].made:
        raise KeyboardInterrupt
    return Recording(
        times=scene.step_seconds * np.array([frame.made for frame in seen]),
        points=np.stack([frame.points for frame in seen]),
        health={name: np.array([float(frame.health[index]) for frame in seen]) for index, name in enumerate(names)},
        steps=seen[-1].made,
        seconds=seen[-1].seconds,
        compile_seconds=compile_seconds,
    )


class _Calls:
    """Calls of the compiled steps, so short that a Ctrl-C need not wait for the end of one."""

    def __init__(self, run: Callable[[State, int], State], interrupts: Interrupts) -> None:
        self._run, self._interrupts = run, interrupts
        self._count = 1

    def make(self, state: State, count: int) -> tuple[State, int, float]:
        """Returns the state after these steps, or after some of them if Ctrl-C was pressed, their number, and time."""
        made, seconds = 0, 0.0
        while True:
            some = min(self._count, count - made)
            begun = time.perf_counter()
            state = jax.block_until_ready(self._run(state, some))
            took = time.perf_counter() - begun
            made, seconds = made + some, seconds + took
            if made == count or self._interrupts.pending:
                return state, made, seconds
            self._count = max(1, min(_MOST_STEPS_A_CALL, round(some * _CALL_S / max(took, 1e-9))))

"""Running a scene: frames and health at equal distances in time, and how long the steps alone took."""

import time
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from jaxrot.scenes.scene import Scene, State


class Recording(NamedTuple):
    """What was seen of a run, from its first state on.

    Attributes:
        times: Simulated seconds of each frame, shape (frames,).
        points: What to draw, shape (frames, n, 3).
        health: The watched scalars, each of shape (frames,).
        steps: How many steps were made.
        seconds: How long they took, without the compilation.
        compile_seconds: How long the compilation took.
    """

    times: np.ndarray
    points: np.ndarray
    health: dict[str, np.ndarray]
    steps: int
    seconds: float
    compile_seconds: float


def record(scene: Scene, steps: int, frames: int, advance: Callable[[str], None]) -> Recording:
    """Makes the steps, or as many as there are until the user interrupts.

    Args:
        scene: What to run.
        steps: How many steps, at least 1.
        frames: About how many pictures of them, at least 1.
        advance: Called before each stretch between two frames, with what is done.

    Returns:
        The recording; `steps` is smaller than asked where it was interrupted.
    """
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

    seen, made = [jax.device_get(look(scene.state))], [0]
    compile_seconds, seconds = time.perf_counter() - begun, 0.0
    state = scene.state
    try:
        while made[-1] < steps:
            advance(f"step {made[-1]:,} of {steps:,}")
            count = min(stretch, steps - made[-1])
            state, took = _timed(run, state, count)
            frame = jax.device_get(look(state))
            seen, made, seconds = [*seen, frame], [*made, made[-1] + count], seconds + took
    except KeyboardInterrupt:
        pass
    return Recording(
        times=scene.step_seconds * np.array(made),
        points=np.stack([points for points, _ in seen]),
        health={name: np.array([float(health[index]) for _, health in seen]) for index, name in enumerate(names)},
        steps=made[-1],
        seconds=seconds,
        compile_seconds=compile_seconds,
    )


def _timed(run: Callable[[State, int], State], state: State, count: int) -> tuple[State, float]:
    begun = time.perf_counter()
    state = jax.block_until_ready(run(state, count))
    return state, time.perf_counter() - begun

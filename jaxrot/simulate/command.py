"""`python -m jaxrot simulate`: options, their checks, and the order of things."""

import argparse
import contextlib
import json
from collections.abc import Callable
from pathlib import Path

from jaxrot._startup import INTERRUPTED
from jaxrot.console.arguments import path
from jaxrot.console.environment import describe_environment
from jaxrot.console.errors import UserError, shown
from jaxrot.console.interrupts import Interrupts
from jaxrot.console.output import check_writable, write_files
from jaxrot.console.printing import show
from jaxrot.console.progress import check_installed, progress
from jaxrot.scenes.scene import Scene
from jaxrot.simulate.animation import draw_animation
from jaxrot.simulate.catalogue import SCENES
from jaxrot.simulate.health import as_csv, complaints, draw_health
from jaxrot.simulate.recording import Recording, record

_FRAMES = 100
_MOST_STEPS = 10**8
# The slow one last.
_PICTURES: dict[str, Callable[[Recording, Scene], bytes]] = {
    "health.png": lambda recording, scene: draw_health(recording, scene.title),
    "animation.gif": lambda recording, scene: draw_animation(recording, scene.lines, scene.title),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options of a simulation."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    width = max(map(len, SCENES))
    parser.epilog = "scenes:\n" + "\n".join(f"  {name:{width}}  {entry.summary}" for name, entry in SCENES.items())
    parser.add_argument("scene", metavar="SCENE", help="which scene, see below")
    parser.add_argument("--steps", metavar="N", help="how many steps (the scene's own choice)")
    parser.add_argument("--mesh", type=path, metavar="FILE", help="a mesh of your own, in a format that meshio reads")
    parser.add_argument("--out", type=path, metavar="FOLDER", help="where to write (jaxrot-SCENE/)")


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Runs the scene, draws it, writes and prints. Mistakes of the user are found before anything is computed.

    A Ctrl-C ends the steps, or the drawing. What is finished by then is written.

    Returns:
        The exit status: 0; 130 if the steps or the drawing was interrupted.

    Raises:
        KeyboardInterrupt: The command was interrupted before the first step.
    """
    if options.scene not in SCENES:
        raise UserError(f"unknown scene {shown(options.scene)}; expected one of {', '.join(SCENES)}")
    steps = None if options.steps is None else _parse_steps(options.steps)
    folder = options.out or Path(f"jaxrot-{options.scene}")
    check_installed(["matplotlib"], "scenes")
    check_writable(folder)
    scene = _build(options.scene, options.mesh)
    steps = scene.steps if steps is None else steps
    environment = describe_environment(("float32",))
    with progress(interrupts) as advance:
        recording = record(scene, steps, _FRAMES, advance, interrupts)
        pictures = _draw(scene, recording, advance, interrupts)
    summary = {name: getattr(recording, name) for name in ("steps", "seconds", "compile_seconds")}
    summary = {"scene": options.scene, **summary, "complaints": complaints(recording), "environment": environment}
    files = {
        **pictures,
        "health.csv": as_csv(recording).encode(),
        "run.json": json.dumps(summary, indent=2).encode(),
    }
    write_files(folder, files)
    parts = [_text(scene, recording)]
    if recording.steps < steps:
        parts.append(f"Interrupted after {recording.steps:,} of {steps:,} steps.")
    if len(pictures) < len(_PICTURES):
        left_out = " and ".join(name for name in _PICTURES if name not in pictures)
        parts.append(f"Interrupted while drawing, without {left_out}.")
    parts.append(f"Written to {shown(folder)}: {', '.join(files)}")
    show("\n\n".join(parts), folder)
    return 0 if recording.steps == steps and len(pictures) == len(_PICTURES) else INTERRUPTED


def _draw(
    scene: Scene, recording: Recording, advance: Callable[[str], None], interrupts: Interrupts
) -> dict[str, bytes]:
    """The pictures, or those that were finished before a Ctrl-C."""
    pictures: dict[str, bytes] = {}
    with contextlib.suppress(KeyboardInterrupt), interrupts.raising():
        advance("drawing")
        for name, draw in _PICTURES.items():
            pictures[name] = draw(recording, scene)
            interrupts.check()
    return pictures


def _build(name: str, mesh: Path | None) -> Scene:
    entry = SCENES[name]
    if mesh is None:
        return entry.build()
    if entry.read_mesh is None:
        able = ", ".join(name for name, entry in SCENES.items() if entry.read_mesh is not None)
        raise UserError(f"--mesh {shown(mesh)}: {name} takes no mesh; expected one of {able}")
    try:
        return entry.build(entry.read_mesh(mesh))
    except ValueError as error:
        raise UserError(f"--mesh {shown(mesh)}: {error}") from None


def _parse_steps(word: str) -> int:
    try:
        steps = int(word.replace("_", ""))
    except ValueError:
        steps = 0
    if not 1 <= steps <= _MOST_STEPS:
        raise UserError(f"--steps {shown(word)}: expected a whole number from 1 to {_MOST_STEPS:,}")
    return steps


def _text(scene: Scene, recording: Recording) -> str:
    lines = [scene.title, ""]
    if recording.steps:
        rate = recording.steps / recording.seconds
        simulated = recording.steps * scene.step_seconds
        lines.append(
            f"{recording.steps:,} steps in {recording.seconds:.3g} s, {rate:,.0f} a second, {simulated:.3g} s simulated"
            f" (compiled in {recording.compile_seconds:.2g} s)"
        )
    width = max(map(len, recording.health))
    lines += [f"{'':{width}}  {'first':>10}  {'largest':>10}  {'last':>10}"]
    for name, values in recording.health.items():
        lines.append(f"{name:{width}}  {values[0]:10.3g}  {values.max():10.3g}  {values[-1]:10.3g}")
    return "\n".join(lines + complaints(recording))

import json

import jax.numpy as jnp
import numpy as np
import pytest
from commands import refused

from jaxrot.__main__ import main
from jaxrot.scenes.scene import Scene
from jaxrot.simulate import command, health
from jaxrot.simulate.animation import draw_animation
from jaxrot.simulate.catalogue import SCENES, Entry
from jaxrot.simulate.recording import Recording, record

FILES = ["animation.gif", "health.csv", "health.png", "run.json"]
SILENT = lambda step: None  # noqa: E731


def falling(_mesh=None):
    """A point that falls, and is nowhere from its fifth step on."""

    def step(state):
        height, count = state
        return jnp.where(count < 4, height - 0.5, jnp.nan), count + 1

    return Scene(
        title="A point that falls",
        state=(jnp.float32(2.0), jnp.int32(0)),
        step=step,
        health=lambda state: {"speed (m/s)": jnp.float32(5.0), "height (m)": state[0], "a share": state[0] / 2},
        points=lambda state: jnp.stack([jnp.zeros_like(state[0]), jnp.ones_like(state[0]), state[0]])[None],
        lines=np.empty((0, 2), dtype=np.intp),
        step_seconds=0.1,
        steps=3,
    )


@pytest.fixture
def only_falling(monkeypatch):
    monkeypatch.setattr(command, "SCENES", {"falling": Entry(falling, lambda path: np.zeros((1, 3)), "a point falls")})


def test_a_recording_has_every_frame_from_the_first_state_on():
    recording = record(falling(), 4, 3, SILENT)
    np.testing.assert_allclose(recording.times, [0, 0.2, 0.4])
    np.testing.assert_allclose(recording.health["height (m)"], [2, 1, 0])
    np.testing.assert_allclose(recording.points[:, 0, 2], [2, 1, 0])
    assert list(recording.health) == ["speed (m/s)", "height (m)", "a share"]
    assert recording.steps == 4

    # Steps that no stretch divides.
    recording = record(falling(), 3, 2, SILENT)
    np.testing.assert_allclose(recording.times, [0, 0.2, 0.3])
    np.testing.assert_allclose(recording.health["height (m)"], [2, 1, 0.5])


def test_what_is_not_finite_is_said_with_its_time():
    complaints = health.complaints(record(falling(), 6, 6, SILENT))
    assert complaints == [f"{name} is not finite from t = 0.5 s on" for name in ("a position", "height (m)", "a share")]


def test_a_run_writes_its_files_and_prints_its_health(only_falling, tmp_path, capsys):
    assert main(["simulate", "falling", "--out", str(tmp_path / "out")]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    printed = capsys.readouterr().out
    assert "A point that falls" in printed
    assert "3 steps in" in printed
    assert (tmp_path / "out" / "animation.gif").read_bytes()[:6] == b"GIF89a"
    assert (tmp_path / "out" / "health.png").read_bytes()[1:4] == b"PNG"
    rows = (tmp_path / "out" / "health.csv").read_text().splitlines()
    assert rows[0] == "time (s),speed (m/s),height (m),a share"
    assert len(rows) == 5
    assert json.loads((tmp_path / "out" / "run.json").read_text())["steps"] == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["pendulum"], "unknown scene pendulum; expected one of dragon, "),
        (["drift", "--steps", "0"], "--steps 0: expected a whole number from 1 to"),
        (["drift", "--steps", "1e3"], "--steps 1e3: expected a whole number"),
        (["drift", "--mesh", "some.ply"], "--mesh some.ply: drift takes no mesh; expected one of dragon, "),
        (["dragon", "--mesh", "none.ply"], "--mesh none.ply: "),
        (["drift", "--out", "file"], "--out file: this is a file"),
        (["dragon", "--mesh", "empty.obj"], "--mesh empty.obj: "),
        (["recovery", "--mesh", "surface.obj"], "no tetrahedra"),
        (["dragon", "--mesh", "file"], "--mesh file: "),
    ],
)
def test_a_mistake_gets_one_line_and_status_2(words, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    (tmp_path / "empty.obj").write_text("# nothing\n")
    (tmp_path / "surface.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    before = sorted(tmp_path.iterdir())
    assert message in refused(["simulate", *words], capsys)
    assert sorted(tmp_path.iterdir()) == before


def test_the_help_lists_every_scene(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    printed = capsys.readouterr().out
    assert all(f"  {name} " in printed for name in SCENES)


@pytest.mark.parametrize("points", [[[-3e38, 0, 0], [3e38, 1, 0], [0, 0, np.inf]], [[3, 0, 0]]], ids=["wide", "point"])
def test_a_body_of_any_width_is_drawn(points):
    recording = Recording(np.zeros(1), np.array([points], np.float32), {"size (m)": np.array([np.inf])}, 1, 1.0, 1.0)
    assert draw_animation(recording, np.empty((0, 2), dtype=np.intp), "Body")[:6] == b"GIF89a"
    assert health.draw_health(recording, "Body")[1:4] == b"PNG"


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", SCENES)
def test_every_scene_runs_and_stays_finite(name):
    recording = record(SCENES[name].build(), 20, 4, SILENT)
    assert recording.steps == 20
    assert not health.complaints(recording)

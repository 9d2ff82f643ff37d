"""The tetrahedron: the numbers of Fig. 4, inversion, the jump of the shape-matching matrix, derivatives, bad input."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrot.scenes import tetrahedron
from jaxrot.scenes.scene import flops

FRAMES = 320
DETERMINANT = np.linspace(1, -1, FRAMES + 1)
EXACT_ANGLE = np.arctan2((1 - DETERMINANT) * np.tan(tetrahedron.SLANT), 1 + DETERMINANT)


def _built(**choices):
    choices = {"dtype": np.float64} | choices
    return tetrahedron.build(tetrahedron.slanted_tetrahedron(), tetrahedron.pushed_through(), **choices)


@functools.cache
def _followed(matrix="deformation_gradient", **choices):
    return np.asarray(jax.jit(functools.partial(tetrahedron.follow, **choices))(*_built(matrix=matrix)))


def _angle_about_z(rotations):
    return np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])


def test_one_torque_iteration_a_frame_lags_by_0_01_rad_as_in_figure_4_and_more_converge():
    lag = np.abs(_angle_about_z(_followed()) - EXACT_ANGLE)
    assert 0.009 < lag.max() < 0.011
    assert DETERMINANT[lag.argmax()] == pytest.approx(tetrahedron.SPIKE, abs=0.03)
    assert np.abs(_angle_about_z(_followed(iterations=20)) - EXACT_ANGLE).max() < 1e-7
    assert np.abs(_angle_about_z(_followed(rotation_step="newton", iterations=2)) - EXACT_ANGLE).max() < 1e-12


def test_a_method_without_inversion_safety_reflects_past_the_base_and_the_steps_do_not():
    determinant = np.linalg.det(_followed(method="higham_newton"))
    beside = np.abs(DETERMINANT) > 0.01
    np.testing.assert_allclose(determinant[beside], np.sign(DETERMINANT[beside]), atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(_followed()), 1, atol=1e-12)


def test_the_shape_matching_matrix_makes_the_nearest_rotation_jump_and_without_escape_the_start_stays():
    jump = np.argmax(DETERMINANT < tetrahedron.SPIKE)
    nearest = _angle_about_z(_followed("shape_matching", rotation_step="newton", iterations=3, escape=True))
    np.testing.assert_allclose(np.abs(nearest), np.where(DETERMINANT > tetrahedron.SPIKE, 0, np.pi), atol=1e-6)
    # An equilibrium, from which rounding leads away only after tens of frames.
    assert np.abs(_angle_about_z(_followed("shape_matching"))[: jump + 20]).max() < 1e-3


@pytest.mark.exhaustive
def test_the_angle_is_differentiable_with_respect_to_the_path_of_the_tip():
    frames = 12
    path = tetrahedron.pushed_through(frames)
    state, parameters = tetrahedron.build(tetrahedron.slanted_tetrahedron(), path, dtype=np.float64)

    def last_angle(tip_path):
        rotation = tetrahedron.follow(state, parameters._replace(tip_path=tip_path))[-1]
        return jnp.arctan2(rotation[1, 0], rotation[0, 0])

    # The tip's last place is held: one iteration a frame remembers where it was before.
    direction = jnp.asarray(np.random.default_rng(0).normal(size=path.shape)).at[-1].set(0)
    both = jax.jit(lambda tip_path: jax.jvp(last_angle, (tip_path,), (direction,)))
    values, slopes = zip(*(both(parameters.tip_path + h * direction) for h in (1e-6, -1e-6)), strict=True)
    assert abs(float(slopes[0])) > 1e-2
    assert float(sum(slopes)) / 2 == pytest.approx(float(values[0] - values[1]) / 2e-6, rel=1e-6)


def test_paths_may_be_batched():
    state, parameters = tetrahedron.build(tetrahedron.slanted_tetrahedron(), tetrahedron.pushed_through(8))
    paths = jnp.stack([parameters.tip_path, parameters.tip_path + 0.3])
    follow = jax.jit(jax.vmap(tetrahedron.follow, in_axes=(None, tetrahedron.Parameters(0, None, None))))
    both = follow(state, parameters._replace(tip_path=paths))
    assert both.dtype == jnp.float32
    swapped = follow(state, parameters._replace(tip_path=paths[::-1]))
    np.testing.assert_array_equal(both, swapped[::-1])
    assert float(jnp.max(jnp.abs(both[1] - both[0]))) > 0.1


def test_what_is_switched_off_is_not_in_the_program():
    def count(**choices):
        return flops(functools.partial(tetrahedron.step, **choices), *_built(dtype=np.float32))

    alone = flops(tetrahedron.matrix_in, _built(dtype=np.float32)[1], jnp.int32(3))
    cold, warm = count(method="gram_schmidt"), count()
    # Gram-Schmidt has 54 flops and the scale; a torque iteration has more than three times as many.
    assert alone < cold < alone + 120
    assert warm > cold + 120


@pytest.mark.exhaustive
def test_the_scene_runs_to_its_end():
    scene = tetrahedron.tetrahedron()
    last = jax.jit(lambda state: jax.lax.fori_loop(0, scene.steps + 5, lambda _, s: scene.step(s), state))(scene.state)
    assert jax.eval_shape(scene.step, scene.state) == jax.eval_shape(lambda s: s, scene.state)
    health = {name: float(value) for name, value in jax.jit(scene.health)(last).items()}
    assert health["det F (1)"] == pytest.approx(-1, abs=1e-5)
    assert health["turned by (rad)"] == pytest.approx(np.pi / 2, abs=0.1)
    assert health["distance to the nearest rotation (rad)"] < 1e-2
    assert health["orthonormality error (1)"] < 1e-6
    points = np.asarray(jax.jit(scene.points)(last))
    assert points.shape == (np.max(scene.lines) + 1, 3)
    np.testing.assert_allclose(points[3], (0, 0, -1), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(points[5:] - points[4], axis=-1), 0.5, atol=1e-6)


REST, PATH = tetrahedron.slanted_tetrahedron(), tetrahedron.pushed_through(4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tetrahedron.build(REST[:3], PATH), "rest must have shape"),
        (lambda: tetrahedron.build(REST, PATH[:0]), "tip_path must have shape"),
        (lambda: tetrahedron.build(REST * np.inf, PATH), "must be finite"),
        (lambda: tetrahedron.build(REST, np.full((2, 3), np.nan)), "must be finite"),
        (lambda: tetrahedron.build(REST * [1, 1, 0], PATH), "got a flat one"),
        (lambda: tetrahedron.build(REST, PATH, matrix="stress"), "matrix must be one of"),
        (lambda: tetrahedron.step(*tetrahedron.build(REST, PATH), rotation_step="magic"), "step must be one of"),
        (lambda: tetrahedron.step(*tetrahedron.build(REST, PATH), method="magic"), "method must be one of"),
        (lambda: tetrahedron.step(*tetrahedron.build(REST, PATH), iterations=-1), "iterations must be >= 0"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_bad_input_gets_one_line(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)

import functools
import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrot.scenes.body import Body, build_body, build_two_scale_body
from jaxrot.scenes.clusters import two_scale_clusters
from jaxrot.scenes.dragon import dragon, rest_vertices
from jaxrot.scenes.drop import BLOCK, ROOM, drop
from jaxrot.scenes.scene import flops
from jaxrot.scenes.shape_matching import build_parameters, build_state, step

ROTATIONS = {
    "torque 1": {"iterations": 1},
    "torque 3": {"iterations": 3},
    "newton": {"rotation_step": "newton", "iterations": 1},
}
POINTS = np.random.default_rng(0).standard_normal((24, 3))
# Overlapping, of different sizes, and one of a single vertex.
CLUSTERS = [range(12), range(8, 20), range(16, 24), range(0, 24, 3), [5]]


@functools.partial(jax.jit, static_argnames="choices")
def rolled_out(state, parameters, steps, choices=()):
    return jax.lax.fori_loop(0, steps, lambda _, now: step(now, parameters, **dict(choices)), state)


def roll_out(state, parameters, steps, **choices):
    return rolled_out(state, parameters, jnp.asarray(steps, jnp.int32), tuple(sorted(choices.items())))


class Dragons(NamedTuple):
    """Both dragons as one body, so that one program moves them, and the first vertex of the fine one."""

    body: Body
    border: int

    def both(self, array):
        return array[: self.border], array[self.border :]


@pytest.fixture(scope="module")
def dragons():
    coarse, fine = rest_vertices(), rest_vertices(fine=True)
    clusters = two_scale_clusters(coarse, 32) + [row + len(coarse) for row in two_scale_clusters(fine, 32)]
    return Dragons(build_body(np.concatenate([coarse, fine]), clusters), len(coarse))


@pytest.fixture(scope="module")
def points():
    return build_body(POINTS, CLUSTERS)


def error_after_best_alignment(positions, rest):
    """In NumPy and float64, by its singular value decomposition."""
    x, q = (np.asarray(array, np.float64) for array in (positions, rest))
    x, q = x - x.mean(axis=0), q - q.mean(axis=0)
    u, _, vt = np.linalg.svd(x.T @ q)
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    return np.sqrt(np.mean(np.sum((x - q @ rotation.T) ** 2, axis=1))) / np.linalg.norm(np.ptp(q, axis=0))


def momenta(positions, velocities, masses):
    """Linear, and angular about the centre of mass, in float64."""
    x, v, m = (np.asarray(array, np.float64) for array in (positions, velocities, masses[:, None]))
    centre = np.sum(m * x, axis=0) / np.sum(m)
    return np.sum(m * v, axis=0), np.sum(m * np.cross(x - centre, v), axis=0)


def relative_changes(before, after):
    return [np.linalg.norm(b - a) / np.linalg.norm(a) for a, b in zip(before, after, strict=True)]


def spinning(body, spin=(1.0, 2.0, 3.0), velocity=(1.0, 0.5, 0.2)):
    """Stretched, turning and flying."""
    x = np.asarray(body.rest_positions) * [1.1, 0.9, 1.0]
    return build_state(body, x, np.cross(spin, x) + velocity)


@pytest.mark.parametrize("name", ROTATIONS)
def test_the_scrambled_dragons_recover_their_shape(dragons, name):
    rest = np.asarray(dragons.body.rest_positions)
    scrambled = np.random.default_rng(0).uniform(rest.min(axis=0), rest.max(axis=0), rest.shape)
    start = build_state(dragons.body, scrambled)
    after = roll_out(start, build_parameters(dragons.body), 100, **ROTATIONS[name])
    for positions, first, shape in zip(*map(dragons.both, (after.positions, scrambled, rest)), strict=True):
        assert error_after_best_alignment(first, shape) > 0.3
        assert error_after_best_alignment(positions, shape) <= 0.01


@pytest.mark.exhaustive
def test_both_momenta_are_kept_for_1000_free_steps_by_a_rotation_that_lags(dragons):
    body = dragons.body
    start = spinning(body)
    after = roll_out(start, build_parameters(body, damping=1.0), 1000, **ROTATIONS["torque 1"])
    assert not np.allclose(after.positions, start.positions, atol=1)
    vertices = [zip(*map(dragons.both, (*state[:2], body.masses)), strict=True) for state in (start, after)]
    for before, later in zip(*vertices, strict=True):
        assert max(relative_changes(momenta(*before), momenta(*later))) < 1e-5


def test_without_the_correction_a_rotation_that_lags_brakes_and_one_that_has_converged_does_not(points):
    start = spinning(points)
    parameters = build_parameters(points)
    before = momenta(*start[:2], points.masses)
    lags = roll_out(start, parameters, 1000, iterations=1, conserve_angular_momentum=False)
    converged = roll_out(start, parameters, 1000, rotation_step="newton", iterations=2, conserve_angular_momentum=False)
    assert relative_changes(before, momenta(*lags[:2], points.masses))[1] > 0.5
    linear, angular = relative_changes(before, momenta(*converged[:2], points.masses))
    assert linear < 1e-5
    assert angular < 2e-4


@pytest.mark.parametrize(("stiffness", "period"), [(1.0, 6), (2 - 2**0.5, 8)])
def test_an_undamped_cluster_swings_with_the_period_of_its_stiffness(stiffness, period):
    # Symplectic Euler: cos(ω h) = 1 − α/2.
    body = build_body(POINTS, [range(24)], dtype=np.float64)
    start = build_state(body, 1.01 * POINTS)
    parameters = build_parameters(body, stiffness=stiffness)
    after = roll_out(start, parameters, period, damping=False)
    np.testing.assert_allclose(after.positions, start.positions, atol=1e-12)
    half_way = roll_out(start, parameters, period // 2, damping=False).positions
    assert np.abs(half_way - start.positions).max() > 0.01


def test_full_damping_leaves_a_cluster_its_rigid_motion_alone():
    body = build_body(POINTS, [range(24)], dtype=np.float64)
    noise = np.random.default_rng(1).standard_normal(POINTS.shape)
    start = build_state(body, POINTS, noise)
    after = roll_out(start, build_parameters(body, stiffness=0.0, damping=1.0), 1)
    x = POINTS - POINTS.mean(axis=0)
    # The rigid velocity nearest to the noise, by least squares.
    columns = np.concatenate([np.tile(np.eye(3), (24, 1)), np.concatenate([np.cross(np.eye(3), r).T for r in x])], 1)
    rigid = columns @ np.linalg.lstsq(columns, noise.ravel(), rcond=None)[0]
    np.testing.assert_allclose(after.velocities, rigid.reshape(-1, 3), atol=1e-6)


def test_extreme_bodies_stay_finite_and_bounded():
    shapes = {
        "in space": POINTS,
        "planar": POINTS * [1, 1, 0],
        "on a line": POINTS * [0, 1, 0],
        "on a slanted line": POINTS[:, :1] * [[1, 2, 3]],
        "at one point": 0 * POINTS,
    }
    noise = np.random.default_rng(2).standard_normal(POINTS.shape)
    starts = {"scrambled": noise, "at one point": 0 * noise + 1, "inside out": -POINTS}
    cases = [(s, x, h) for s in shapes for x in starts for h in (1 / 60, 1 / 6)]
    bodies = [build_body(shapes[shape], CLUSTERS) for shape, _, _ in cases]
    parameters = [build_parameters(body, time_step=h) for body, (_, _, h) in zip(bodies, cases, strict=True)]
    states = [build_state(body, starts[start], noise[::-1]) for body, (_, start, _) in zip(bodies, cases, strict=True)]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *states), jax.tree.map(lambda *x: jnp.stack(x), *parameters)

    def move(state, of_case):
        def body(now, _):
            after = step(now, of_case)
            return after, jnp.sum(of_case.body.masses * jnp.sum(after.velocities**2, axis=-1)) / 2

        return jax.lax.scan(body, state, length=1000)

    after, kinetic = jax.tree.map(np.asarray, jax.jit(jax.vmap(move))(*stacked))
    for i, (shape, start, h) in enumerate(cases):
        message = f"{shape}, {start}, time step {h}"
        assert all(np.isfinite(array[i]).all() for array in after), message
        x, q = (np.asarray(a) - np.mean(a, axis=0) for a in (starts[start], shapes[shape]))
        # No rotation makes the elastic energy larger than this.
        elastic = np.sum((np.linalg.norm(x, axis=1) + np.linalg.norm(q, axis=1)) ** 2) / 24 / (2 * h**2)
        assert kinetic[i].max() <= elastic + np.sum(noise**2) / 48, message
        orthogonality = np.einsum("cij,cik->cjk", after.rotations[i], after.rotations[i]) - np.eye(3)
        assert np.abs(orthogonality).max() < 2e-6, message


@pytest.mark.exhaustive
def test_a_rollout_gives_back_its_stiffness_and_first_velocity_by_gauss_newton():
    body = build_body(POINTS, CLUSTERS, dtype=np.float64)
    parameters = build_parameters(body, damping=0.1)
    rest, sheared = build_state(body), jnp.asarray([[1.0, 2.0, 3.0]])

    def final(unknowns):
        # Turning, and stretching too: a rigid motion would say nothing about the stiffness.
        velocity = jnp.cross(jnp.broadcast_to(unknowns[1:], POINTS.shape), rest.positions) * sheared
        of_run = parameters._replace(stiffness=unknowns[0])

        def advance(state, _):
            return step(state, of_run, rotation_step="newton", iterations=2), None

        positions = jax.lax.scan(advance, rest._replace(velocities=velocity), length=8)[0].positions.ravel()
        return positions, positions

    program = jax.jit(jax.jacfwd(final, has_aux=True))
    wanted = np.array([0.4, 1.0, -2.0, 0.5])
    jacobian, target = program(jnp.asarray(wanted))
    ahead, behind = (program(jnp.asarray(wanted + np.array([d, 0, 0, d])))[1] for d in (1e-5, -1e-5))
    np.testing.assert_allclose((ahead - behind) / 2e-5, jacobian[:, 0] + jacobian[:, 3], rtol=1e-5, atol=1e-7)
    guess = np.array([0.6, 0.1, 0.1, 0.1])
    for _ in range(12):
        jacobian, value = program(jnp.asarray(guess))
        guess = guess - np.linalg.lstsq(jacobian, value - target, rcond=None)[0]
        # With the velocity still wrong the first step leads anywhere.
        guess[0] = np.clip(guess[0], 0, 1)
    np.testing.assert_allclose(guess, wanted, rtol=1e-8)


@pytest.mark.exhaustive
def test_scenes_are_carries_of_scan_with_finite_health_and_the_drop_stays_in_its_room():
    mesh = POINTS * [1.0, 0.5, 0.7]
    for scene in (dragon(mesh), drop(mesh)):

        def advance(state, _, scene=scene):
            return scene.step(state), scene.points(state)

        after, path = jax.lax.scan(advance, scene.state, length=scene.steps)
        path = np.asarray(path)
        assert path.shape == (scene.steps, 24, 3)
        assert jax.tree.map(lambda x: x.dtype, after) == jax.tree.map(lambda x: x.dtype, scene.state)
        if scene.title.startswith("Body"):
            watched = jax.jit(scene.health)
            first, health = watched(scene.state), watched(after)
            assert all(np.isfinite(value) for value in health.values())
            assert health["shape error (of the diagonal)"] < 0.01
            assert health["worst orthogonality"] < 2e-6
            expected = error_after_best_alignment(scene.state.positions, mesh)
            assert first["shape error (of the diagonal)"] == pytest.approx(expected, rel=1e-5)
            assert first["elastic energy (J)"] > 1e3 * health["elastic energy (J)"]
        else:
            lower, upper = np.asarray(BLOCK, np.float32)
            assert (path >= np.asarray(ROOM[0], np.float32)).all()
            assert (path <= np.asarray(ROOM[1], np.float32)).all()
            assert not ((path > lower) & (path < upper)).all(axis=-1).any()
            assert path[-1, :, 2].min() < 0.3


@pytest.mark.exhaustive
def test_what_is_switched_off_is_not_in_the_program(points):
    state, parameters = build_state(points), build_parameters(points)
    least = {"damping": False, "conserve_angular_momentum": False}
    chains = [
        [{}, {"damping": False}, least],
        [{**least, "ground": True, "box": True, "obstacle": True}, {**least, "ground": True}, least],
    ]
    count = functools.cache(lambda choices: flops(functools.partial(step, **dict(choices)), state, parameters))
    for chain in chains:
        counts = [count(tuple(choices.items())) for choices in chain]
        assert all(less < more for more, less in itertools.pairwise(counts)), counts


def refused(body, **choices):
    return jax.eval_shape(functools.partial(step, **choices), build_state(body), build_parameters(body))


@pytest.mark.parametrize(
    ("match", "make"),
    [
        ("vertex 3 is", lambda body: build_two_scale_body(np.where(np.arange(24)[:, None] == 3, np.nan, POINTS))),
        ("shape", lambda body: build_two_scale_body(POINTS[:, :2])),
        ("masses .* got 0.0", lambda body: build_two_scale_body(POINTS, np.arange(24.0))),
        ("masses .* got -1.0", lambda body: build_two_scale_body(POINTS, -np.ones(24))),
        ("cluster_size", lambda body: build_two_scale_body(POINTS, cluster_size=0)),
        ("vertex 20 is in none", lambda body: build_body(POINTS, [range(20)])),
        ("cluster 1", lambda body: build_body(POINTS, [range(24), [24]])),
        ("cluster 1", lambda body: build_body(POINTS, [range(24), [1, 1]])),
        ("at least one", lambda body: build_body(POINTS, [])),
        ("stiffness", lambda body: build_parameters(body, stiffness=-0.1)),
        ("damping", lambda body: build_parameters(body, damping=1.1)),
        ("time_step", lambda body: build_parameters(body, time_step=0.0)),
        ("time_step", lambda body: build_parameters(body, time_step=-1.0)),
        ("gravity", lambda body: build_parameters(body, gravity=(0.0, np.inf, 0.0))),
        ("positions", lambda body: build_state(body, POINTS[1:])),
        ("velocities", lambda body: build_state(body, POINTS, np.inf * POINTS)),
        ("step must be one of", lambda body: refused(body, rotation_step="none")),
        ("method must be one of", lambda body: refused(body, method="none")),
        ("all be in one place", lambda body: drop(np.ones((5, 3)))),
        ("shape", lambda body: dragon(np.ones((0, 3)))),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value encountered in multiply:RuntimeWarning")
def test_bad_input_is_refused_in_one_line(points, match, make):
    with pytest.raises(ValueError, match=match) as error:
        make(points)
    assert "\n" not in str(error.value)

"""What the finite elements promise: mechanics, stability, recovery, convergence, derivatives."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import turned
from jax import lax

from jaxrot import refine_rotation
from jaxrot.scenes import corotational, elasticity, finite_elements, newton
from jaxrot.scenes.corotational import build
from jaxrot.scenes.scene import flops
from jaxrot.scenes.tetrahedra import box

BLOCK = box((3, 3, 3), (1.0, 1.0, 1.0))
STATIC = 1e4  # s, a time step so long that inertia does nothing
NO_GRAVITY = (0.0, 0.0, 0.0)
TURN = turned([1, 2, 3], 2.0)


@functools.cache
def rollout(length, **choices):
    def run(state, parameters):
        def advance(state, _):
            following = corotational.step(state, parameters, **choices)
            return following, following

        return lax.scan(advance, state, length=length)

    return jax.jit(run)


def settle(state, parameters):
    """The equilibrium, by twenty Newton iterations of one step each."""
    choices = {"rotation": "torque_exact_angle", "conjugate_gradients": 300, "tolerance": 1e-10}
    return rollout(20, **choices)(state, parameters)[0]


def rough_rollout(state, parameters):
    """Three hundred steps with the solves cut short."""
    return rollout(300, gravity=False, conjugate_gradients=30, tolerance=1e-3)(state, parameters)


def gradients_of(state, parameters):
    return np.asarray(elasticity.deformation_gradients(state.positions, parameters.elements))


def test_the_patch_test_far_turned():
    inside = ((BLOCK.vertices > 0) & (BLOCK.vertices < 1)).all(axis=1)
    state, parameters = build(*BLOCK, young=1e6, time_step=STATIC, gravity=NO_GRAVITY, fixed=~inside, dtype="float64")
    deformation = TURN @ np.array([[1.1, 0.05, 0], [0, 0.95, 0.1], [0, 0, 1.02]])
    exact = BLOCK.vertices @ deformation.T
    noise = np.random.default_rng(0).normal(size=exact.shape) * 0.1
    start = state._replace(positions=jnp.asarray(exact + inside[:, None] * noise))
    reached = settle(start, parameters)
    assert inside.sum() == 8
    assert np.abs(start.positions - exact).max() > 0.1
    assert np.abs(reached.positions - exact).max() < 1e-5
    assert np.abs(gradients_of(reached, parameters) - deformation).max() < 1e-5


def test_a_rigid_motion_makes_no_ghost_force():
    state, parameters = build(*BLOCK, young=1e6, dtype="float32")
    moved = jnp.asarray(BLOCK.vertices @ TURN.T + 1, jnp.float32)

    def force(rotations):
        gradients = elasticity.deformation_gradients(moved, parameters.elements)
        refined = elasticity.element_rotations(gradients, rotations, rotation="newton", iterations=4)
        ours, linear = (elasticity.stress(gradients, r, parameters.elements) for r in (refined, rotations))
        return [jnp.linalg.norm(elasticity.nodal_gradient(p, parameters.elements)) for p in (ours, linear)]

    ghost, linear = jax.jit(force)(state.rotations)
    assert ghost < 1e-6 * linear

    state, parameters = build(*BLOCK, young=1e6, time_step=1.0, gravity=NO_GRAVITY, dtype="float64")
    state = state._replace(positions=state.positions @ TURN.T + 1)
    assert np.abs(settle(state, parameters).positions - state.positions).max() < 1e-6


def test_a_cantilever_bends_as_euler_and_bernoulli_say():
    length, load = 8.0, 1e-3
    mesh = box((96, 1, 8), (length, 0.125, 1.0))
    material = {"young": 1e7, "poisson": 0.0, "density": 1.0, "gravity": (0, 0, -load)}
    fixed = mesh.vertices[:, 0] == 0
    state, parameters = build(*mesh, **material, time_step=STATIC, fixed=fixed, dtype="float64")
    bent = rollout(1, conjugate_gradients=10_000, tolerance=1e-5)(state, parameters)[0]
    deflection = np.mean((state.positions - bent.positions)[mesh.vertices[:, 0] == length, 2])
    assert deflection / (load * length**4 / (8 * 1e7 / 12)) == pytest.approx(1, abs=0.03)


@pytest.mark.exhaustive
def test_the_midpoint_rule_keeps_the_energy_and_the_momenta():
    state, parameters = build(*BLOCK, young=1e5, gravity=NO_GRAVITY, dtype="float64")
    spin = np.random.default_rng(0).normal(size=(3, 3))
    state = state._replace(velocities=state.positions @ jnp.asarray(spin))
    choices = {"rotation": "torque_exact_angle", "gravity": False, "newton_iterations": 4, "tolerance": 1e-6}
    masses = parameters.masses[:, None]

    def watched(state):
        gradients = elasticity.deformation_gradients(state.positions, parameters.elements)
        rotations = refine_rotation(gradients, state.rotations, step="newton", iterations=3)
        energy = elasticity.energy(gradients, rotations, parameters.elements)
        momentum = jnp.sum(masses * state.velocities, axis=0)
        spin = jnp.sum(masses * jnp.cross(state.positions, state.velocities), axis=0)
        return energy + 0.5 * jnp.sum(masses * state.velocities**2), momentum, spin

    _, states = rollout(600, integrator="midpoint", **choices)(state, parameters)
    states = jax.tree.map(lambda first, later: jnp.concatenate([first[None], later]), state, states)
    energies, momenta, spins = (np.asarray(values) for values in jax.jit(jax.vmap(watched))(states))
    drift = np.abs(energies / energies[0] - 1)
    assert drift.max() < 2e-3
    assert np.abs(momenta - momenta[0]).max() < 1e-9 * np.abs(momenta).max()
    assert np.abs(spins - spins[0]).max() < 1e-6 * np.abs(spins).max()


def test_steel_is_stable_at_a_sixtieth_of_a_second():
    fixed = BLOCK.vertices[:, 0] == 0
    state, parameters = build(*BLOCK, young=2e11, density=7850, fixed=fixed, dtype="float32")
    kick = 10 * np.random.default_rng(0).normal(size=BLOCK.vertices.shape)
    state = state._replace(velocities=jnp.asarray(kick * ~fixed[:, None], jnp.float32))
    last, states = rough_rollout(state, parameters)
    # At 10 m/s a vertex would go 0.17 m in one step.
    assert np.abs(np.asarray(states.positions) - np.asarray(state.positions)).max() < 1e-3
    assert np.abs(last.velocities).max() < 1e-3


def test_nearly_incompressible_rubber_keeps_its_volume():
    change = {}
    for poisson in (0.0, 0.49):
        state, parameters = build(
            *BLOCK, young=1e5, poisson=poisson, time_step=STATIC, fixed=BLOCK.vertices[:, 2] == 1, dtype="float64"
        )
        determinants = np.linalg.det(gradients_of(settle(state, parameters), parameters))
        change[poisson] = np.abs(determinants.mean() - 1)
        assert (determinants > 0).all()
    assert change[0.0] > 0.01
    assert change[0.49] < 0.1 * change[0.0]


@pytest.mark.parametrize("start", ["squashed to a plane", "turned inside out", "exploded", "all at one point"])
def test_a_block_recovers_its_shape_with_every_element_upright(start):
    state, parameters = build(*BLOCK, young=1e5, damping=2.0, dtype="float32")
    positions = {
        "squashed to a plane": BLOCK.vertices * [1, 1, 0],
        "turned inside out": BLOCK.vertices * [1, 1, -1],
        "exploded": np.random.default_rng(0).uniform(-1, 2, BLOCK.vertices.shape),
        "all at one point": np.full_like(BLOCK.vertices, 0.5),
    }[start]
    state = state._replace(positions=jnp.asarray(positions, jnp.float32))
    assert (np.linalg.det(gradients_of(state, parameters)) <= 0).sum() > 50
    gradients = gradients_of(rough_rollout(state, parameters)[0], parameters)
    assert (np.linalg.det(gradients) > 0).all()
    np.testing.assert_allclose(np.linalg.svd(gradients)[1], 1, atol=1e-3)


@pytest.mark.exhaustive
def test_newton_needs_fewer_iterations_with_the_exact_tangent():
    mesh = box((6, 1, 1), (6.0, 1.0, 1.0))
    state, parameters = build(*mesh, young=1e6, time_step=0.05, fixed=mesh.vertices[:, 0] == 0, dtype="float64")
    bent = mesh.vertices + np.outer(mesh.vertices[:, 0] ** 2, [0, 0.02, -0.05])
    state = state._replace(positions=jnp.asarray(bent))
    problem = corotational.euler_problem(state, parameters, parameters.time_step)
    needed = {}
    for tangent in ("exact", "held"):
        choices = newton.Choices("torque_exact_angle", 16, tangent, 14, conjugate_gradients=500, tolerance=1e-10)
        norms = jax.jit(newton.residuals, static_argnums=2)(problem, state.rotations, choices)
        needed[tangent] = int(np.argmax(np.asarray(norms) < 1e-9 * norms[0]))
    assert 0 < needed["exact"] <= 6
    assert needed["held"] >= needed["exact"] + 3


@pytest.mark.exhaustive
def test_a_rollout_is_differentiable_and_finds_the_stiffness_of_a_final_shape():
    mesh = box((4, 1, 1), (4.0, 1.0, 1.0))
    fixed = mesh.vertices[:, 0] == 0
    state, parameters = build(*mesh, young=1e6, poisson=0.3, time_step=1 / 30, fixed=fixed, dtype="float64")

    def final_shape(compliance):
        shear_modulus, lame_first = elasticity.lame_parameters(1e6 / compliance, 0.3)
        stiffness = {"shear_modulus": shear_modulus, "lame_first": lame_first}
        stiffness = {name: jnp.broadcast_to(value, (len(mesh.tetrahedra),)) for name, value in stiffness.items()}
        other = parameters._replace(elements=parameters.elements._replace(**stiffness))
        return rollout(8, rotation="torque_exact_angle", tolerance=1e-10)(state, other)[0].positions

    def compared(compliance, target):
        shape = final_shape(compliance)
        return jnp.sum((shape - target) ** 2), shape

    loss = jax.jit(jax.value_and_grad(compared, has_aux=True))
    (_, target), _ = loss(5.0, state.positions)
    # The secant method on the derivative, from a beam five times as stiff.
    before, now = 1.0, 1.1
    ((loss_before, _), slope_before), ((loss_now, _), slope) = loss(before, target), loss(now, target)
    assert float(loss_now - loss_before) == pytest.approx(0.5 * float(slope_before + slope) * (now - before), rel=1e-2)
    for _ in range(12):
        before, now = now, now - float(slope * (now - before) / (slope - slope_before))
        slope_before, ((value, _), slope) = slope, loss(now, target)
        if value < 1e-16:
            break
    assert now == pytest.approx(5.0, rel=1e-4)


@pytest.mark.exhaustive
def test_static_choices_leave_out_what_they_switch_off():
    state, parameters = build(*BLOCK, young=1e5, dtype="float32")

    def counted(**choices):
        return flops(functools.partial(corotational.step, **choices), state, parameters)

    linear = counted(iterations=0)
    assert counted(iterations=0, gravity=False) < linear
    assert counted(iterations=1) > linear
    gradients = state.rotations
    held = flops(lambda d: elasticity.held_tangent(gradients, parameters.elements)(d), gradients)
    exact = flops(lambda d: elasticity.exact_tangent(gradients, gradients, parameters.elements)(d), gradients)
    assert held < exact


@functools.cache
def random_elements():
    """A few hundred deformation gradients, a third of them inverted, and all that is computed at them."""
    _, parameters = build(*BLOCK, young=1.0, poisson=0.3, dtype="float64")
    elements = parameters.elements
    rng = np.random.default_rng(0)
    gradients = jnp.asarray(rng.normal(size=(len(BLOCK.tetrahedra), 3, 3)))
    directions = jnp.broadcast_to(jnp.eye(9).reshape(9, 1, 3, 3), (9, *gradients.shape))

    def rotations_of(gradients):
        return refine_rotation(gradients, jnp.eye(3), step="newton", iterations=16)

    def computed(gradients):
        def energy(gradients):
            return elasticity.energy(gradients, rotations_of(gradients), elements)

        rotations = rotations_of(gradients)
        stress = elasticity.stress(gradients, rotations, elements)
        exact = jax.vmap(elasticity.exact_tangent(gradients, rotations, elements))(directions)
        projected = jax.vmap(elasticity.projected_tangent(gradients, rotations, elements))(directions)
        held = jax.vmap(elasticity.held_tangent(rotations, elements))(directions)
        return stress, jax.grad(energy)(gradients), exact, projected, held

    stress, of_energy, *tangents = jax.jit(computed)(gradients)
    dense = [np.asarray(tangent).reshape(9, -1, 9).swapaxes(0, 1) for tangent in tangents]
    return np.asarray(stress), np.asarray(of_energy) / np.asarray(elements.volumes)[:, None, None], *dense


@pytest.mark.exhaustive
def test_the_force_is_the_derivative_of_the_energy_and_the_projected_tangent_has_no_negative_eigenvalues():
    _, _, exact, projected, held = random_elements()
    np.testing.assert_allclose(exact, exact.swapaxes(1, 2), atol=1e-8 * np.abs(exact).max())
    values, vectors = np.linalg.eigh(0.5 * (exact + exact.swapaxes(1, 2)))
    clipped = (vectors * np.maximum(values, 0)[:, None]) @ vectors.swapaxes(1, 2)
    assert (values < -0.1).any()
    np.testing.assert_allclose(projected, clipped, atol=1e-8 * values.max())
    assert np.linalg.eigvalsh(held).min() > -1e-12
    stress, of_energy, *_ = random_elements()
    np.testing.assert_allclose(stress, of_energy, atol=1e-9 * np.abs(stress).max())


SMALL = box((3, 1, 1), (3.0, 1.0, 1.0))


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["cantilever", "recovery"])
def test_a_scene_runs_on_a_mesh_of_the_users(name):
    make = getattr(finite_elements, name)
    assert len(make().state.rotations) > 1000
    scene = make(SMALL)
    states = jax.jit(lambda state: jax.lax.scan(lambda s, _: (scene.step(s),) * 2, state, length=scene.steps))
    last = states(scene.state)[0]
    assert jax.tree.structure(last) == jax.tree.structure(scene.state)
    assert scene.lines.max() < len(scene.points(last)) == len(SMALL.vertices)
    if name == "cantilever":
        assert scene.points(last)[:, 2].min() < -1, "it did not bend"
        # The clamp takes up momentum.
        assert "linear momentum (kg m/s)" not in jax.eval_shape(scene.health, last)
        return
    health = jax.jit(scene.health)
    first, values = health(scene.state), health(last)
    assert all(np.isfinite(value) for value in values.values())
    assert values["worst orthogonality of R (1)"] < 1e-5
    assert first["inverted elements (1)"] > 2
    assert values["inverted elements (1)"] == 0
    assert values["elastic energy (J)"] < 1e-3 * first["elastic energy (J)"]


def built(**arguments):
    return build(*SMALL, **{"young": 1e5, **arguments})


def stepped(**choices):
    return corotational.step(*built(), **choices)


@pytest.mark.parametrize(
    ("call", "arguments", "message"),
    [
        (built, {"young": -1.0}, "young must be finite and > 0"),
        (built, {"young": float("nan")}, "young must be finite and > 0"),
        (built, {"density": 0.0}, "density must be finite and > 0"),
        (built, {"time_step": -0.1}, "time_step must be finite and > 0"),
        (built, {"poisson": 0.5}, "poisson must be above -1 and below 1/2"),
        (built, {"poisson": -1.0}, "poisson must be above"),
        (built, {"damping": -1.0}, "damping must be finite and >= 0"),
        (built, {"gravity": (0, 0)}, "gravity must be three finite numbers"),
        (built, {"fixed": np.zeros(3, bool)}, "fixed must be bool of shape"),
        (stepped, {"rotation": "nearest"}, "rotation must be a step, one of cayley"),
        (stepped, {"rotation": "newton", "iterations": None}, "rotation must be a method, one of cayley"),
        (stepped, {"tangent": "secant"}, "tangent must be one of exact, held, projected"),
        (stepped, {"tangent": "exact", "iterations": 0}, "tangent must be 'held' where iterations is 0"),
        (stepped, {"integrator": "explicit"}, "integrator must be one of euler, midpoint"),
        (stepped, {"newton_iterations": 0}, "must be >= 1"),
    ],
)
def test_a_bad_parameter_or_choice_is_refused_in_one_line(call, arguments, message):
    with pytest.raises(ValueError, match=message) as refusal:
        call(**arguments)
    assert "\n" not in str(refusal.value)

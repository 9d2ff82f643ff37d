"""The named scenes, and what their builder refuses."""

import jax
import numpy as np
import pytest

from jaxrot.scenes import corotational, finite_elements
from jaxrot.scenes.corotational import build
from jaxrot.scenes.tetrahedra import box

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

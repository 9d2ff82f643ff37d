import functools
import itertools

import jax
import numpy as np
import pytest

from jaxrot.scenes.body import build_body, build_two_scale_body
from jaxrot.scenes.dragon import dragon
from jaxrot.scenes.drop import drop
from jaxrot.scenes.scene import flops
from jaxrot.scenes.shape_matching import build_parameters, build_state, step

POINTS = np.random.default_rng(0).standard_normal((24, 3))


@pytest.fixture(scope="module")
def points():
    return build_body(POINTS, [range(16), range(8, 24)])


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

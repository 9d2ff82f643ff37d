import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.experimental import checkify
from marks import mostly_exhaustive
from parts import PARTS, REFINED

from jaxrot import nearest_quaternion_wxyz, nearest_rotation

SPECIAL = {
    "0": np.zeros((3, 3)),
    "1": np.eye(3),
    "-1": -np.eye(3),
    "rank 1": np.outer([1, 2, 3], [1, 0, 1]),
    "one entry": np.diag([1, 0, 0]),
    "mirror": np.diag([1, 1, -1]),
    "half turn": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]),
    "small": np.full((3, 3), 1e-30),
    "smallest": np.eye(3) * 1.2e-38,
    "large": np.eye(3) * 3e37,
    "largest": np.eye(3) * 3e38,
}
MATRICES = np.stack([*SPECIAL.values()]).astype(np.float32)
FUNCTIONS = {
    "nearest_rotation": nearest_rotation,
    "nearest_quaternion_wxyz": nearest_quaternion_wxyz,
    **REFINED,
    **PARTS,
}


def gradient_of(function):
    return jax.grad(lambda a: jnp.sum(1e-3 * function(a)))


@pytest.fixture
def debugging():
    with jax.debug_nans(True), jax.debug_infs(True):
        yield


@pytest.mark.parametrize("name", mostly_exhaustive(FUNCTIONS, "nearest_rotation", "rotation_gap", "arap_hessian"))
def test_neither_nan_nor_infinity_is_met(name, debugging):
    function = FUNCTIONS[name]
    jax.block_until_ready(function(MATRICES))
    jax.block_until_ready(gradient_of(function)(MATRICES))


def test_an_infinite_singular_value_does_not_reach_what_is_finite(debugging):
    overflowing = np.full((3, 3), 3e38, np.float32)
    assert FUNCTIONS["rotation_gap"](overflowing) < 1e-6
    with pytest.raises(FloatingPointError):
        FUNCTIONS["signed_singular_values"](overflowing)


@pytest.mark.parametrize("name", mostly_exhaustive(FUNCTIONS, "nearest_rotation"))
def test_nothing_is_divided_by_zero(name):
    errors = checkify.div_checks | checkify.nan_checks
    # One operation after the other: compiling with the checks takes minutes.
    with jax.disable_jit():
        for function in (FUNCTIONS[name], gradient_of(FUNCTIONS[name])):
            error, _ = checkify.checkify(function, errors=errors)(jnp.asarray(MATRICES))
            assert error.get() is None

"""A call without `jit` is one compiled program, compiled once for each shape, dtype and static option."""

import functools
import resource

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from marks import mostly_exhaustive
from parts import PARTS, REFINED

import jaxrot
from jaxrot import DEFAULT_METHOD, METHODS, in_blocks, nearest_rotation, refine_rotation, rotation_jacobian

A = jnp.eye(3, dtype=jnp.float32)
FUNCTIONS = {
    **{f"nearest_rotation {method}": functools.partial(nearest_rotation, method=method) for method in METHODS},
    "nearest_quaternion_wxyz": jaxrot.nearest_quaternion_wxyz,
    **REFINED,
    "refine_rotation unrolled": functools.partial(refine_rotation, rotation=A, derivative="unrolled"),
    "refine_quaternion_wxyz": functools.partial(jaxrot.refine_quaternion_wxyz, quaternion_wxyz=A[0].repeat(4)[:4]),
    **PARTS,
    # Each call makes the function in blocks anew, as a user's loop does.
    "in_blocks": lambda a: in_blocks(nearest_gram_schmidt, 2)(np.broadcast_to(a, (5, 3, 3))),
}
nearest_gram_schmidt = functools.partial(nearest_rotation, method="gram_schmidt")
compilations: list[str] = []


def _count(event: str, duration: float, **kwargs: object) -> None:
    # Also fired where the program comes from the cache on disk.
    if event == "/jax/core/compile/backend_compile_duration":
        compilations.append(event)


jax.monitoring.register_event_duration_secs_listener(_count)


def compiled_programs(call) -> int:
    before = len(compilations)
    jax.block_until_ready(call())
    return len(compilations) - before


IN_SHORT = {f"nearest_rotation {method}" for method in (DEFAULT_METHOD, "irving", "svd")}
OTHERS = {name for name in FUNCTIONS if not name.startswith("nearest_rotation ")}


@pytest.mark.parametrize("name", mostly_exhaustive(FUNCTIONS, *IN_SHORT, *OTHERS))
def test_a_second_eager_call_compiles_nothing(name):
    function = FUNCTIONS[name]
    function(A)
    assert compiled_programs(lambda: function(A)) == 0
    assert compiled_programs(lambda: function(np.eye(3, dtype=np.float32))) == 0


@pytest.mark.parametrize("name", ["nearest_rotation singular_pair", "refine_rotation newton", "rotation_gap"])
def test_a_first_eager_call_is_one_program(name):
    # A shape that no other test has.
    assert compiled_programs(lambda: FUNCTIONS[name](np.ones((17, 3, 3), np.float32))) <= 1


@pytest.mark.parametrize("function", [nearest_rotation, rotation_jacobian])
def test_numpy_and_python_numbers_are_the_same_option(function):
    function(A, damping=0.5)
    for damping in (np.float32(0.5), np.float64(0.5), np.float16(0.5)):
        assert compiled_programs(functools.partial(function, A, damping=damping)) == 0
    refine_rotation(A, A, iterations=2)
    assert compiled_programs(lambda: refine_rotation(A, A, iterations=np.int64(2))) == 0


def test_blocks_trace_their_function_once_for_a_shape_and_gradients_without_jit_compile_once():
    chex.clear_trace_counter()
    # Once for its result's type, once in the loop and once for the rest.
    blocks = in_blocks(chex.assert_max_traces(lambda a: nearest_gram_schmidt(a), n=3), 4)
    for _ in range(3):
        blocks(jnp.broadcast_to(A, (9, 3, 3)))
    gradient = jax.grad(lambda a: nearest_rotation(a, method="gram_schmidt")[0, 1])
    gradient(A)
    assert compiled_programs(lambda: gradient(A)) == 0


@pytest.mark.parametrize("name", ["nearest_rotation irving", "refine_rotation torque", "in_blocks"])
def test_memory_does_not_grow(name):
    """It grew by 3.6 MiB a call, a program for each."""
    FUNCTIONS[name](A)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(200):
        FUNCTIONS[name](A)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000  # KiB


@pytest.mark.parametrize("function", [nearest_rotation, rotation_jacobian])
def test_inside_another_jit_the_program_is_the_outer_one_alone(function):
    assert f"_{function.__name__}" not in jax.jit(lambda a: function(a)).lower(A).as_text()

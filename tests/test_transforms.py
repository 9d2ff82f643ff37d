"""What callers wrap around jaxrot: control flow, sharding, export, precision settings."""

import functools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P
from parts import all_parts, decomposition

from jaxrot import DEFAULT_METHOD, METHODS, STEPS, nearest_quaternion_wxyz, nearest_rotation, refine_rotation

A = np.random.default_rng(0).standard_normal((64, 3, 3)).astype(np.float32)
LAPACK = {"svd", "davenport"}
WITHOUT_LAPACK = sorted(set(METHODS) - LAPACK)
COLLECTIVES = re.compile(r"all-reduce|all-gather|all-to-all|collective-permute|reduce-scatter")


def gradient_of(function):
    return lambda a: jax.grad(lambda a: jnp.sum(function(a) * 0.5))(a)


FUNCTIONS = {
    "nearest_rotation": nearest_rotation,
    "nearest_quaternion_wxyz": nearest_quaternion_wxyz,
    "its gradient": gradient_of(nearest_rotation),
    "decomposition": decomposition,
    **{
        f"refine_rotation {step}": functools.partial(refine_rotation, rotation=np.eye(3, dtype=np.float32), step=step)
        for step in STEPS
    },
}
# What is only lowered costs little: the 9×9 matrices take part there.
LOWERED = {**FUNCTIONS, "all parts": all_parts}
SELDOM = {"decomposition", "refine_rotation torque_exact_angle", "refine_rotation cayley", "refine_rotation quest"}
all_functions = pytest.mark.parametrize(
    "function",
    [
        pytest.param(function, id=name, marks=[pytest.mark.exhaustive] if name in SELDOM else [])
        for name, function in FUNCTIONS.items()
    ],
)
all_lowered = pytest.mark.parametrize("function", LOWERED.values(), ids=LOWERED.keys())


@pytest.mark.parametrize("axis_type", [AxisType.Auto, AxisType.Explicit])
@all_functions
def test_a_sharded_batch_needs_no_collectives(function, axis_type):
    mesh = jax.make_mesh((8,), ("batch",), axis_types=(axis_type,))
    with jax.set_mesh(mesh):
        sharded = jax.device_put(A, NamedSharding(mesh, P("batch")))
        compiled = jax.jit(function).lower(sharded).compile()
        assert not COLLECTIVES.search(compiled.as_text())
        result = compiled(sharded)
    assert len(result.sharding.device_set) == 8
    np.testing.assert_allclose(np.asarray(result), np.asarray(function(A)), atol=1e-4)


@all_functions
def test_it_works_inside_shard_map_and_vmap(function):
    mesh = jax.make_mesh((8,), ("batch",), axis_types=(AxisType.Auto,))
    mapped = jax.shard_map(jax.vmap(function), mesh=mesh, in_specs=P("batch"), out_specs=P("batch"))
    compiled = jax.jit(mapped).lower(A).compile()
    assert not COLLECTIVES.search(compiled.as_text())
    np.testing.assert_allclose(np.asarray(jax.jit(mapped)(A)), np.asarray(function(A)), atol=1e-4)


@pytest.mark.parametrize("method", WITHOUT_LAPACK)
def test_a_method_exports_without_custom_calls(method):
    exported = jax.export.export(
        jax.jit(functools.partial(nearest_rotation, method=method)), platforms=["cpu", "cuda", "tpu"]
    )(jax.ShapeDtypeStruct(jax.export.symbolic_shape("batch, 3, 3"), np.float32))
    calls = set(re.findall(r"custom_call @(\w+)", exported.mlir_module()))
    assert calls <= {"shape_assertion"}
    if method == DEFAULT_METHOD:
        again = jax.export.deserialize(exported.serialize())
        np.testing.assert_allclose(again.call(A), jax.jit(nearest_rotation)(A), atol=1e-6)


@pytest.mark.parametrize("name", [name for name in LOWERED if name != "nearest_rotation"])
def test_the_other_functions_export_without_custom_calls(name):
    exported = jax.export.export(jax.jit(LOWERED[name]), platforms=["cpu", "cuda", "tpu"])(
        jax.ShapeDtypeStruct(jax.export.symbolic_shape("batch, 3, 3"), np.float32)
    )
    assert set(re.findall(r"custom_call @(\w+)", exported.mlir_module())) <= {"shape_assertion"}


@all_lowered
def test_no_program_gathers_or_multiplies_matrices(function):
    text = jax.jit(function).lower(A).as_text()
    assert not re.search(r"stablehlo\.(dynamic_)?gather|stablehlo\.dot|custom_call", text)


@all_lowered
def test_float32_is_not_computed_in_float64(function):
    assert "f64" not in jax.jit(function).lower(A).as_text()


@pytest.mark.parametrize("method", WITHOUT_LAPACK)
def test_no_method_has_a_product_that_the_matmul_precision_setting_could_change(method):
    assert "stablehlo.dot" not in jax.jit(functools.partial(nearest_rotation, method=method)).lower(A).as_text()


@pytest.mark.parametrize("method", [DEFAULT_METHOD, *sorted(LAPACK)])
def test_the_matmul_precision_setting_changes_nothing(method):
    function = functools.partial(nearest_rotation, method=method)
    expected = np.asarray(jax.jit(function)(A))
    with jax.default_matmul_precision("bfloat16"):
        np.testing.assert_array_equal(np.asarray(jax.jit(lambda a: function(a))(A)), expected)


@pytest.mark.exhaustive
def test_it_works_inside_control_flow():
    expected = np.asarray(nearest_rotation(A))
    wrapped = {
        "scan": lambda a: jax.lax.scan(lambda c, x: (c, nearest_rotation(x)), 0, a)[1],
        "map": lambda a: jax.lax.map(nearest_rotation, a, batch_size=16),
        "cond": lambda a: jax.lax.cond(a[0, 0, 0] < 1e9, nearest_rotation, lambda a: a, a),
        "while_loop": lambda a: jax.lax.while_loop(
            lambda c: c[0] < 2, lambda c: (c[0] + 1, nearest_rotation(c[1])), (0, a)
        )[1],
        "checkpoint": jax.checkpoint(nearest_rotation),
    }
    for name, function in wrapped.items():
        np.testing.assert_allclose(np.asarray(jax.jit(function)(A)), expected, atol=1e-4, err_msg=name)
    gradient = jax.grad(lambda a: jnp.sum(jax.checkpoint(nearest_rotation)(a)[:, 0, 0]))(A)
    np.testing.assert_allclose(
        gradient, jax.grad(lambda a: jnp.sum(nearest_rotation(a)[:, 0, 0]))(A), rtol=1e-3, atol=1e-4
    )


def test_it_works_inside_pmap():
    batches = A.reshape(8, 8, 3, 3)
    np.testing.assert_allclose(jax.pmap(nearest_rotation)(batches), nearest_rotation(batches), atol=1e-4)


def test_the_default_method_compiles_once_a_shape():
    traces = []

    @jax.jit
    def function(a):
        traces.append(a.shape)
        return nearest_rotation(a, method=DEFAULT_METHOD)

    for _ in range(3):
        function(A)
    assert len(traces) == 1

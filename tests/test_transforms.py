"""What callers wrap around jaxrot: control flow, sharding, export, precision settings."""

import functools
import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P
from marks import mostly_exhaustive
from parts import EYE, PARTS, REFINED, all_parts, decomposition

import jaxrot
from jaxrot import DEFAULT_METHOD, METHODS, STEPS, in_blocks, nearest_quaternion_wxyz, nearest_rotation, refine_rotation

A = np.random.default_rng(0).standard_normal((64, 3, 3)).astype(np.float32)
LAPACK = ("svd", "davenport")
COLLECTIVES = re.compile(r"all-reduce|all-gather|all-to-all|collective-permute|reduce-scatter")


def gradient_of(function):
    return lambda a: jax.grad(lambda a: jnp.sum(function(a) * 0.5))(a)


FUNCTIONS = {
    "nearest_rotation": nearest_rotation,
    "nearest_quaternion_wxyz": nearest_quaternion_wxyz,
    "its gradient": gradient_of(nearest_rotation),
    "decomposition": decomposition,
    **REFINED,
}
METHODS_BY_NAME = {f"nearest_rotation {name}": functools.partial(nearest_rotation, method=name) for name in METHODS}
SELDOM = {"decomposition", *REFINED.keys() - {"refine_rotation newton"}}


SHARDED = list(itertools.product(FUNCTIONS, (AxisType.Auto, AxisType.Explicit)))
SHARDED_IN_SHORT = {(name, AxisType.Auto) for name in FUNCTIONS.keys() - SELDOM}
SHARDED_IN_SHORT.add(("nearest_rotation", AxisType.Explicit))


@pytest.mark.parametrize(("name", "axis_type"), mostly_exhaustive(SHARDED, *SHARDED_IN_SHORT))
def test_a_sharded_batch_needs_no_collectives(name, axis_type):
    function = FUNCTIONS[name]
    mesh = jax.make_mesh((8,), ("batch",), axis_types=(axis_type,))
    with jax.set_mesh(mesh):
        sharded = jax.device_put(A, NamedSharding(mesh, P("batch")))
        compiled = jax.jit(function).lower(sharded).compile()
        assert not COLLECTIVES.search(compiled.as_text())
        result = compiled(sharded)
    assert len(result.sharding.device_set) == 8
    np.testing.assert_allclose(np.asarray(result), np.asarray(function(A)), atol=1e-4)


MAPPED = {
    **PARTS,
    "nearest_quaternion_wxyz": nearest_quaternion_wxyz,
    "refine_quaternion_wxyz": lambda a: jaxrot.refine_quaternion_wxyz(a, EYE[0][[0, 1, 2, 2]], escape=True),
    **METHODS_BY_NAME,
    **{
        f"refine_rotation {step} {derivative}": functools.partial(
            refine_rotation, rotation=EYE, step=step, derivative=derivative
        )
        for step in STEPS
        for derivative in ("implicit", "unrolled")
    },
}
IN_SHORT = {f"nearest_rotation {DEFAULT_METHOD}", "refine_rotation torque unrolled", "nearest_quaternion_wxyz"}


@pytest.mark.parametrize("name", mostly_exhaustive(MAPPED, *IN_SHORT))
def test_it_maps_over_a_sharded_batch(name):
    """On a mesh with Explicit axes: jax 0.10 refuses a choice between two constants that vmap does not know."""
    function = MAPPED[name]
    mesh = jax.make_mesh((8,), ("batch",), axis_types=(AxisType.Explicit,))
    transforms = [jax.vmap(function)]
    # One method's derivative is that of all.
    if "nearest_rotation" not in name or DEFAULT_METHOD in name:
        transforms += [jax.vmap(gradient_of(function)), gradient_of(jax.vmap(function))]
    with jax.set_mesh(mesh):
        sharded = jax.device_put(A, NamedSharding(mesh, P("batch")))
        for transform in transforms:
            result = jax.jit(transform).trace(sharded).out_info
            assert all(x.sharding.spec[0] == "batch" for x in jax.tree.leaves(result))


refined = functools.partial(refine_rotation, step="torque", iterations=2)


@pytest.mark.parametrize("axis_type", [AxisType.Auto, AxisType.Explicit])
def test_blocks_work_on_each_device(axis_type):
    start = np.broadcast_to(EYE, A.shape)

    def slope(function):
        return jax.grad(lambda matrix, rotation: jnp.sum(function(matrix, rotation) ** 3))

    mesh = jax.make_mesh((8,), ("batch",), axis_types=(axis_type,))
    for transform in (lambda f: f, slope):
        expected = np.asarray(jax.jit(transform(refined))(A, start))
        blocked = transform(in_blocks(refined, 4))
        if axis_type == AxisType.Auto:
            blocked = jax.shard_map(blocked, mesh=mesh, in_specs=P("batch"), out_specs=P("batch"))
        with jax.set_mesh(mesh):
            sharded = [jax.device_put(x, NamedSharding(mesh, P("batch"))) for x in (A, start)]
            compiled = jax.jit(blocked).lower(*sharded).compile()
            assert "while(" in compiled.as_text()
            assert not COLLECTIVES.search(compiled.as_text())
            result = compiled(*sharded)
        assert len(result.sharding.device_set) == 8
        np.testing.assert_allclose(np.asarray(result), expected, atol=1e-4)


def test_blocks_take_a_start_that_is_not_sharded_and_values_from_outside():
    mesh = jax.make_mesh((8,), ("batch",), axis_types=(AxisType.Explicit,))
    start = np.broadcast_to(np.eye(3, dtype=np.float32), A.shape)
    with jax.set_mesh(mesh):
        sharded = jax.device_put(A, NamedSharding(mesh, P("batch")))
        result = in_blocks(refined, 4)(sharded, start)
        assert jax.typeof(result).sharding.spec[0] == "batch"
        np.testing.assert_allclose(np.asarray(result), refined(A, start), atol=1e-6)

    def scaled(matrix, factor):
        return in_blocks(lambda a: nearest_rotation(a, method="gram_schmidt") * factor[0], 4)(matrix)

    mesh = jax.make_mesh((8,), ("batch",), axis_types=(AxisType.Auto,))
    mapped = jax.shard_map(scaled, mesh=mesh, in_specs=P("batch"), out_specs=P("batch"))
    factors = np.arange(8, dtype=np.float32)
    expected = np.asarray(nearest_rotation(A, method="gram_schmidt")) * factors.repeat(8)[:, None, None]
    np.testing.assert_allclose(jax.jit(mapped)(A, factors), expected, atol=1e-6)


@pytest.mark.parametrize("platform", ["gpu", "tpu"])
def test_blocks_are_for_the_cpu_alone(platform, monkeypatch):
    monkeypatch.setattr(jax, "default_backend", lambda: platform)
    blocked = in_blocks(functools.partial(nearest_rotation, method="gram_schmidt"), 4)
    assert "while" not in jax.jit(blocked).lower(A).as_text()


@pytest.mark.parametrize("name", mostly_exhaustive(FUNCTIONS, *FUNCTIONS.keys() - SELDOM))
def test_it_works_inside_shard_map_and_vmap(name):
    function = FUNCTIONS[name]
    mesh = jax.make_mesh((8,), ("batch",), axis_types=(AxisType.Auto,))
    mapped = jax.shard_map(jax.vmap(function), mesh=mesh, in_specs=P("batch"), out_specs=P("batch"))
    compiled = jax.jit(mapped).lower(A).compile()
    assert not COLLECTIVES.search(compiled.as_text())
    np.testing.assert_allclose(np.asarray(jax.jit(mapped)(A)), np.asarray(function(A)), atol=1e-4)


# What is only lowered costs little: the 9×9 matrices take part there.
LOWERED = {**METHODS_BY_NAME, **FUNCTIONS, "all parts": all_parts}


@pytest.mark.parametrize("name", [name for name in LOWERED if not name.endswith(LAPACK)])
def test_no_program_has_custom_calls_gathers_products_of_matrices_or_float64(name):
    """A product of matrices could change with the setting of matmul precision."""
    exported = jax.export.export(jax.jit(LOWERED[name]), platforms=["cpu", "cuda", "tpu"])(
        jax.ShapeDtypeStruct(jax.export.symbolic_shape("batch, 3, 3"), np.float32)
    )
    assert set(re.findall(r"custom_call @(\w+)", exported.mlir_module())) <= {"shape_assertion"}
    text = jax.jit(LOWERED[name]).lower(A).as_text()
    # `quaternion_average` chooses between constants in float64, which XLA converts before anything runs.
    wide = "xf64" if name.endswith("quaternion_average") else "f64"
    assert not re.search(rf"stablehlo\.(dynamic_)?gather|stablehlo\.dot|custom_call|{wide}", text)
    if name == "nearest_rotation":
        again = jax.export.deserialize(exported.serialize())
        np.testing.assert_allclose(again.call(A), jax.jit(nearest_rotation)(A), atol=1e-6)


@pytest.mark.parametrize("method", [DEFAULT_METHOD, *LAPACK])
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

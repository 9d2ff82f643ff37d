import functools
import itertools
import re

import jax
import jax.numpy as jnp
import numpy
import numpy as np
import pytest
from parts import PARTS, all_parts

import jaxrot
from jaxrot import nearest_quaternion_wxyz, nearest_rotation, refine_quaternion_wxyz, refine_rotation
from jaxrot._inputs import layout_hint

A = np.random.default_rng(0).standard_normal((4, 3, 3))
FUNCTIONS = {
    "nearest_rotation": nearest_rotation,
    "nearest_quaternion_wxyz": nearest_quaternion_wxyz,
    "refine_rotation": lambda a: refine_rotation(a, np.eye(3)),
    "refine_quaternion_wxyz": lambda a: refine_quaternion_wxyz(a, np.eye(4)[0]),
}
# The conversions do not depend on the method or the step: these compile in a fifth of the time.
CHEAP = {
    "nearest_rotation": functools.partial(nearest_rotation, method="gram_schmidt"),
    "nearest_quaternion_wxyz": functools.partial(nearest_quaternion_wxyz, method="gram_schmidt"),
    "refine_rotation": lambda a: refine_rotation(a, np.eye(3), step="torque", iterations=1),
    "refine_quaternion_wxyz": lambda a: refine_quaternion_wxyz(a, np.eye(4)[0], step="torque", iterations=1),
}
# What is refused is refused while tracing and compiles nothing: here every function has its turn.
REFUSING = {**FUNCTIONS, **PARTS}
ALL_PARTS = pytest.param(all_parts, id="all parts", marks=pytest.mark.exhaustive)
all_functions, all_conversions = (
    pytest.mark.parametrize("function", [*(pytest.param(f, id=name) for name, f in some.items()), ALL_PARTS])
    for some in (FUNCTIONS, CHEAP)
)
all_gates = pytest.mark.parametrize("function", REFUSING.values(), ids=REFUSING.keys())


@all_gates
@pytest.mark.parametrize("shape", [(), (3,), (3, 4), (2, 3), (9,), (3, 3, 5)])
def test_a_wrong_shape_is_refused_at_trace_time(function, shape):
    with pytest.raises(ValueError, match=r"matrix must be .* shape \(\.\.\., 3, 3\); got shape"):
        jax.jit(function)(np.ones(shape))


def test_float64_on_a_tpu_is_refused_in_one_sentence(monkeypatch):
    monkeypatch.setattr(jax, "default_backend", lambda: "tpu")
    with pytest.raises(TypeError, match="float32 or shorter on a TPU"):
        nearest_rotation(np.ones((3, 3, 3, 3, 3)))
    with jax.default_device(jax.devices("cpu")[0]):
        assert nearest_rotation(np.ones((3, 3, 3, 3, 3))).dtype == np.float64


def test_trailing_batch_axes_get_the_recipe():
    with pytest.raises(ValueError, match="in_axes=-1, out_axes=-1"):
        nearest_rotation(np.ones((3, 3, 5)))
    trailing = jax.vmap(nearest_rotation, in_axes=-1, out_axes=-1)(np.moveaxis(A, 0, -1))
    np.testing.assert_array_equal(np.moveaxis(trailing, -1, 0), nearest_rotation(A))


@all_gates
@pytest.mark.parametrize("dtype", [np.complex64, np.complex128, object, "U1", "M8[s]"])
def test_a_dtype_that_is_not_real_is_refused(function, dtype):
    with pytest.raises(TypeError, match="matrix must be a real array"):
        function(np.zeros((3, 3)).astype(dtype))


@all_gates
def test_what_is_no_array_or_long_double_is_refused_in_words(function):
    for argument in (None, "rotation", {"a": 1}):
        with pytest.raises(TypeError, match="matrix must be a real array"):
            function(argument)
    with pytest.raises(
        TypeError, match=r"got dtype (float128|longdouble): convert it by matrix\.astype\(numpy\.float64"
    ):
        function(A.astype(np.longdouble))


@all_conversions
@pytest.mark.parametrize("dtype", [jnp.float16, jnp.bfloat16])
def test_half_precision_is_computed_in_float32(function, dtype):
    half = jnp.asarray(A, dtype)
    assert function(half).dtype == dtype
    np.testing.assert_array_equal(function(half), function(half.astype(jnp.float32)).astype(dtype))


@all_conversions
@pytest.mark.parametrize("dtype", [np.int8, np.int32, np.uint8, np.bool_])
def test_integers_become_the_default_float(function, dtype):
    integers = (np.abs(A * 3)).astype(dtype)
    result = function(integers)
    assert result.dtype == np.float64
    np.testing.assert_array_equal(result, function(integers.astype(np.float64)))


@pytest.mark.parametrize("dtype", [">f4", ">f8", ">i2"])
def test_big_endian_arrays_are_converted(dtype):
    big, native = A.astype(dtype), A.astype(dtype).astype(np.dtype(dtype).newbyteorder("="))
    np.testing.assert_array_equal(CHEAP["nearest_rotation"](big), CHEAP["nearest_rotation"](native))
    refine = functools.partial(refine_rotation, native, step="torque")
    np.testing.assert_array_equal(refine(np.eye(3).astype(dtype)), refine(np.eye(3)))


@pytest.mark.parametrize("shape", [(), (0,), (2, 0), (1,), (2, 1, 3)])
def test_any_batch_shape_is_kept(shape):
    matrices = np.broadcast_to(A[0], (*shape, 3, 3))
    rotation, quaternion = (np.asarray(CHEAP[f"nearest_{name}"](matrices)) for name in ("rotation", "quaternion_wxyz"))
    assert rotation.shape == (*shape, 3, 3)
    assert quaternion.shape == (*shape, 4)
    # XLA may contract products and sums differently for each shape.
    np.testing.assert_allclose(rotation, np.broadcast_to(CHEAP["nearest_rotation"](A[0]), rotation.shape), atol=1e-14)


@pytest.mark.parametrize("method", jaxrot.METHODS)
def test_every_method_takes_an_empty_batch(method):
    function = jax.jit(functools.partial(nearest_rotation, method=method))
    assert function(np.zeros((2, 0, 3, 3))).shape == (2, 0, 3, 3)


def test_lists_transposed_views_and_device_arrays_give_the_same_numbers():
    np.testing.assert_array_equal(nearest_rotation([[1, 0, 0], [0, 2, 0], [0, 0, 3]]), np.eye(3))
    expected = nearest_rotation(A)
    np.testing.assert_array_equal(nearest_rotation(np.asfortranarray(A)), expected)
    np.testing.assert_array_equal(nearest_rotation(jnp.asarray(A)), expected)
    np.testing.assert_array_equal(nearest_rotation(np.ascontiguousarray(A.swapaxes(1, 2)).swapaxes(1, 2)), expected)


nearest, refine = nearest_rotation, functools.partial(refine_rotation, A)
FIVE = np.broadcast_to(np.eye(3), (5, 3, 3))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: nearest(A, method="kabsch"), ValueError, "method must be one of .*squaring.*; got 'kabsch'"),
        (lambda: nearest(A, method=3), TypeError, "method must be a string; got int"),
        (lambda: jaxrot.rotation_jacobian(A, method="kabsch"), ValueError, "method must be one of .*; got 'kabsch'"),
        (lambda: jaxrot.arap_hessian(A, psd=1), TypeError, "psd must be a static Python bool; got int"),
        (lambda: nearest([[2**70, 0, 0], [0, 1, 0], [0, 0, 1]]), TypeError, "more than 64 bits: pass floats"),
        (lambda: nearest(np.ones((5, 4, 4))), ValueError, r"array\[\.\.\., :3, :3\]"),
        (lambda: nearest(A, damping=-0.1), ValueError, "damping must be finite and >= 0"),
        (lambda: nearest(A, damping=np.nan), ValueError, "damping must be finite and >= 0"),
        (lambda: nearest(A, damping=np.inf), ValueError, "damping must be finite and >= 0"),
        (lambda: nearest(A, damping=10**400), ValueError, "damping must be finite and >= 0; got inf"),
        (lambda: nearest(A, damping=10**5000), ValueError, "damping must be finite and >= 0; got inf"),
        (lambda: jax.jit(lambda d: nearest(A, damping=d))(0.1), TypeError, "damping must be a static"),
        (lambda: refine(np.eye(3), step="gauss"), ValueError, "step must be one of .*torque.*; got 'gauss'"),
        (lambda: refine(np.eye(3), derivative="exact"), ValueError, "must be one of implicit, unrolled; got 'exact'"),
        (lambda: refine(np.eye(3), iterations=-1), ValueError, "iterations must be"),
        (lambda: refine(np.eye(3), iterations=1.5), TypeError, "iterations must be"),
        (lambda: refine(np.eye(3), iterations=True), TypeError, "iterations must be"),
        (lambda: refine(np.eye(3), iterations="3"), TypeError, "iterations must be"),
        (lambda: refine(np.eye(3), iterations=10**12), ValueError, r">= 0 and < 2\*\*31; got 1000000000000"),
        (lambda: refine(np.eye(3), iterations=10**5000), ValueError, "got an integer of more than 64 bits"),
        (lambda: jax.jit(lambda n: refine(np.eye(3), iterations=n))(3), TypeError, "iterations must be a static"),
        (lambda: refine(np.ones(4)), ValueError, r"rotation must be .* \(\.\.\., 3, 3\); got shape \(4,\)"),
        (lambda: refine(FIVE), ValueError, "batch axes of matrix and rotation must broadcast"),
        (lambda: refine_quaternion_wxyz(A, np.eye(3)), ValueError, r"_wxyz .* \(\.\.\., 4\); got shape \(3, 3\)"),
    ],
)
def test_a_bad_option_or_start_is_refused_in_words(call, error, message):
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize("dtype", ["float32", pytest.param("float64", marks=pytest.mark.exhaustive)])
def test_a_matrix_that_is_not_finite_gives_nan_and_leaves_its_neighbours_alone(dtype):
    clean = A.astype(dtype)
    for function in map(jax.jit, [*FUNCTIONS.values(), all_parts]):
        expected = np.delete(np.asarray(function(clean)), 1, 0)
        for value, entry in itertools.product((np.nan, np.inf, -np.inf), range(9)):
            spoiled = clean.copy()
            spoiled[1].flat[entry] = value
            result = np.asarray(function(spoiled))
            assert np.isnan(result[1]).all()
            np.testing.assert_array_equal(np.delete(result, 1, 0), expected)


@all_functions
def test_it_works_without_x64(function, without_x64):
    for matrices in (A, A.astype(np.float32), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], jnp.ones((3, 3), jnp.bfloat16)):
        result = function(matrices)
        assert np.isfinite(np.asarray(result, np.float32)).all()
        assert result.dtype in (jnp.float32, jnp.bfloat16)
    jacobian = jax.jacrev(nearest_rotation)(jnp.asarray(A))
    assert jacobian.dtype == jnp.float32


MATRICES = np.arange(2 * 5 * 9.0).reshape(2, 5, 3, 3)
POSES = np.concatenate([np.concatenate([MATRICES, np.full((2, 5, 3, 1), 7.0)], -1), np.ones((2, 5, 1, 4))], -2)

LAYOUTS = {
    "poses": POSES[0],
    "one_pose": POSES[0, 0],
    "batches_of_poses": POSES,
    "poses_without_last_row": POSES[0, :, :3],
    "flat_matrices": MATRICES[0].reshape(5, 9),
    "one_flat_matrix": MATRICES[0, 0].ravel(),
    "batches_of_flat_matrices": MATRICES.reshape(2, 5, 9),
    "flat_poses": POSES[0, :, :3].reshape(5, 12),
    "batches_of_flat_poses": POSES[:, :, :3].reshape(2, 5, 12),
    "flat_poses_with_last_row": POSES[0].reshape(5, 16),
    "trailing_batch": np.moveaxis(MATRICES[0], 0, -1),
    "trailing_batches": np.moveaxis(MATRICES, (-2, -1), (0, 1)),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_hint_is_code_that_gives_the_matrices(layout):
    array = LAYOUTS[layout]
    hint = layout_hint(array.shape)
    (code,) = re.findall("; if [^;]*, use ([^;]*)", hint)
    converted = eval(code, {"numpy": numpy, "array": array})
    np.testing.assert_array_equal(converted.reshape(-1, 3, 3), MATRICES.reshape(-1, 3, 3)[: converted.size // 9])
    assert converted.ndim <= max(3, array.ndim + 1), "the batch axes are kept"
    assert "\n" not in hint


KNOWN_OR_UNKNOWN = [(3, 3), (3, 3, 3), (4, 4, 3, 3), (0, 3, 3), (12, 3, 3), (), (3,), (7,), (2, 2), (5, 4)]
AMBIGUOUS = [(3, 3, 4), (3, 3, 9), (3, 3, 12), (3, 3, 4, 4)]


@pytest.mark.parametrize("shape", KNOWN_OR_UNKNOWN + AMBIGUOUS)
def test_an_ambiguous_shape_gets_both_readings_and_a_legal_or_an_unknown_one_none(shape):
    assert layout_hint(shape).count("; if ") == 2 * (shape in AMBIGUOUS)
    assert bool(layout_hint(shape)) == (shape in AMBIGUOUS)

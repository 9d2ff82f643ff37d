"""`in_blocks` changes the order of the work and nothing else."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import export

from jaxrot import in_blocks, nearest_rotation, refine_rotation

# The blocks do not depend on the method; this one compiles in a fifth of the default's time.
nearest = functools.partial(nearest_rotation, method="gram_schmidt")
A = np.random.default_rng(0).standard_normal((1000, 3, 3))
# A divisor of the batch, none, one block, fewer rows than a block, one row at a time.
SIZES = [100, 300, 1000, 4096, 1]


@pytest.mark.parametrize("size", SIZES)
def test_blocks_give_the_same_rotations(size):
    count = 7 if size == 1 else 1000
    expected = np.asarray(jax.jit(nearest)(A[:count]))
    np.testing.assert_allclose(jax.jit(in_blocks(nearest, size))(A[:count]), expected, atol=1e-15)


def test_the_blocks_are_in_the_program_and_a_divisor_of_the_batch_is_found():
    text = jax.jit(in_blocks(nearest, 300)).lower(A).as_text()
    assert "stablehlo.while" in text
    assert "tensor<250x3x3xf64>" in text
    assert "stablehlo.while" not in jax.jit(in_blocks(nearest, 1000)).lower(A).as_text()


@pytest.mark.parametrize("size", [250, 300])
def test_several_arrays_and_several_results_are_split_alike(size):
    def both(matrix, start):
        refined = refine_rotation(matrix, start, iterations=2)
        return {"refined": refined, "trace": jnp.sum(refined * matrix, axis=(-2, -1))}

    start = np.broadcast_to(np.eye(3), A.shape)
    expected, got = both(A, start), in_blocks(both, size)(A, start)
    assert got.keys() == expected.keys()
    for name in expected:
        np.testing.assert_allclose(got[name], expected[name], atol=1e-13)


@pytest.mark.parametrize("size", [250, 300])
@pytest.mark.exhaustive
def test_both_modes_of_differentiation_go_through(size):
    blocked = in_blocks(nearest, size)
    weights = np.random.default_rng(1).standard_normal(A.shape)
    for derivative in (
        lambda f: jax.grad(lambda a: jnp.sum(f(a) * weights))(A),
        lambda f: jax.jvp(f, (A,), (weights,))[1],
    ):
        expected = np.asarray(derivative(nearest))
        np.testing.assert_allclose(derivative(blocked), expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_the_temporary_arrays_are_those_of_a_block():
    plain, blocked = (
        jax.jit(f).lower(jnp.zeros((1 << 17, 3, 3), jnp.float32)).compile().memory_analysis().temp_size_in_bytes
        for f in (nearest_rotation, in_blocks(nearest_rotation, 1 << 14))
    )
    assert blocked < plain / 4


def test_a_symbolic_batch_goes_through_at_once():
    exported = export.export(jax.jit(in_blocks(nearest, 10)))(
        jax.ShapeDtypeStruct(export.symbolic_shape("batch, 3, 3"), np.float64)
    )
    np.testing.assert_allclose(exported.call(A), nearest(A), atol=1e-14)


def test_what_cannot_be_split_is_refused_in_words():
    blocks = in_blocks(nearest, 2)
    with pytest.raises(TypeError, match=r"takes arrays, .* got float: convert lists by jax.numpy.asarray"):
        blocks([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
    with pytest.raises(TypeError, match="at least one positional array"):
        blocks(matrix=A)
    with pytest.raises(ValueError, match="same first axis; got shapes"):
        in_blocks(refine_rotation, 2)(A, A[:3])
    with pytest.raises(ValueError, match="same first axis"):
        blocks(np.ones(()))


@pytest.mark.parametrize("size", [1.5, True, "3", None, 0, -1])
def test_a_size_that_is_no_positive_integer_is_refused(size):
    words = "must be a static Python integer" if size not in (0, -1) else f"must be >= 1 and .*; got {size}"
    with pytest.raises((TypeError, ValueError), match=f"size {words}"):
        in_blocks(nearest, size)

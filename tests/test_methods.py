"""Method × dtype × family × transform, against the certificate."""

import functools
import itertools

import jax
import numpy as np
import pytest
from certificate import assert_contract, assert_forward_error, family_batch, in_families, resolved, within_domain
from marks import mostly_exhaustive

from jaxrot import DEFAULT_METHOD, METHODS, nearest_rotation
from jaxrot.families import LARGE_BATCH

LAPACK = {"svd", "davenport"}  # their errors are those of the library that jaxlib was built with


@functools.lru_cache
def transformed(method, transform):
    function = functools.partial(nearest_rotation, method=method)
    return {
        "eager": function,
        "jit": jax.jit(function),
        "vmap": jax.vmap(function),
        "jit∘vmap": jax.jit(jax.vmap(function)),
    }[transform]


@functools.lru_cache
def on_families(method, dtype):
    return np.asarray(transformed(method, "jit")(family_batch(dtype).matrices))


TRANSFORMED = list(itertools.product(METHODS, ("eager", "jit", "vmap", "jit∘vmap")))
IN_SHORT = [case for case in TRANSFORMED if case[0] == DEFAULT_METHOD or case[1] == "jit"]


@pytest.mark.parametrize(("method", "transform"), mostly_exhaustive(TRANSFORMED, *IN_SHORT))
def test_a_method_keeps_its_promise_on_every_family(method, dtype, transform):
    batch = family_batch(dtype)
    rotation = np.asarray(transformed(method, transform)(batch.matrices))
    assert rotation.dtype == dtype
    if method == DEFAULT_METHOD:
        assert_contract(rotation, batch)
    assert_forward_error(rotation, batch, within_domain(method, batch))


@pytest.mark.parametrize("method", sorted(LAPACK))
def test_the_controls_are_right_on_every_family_but_for_their_rounding(method, dtype):
    """LAPACK's error was up to 80 eps (1+κ), so that its methods promise nothing; a reflection is 1e6 times that."""
    batch = family_batch(dtype)
    where = resolved(batch, 1 / (1024 * np.finfo(dtype).eps))
    assert_forward_error(on_families(method, dtype), batch, where, bound=256)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_returns_an_exact_rotation_as_it_is_and_nan_where_there_is_none(method, dtype):
    batch = family_batch(dtype)
    where = in_families(batch, ["rotation", "identity", "half_turn", "swap"])
    # A rotation is well-conditioned (κ = 1/2): twice the contract's 12 eps, for the methods without a limit.
    assert_forward_error(on_families(method, dtype), batch, where, bound=16)
    spoiled = batch.matrices.copy()
    spoiled[0, 1, 2], spoiled[1, 0, 0] = np.nan, np.inf
    assert np.isnan(transformed(method, "jit")(spoiled)[:2]).all()


@pytest.mark.parametrize("method", [name for name, record in METHODS.items() if record.exact and name not in LAPACK])
def test_a_declared_limit_is_no_understatement(method, dtype):
    """Beyond 16 times the declared limit an exact method does break the bound, or the limit is the whole range."""
    record = METHODS[method]
    eps = np.finfo(dtype).eps
    beyond = 16 * max(record.condition_limit[dtype], 0.5)
    if beyond >= 1 / (8 * eps):
        return
    batch = family_batch(dtype)
    where = resolved(batch) & ~(batch.condition < beyond)
    where &= record.handles_inversion | (batch.singular_values[:, 2] > 0)
    assert where.any()
    with pytest.raises(AssertionError, match="forward error"):
        assert_forward_error(on_families(method, dtype), batch, where)


@pytest.mark.parametrize("method", mostly_exhaustive(METHODS, DEFAULT_METHOD))
def test_a_large_batch_is_the_same_as_a_small_one(method, dtype):
    """On batches above 32,768 jaxlib 0.10.2 returns wrong numbers from some fused reductions (jax#39103)."""
    function = transformed(method, "jit")
    # As many as in the batch of families, for which the program is compiled already.
    few = len(family_batch(dtype).matrices)
    repeats = LARGE_BATCH // few + 1
    matrices = np.random.default_rng(0).uniform(-0.2, 0.2, (few, 3, 3)).astype(dtype) + np.eye(3, dtype=dtype)
    large = np.asarray(function(np.tile(matrices, (repeats, 1, 1))))
    assert len(large) > LARGE_BATCH
    # κ ≤ 1 here: two roundings of the same algorithm may each be off by 16 eps, those of an angle by more.
    difference = np.abs(large.reshape(repeats, few, 3, 3) - np.asarray(function(matrices)))
    assert difference.max() <= 64 * np.finfo(dtype).eps

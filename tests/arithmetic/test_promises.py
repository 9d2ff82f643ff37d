"""The promises hold where division and roots are not correctly rounded, subnormals are flushed or products fused."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from arithmetic.interpreter import evaluate
from arithmetic.machines import MACHINES
from certificate import (
    ORTHOGONALITY,
    analytic_jacobian,
    assert_contract,
    assert_forward_error,
    assert_within,
    family_batch,
    resolved,
    survives_flushing,
    within_domain,
)
from marks import mostly_exhaustive

import jaxrot
from jaxrot import DEFAULT_METHOD, METHODS, STEPS, nearest_rotation, refine_rotation
from jaxrot.evaluation import reference

EPS = np.finfo(np.float32).eps
BATCH = family_batch("float32", 6)
NORMAL = survives_flushing(BATCH)
SIZE = np.maximum(BATCH.singular_values[:, :1, None], np.finfo(np.float32).tiny)
LAPACK = ("svd", "davenport")
# They turn columns about 20 times. Where quotients are inexact, every turn is off by some eps.
LOOSE = {"jacobi_svd": 24, "implicit_qr_svd": 24}
# They promise no rotation where the matrix is singular or far from one.
NO_ROTATION = {"smith_franca", "foam", "irving", "gram_schmidt", "inverse_square_root", "higham_newton"}
NO_ROTATION |= {"taylor", "taylor_iterated", "simple_average"}

on_every_machine = pytest.mark.parametrize("machine", MACHINES.values(), ids=MACHINES.keys())


@pytest.fixture(params=["cpu", "gpu"])
def form(request, monkeypatch):
    """The program as it is written for a CPU, cut by quotients, and for an accelerator."""
    monkeypatch.setattr(jax, "default_backend", lambda: request.param)
    jax.clear_caches()
    yield
    jax.clear_caches()


@pytest.mark.usefixtures("form")
@on_every_machine
def test_the_default_method_keeps_its_contract(machine):
    (rotation,) = evaluate(nearest_rotation, [BATCH.matrices], machine)
    assert_contract(rotation, BATCH)


@pytest.mark.exhaustive
@on_every_machine
@pytest.mark.parametrize("method", [name for name in METHODS if name not in LAPACK])
def test_a_method_keeps_its_promise(method, machine):
    (rotation,) = evaluate(functools.partial(nearest_rotation, method=method), [BATCH.matrices], machine)
    assert_forward_error(rotation, BATCH, within_domain(method, BATCH), bound=LOOSE.get(method, 8))
    if method not in NO_ROTATION:
        assert_within(reference.orthogonality_error(rotation), ORTHOGONALITY * EPS, BATCH.families, "orthogonality")


@on_every_machine
@pytest.mark.parametrize("method", [DEFAULT_METHOD, "quaternion_average", "squaring"])
def test_powers_of_two_change_no_bit(method, machine):
    matrices = np.random.default_rng(0).standard_normal((64, 3, 3)).astype(np.float32)
    function = functools.partial(nearest_rotation, method=method)
    (rotation,) = evaluate(function, [matrices], machine)
    for exponent in (-110, -60, -1, 1, 60, 120):
        (scaled,) = evaluate(function, [np.ldexp(matrices, exponent)], machine)
        np.testing.assert_array_equal(scaled, rotation)


@on_every_machine
@pytest.mark.parametrize("step", STEPS)
def test_a_step_leaves_a_rotation_and_stands_still_at_the_nearest(step, machine):
    starts = BATCH.nearest.astype(np.float32)
    refine = functools.partial(refine_rotation, step=step, iterations=2)
    (rotation,) = evaluate(refine, [BATCH.matrices, starts], machine)
    assert_within(reference.orthogonality_error(rotation), ORTHOGONALITY * EPS, BATCH.families, "orthogonality")
    assert_forward_error(rotation, BATCH, BATCH.condition < 100)


@pytest.mark.usefixtures("form")
@on_every_machine
def test_the_jacobian_and_the_pullback_are_right_and_every_gradient_is_finite(machine):
    where = resolved(BATCH, 1 / (128 * EPS)) & (np.abs(np.log2(SIZE[:, 0, 0])) < 100)
    matrices, names = BATCH.matrices[where], BATCH.families[where]
    exact = analytic_jacobian(matrices)
    size = np.sqrt(np.square(exact).sum((1, 2)))
    bound = 32 * EPS * np.maximum(BATCH.condition[where], 1)
    (jacobian,) = evaluate(jaxrot.rotation_jacobian, [matrices], machine)
    assert_within(np.sqrt(np.square(jacobian - exact).sum((1, 2))) / size, bound, names, "Jacobian")
    cotangent = np.random.default_rng(1).standard_normal(BATCH.matrices.shape).astype(np.float32)
    (gradient,) = evaluate(lambda a, bar: jax.vjp(nearest_rotation, a)[1](bar), [BATCH.matrices, cotangent], machine)
    assert np.isfinite(gradient).all()
    gradient, cotangent = gradient[where], cotangent[where]
    expected = np.einsum("nij,ni->nj", exact, cotangent.reshape(-1, 9).astype(float)).reshape(-1, 3, 3)
    error = np.linalg.norm((gradient - expected).astype(float), axis=(1, 2)) / np.linalg.norm(cotangent, axis=(1, 2))
    assert_within(error / size, bound, names, "pullback")


@on_every_machine
def test_decompositions_make_the_matrix_and_the_gap_is_right(machine):
    rotation, stretch = evaluate(jaxrot.polar_decomposition, [BATCH.matrices], machine)
    left, s, right = evaluate(jaxrot.rotation_variant_svd, [BATCH.matrices], machine)
    for product, promise in (
        (np.einsum("nij,njk->nik", rotation.astype(np.longdouble), stretch), "R S"),
        (np.einsum("nij,nj,nkj->nik", left.astype(np.longdouble), s, right), "U diag(s) Vᵀ"),
    ):
        error = np.sqrt(np.square(((product - BATCH.matrices) / SIZE)[NORMAL]).sum((1, 2)))
        assert_within(error, 32 * EPS, BATCH.families[NORMAL], promise)
    error = np.abs((s - BATCH.singular_values) / SIZE[:, 0])[NORMAL].max(-1)
    assert_within(error, 16 * EPS, BATCH.families[NORMAL], "singular values")
    (gap,) = evaluate(jaxrot.rotation_gap, [BATCH.matrices], machine)
    where = NORMAL & (BATCH.singular_values[:, 0] > 0)
    error = np.abs(gap[where] - 1 / BATCH.condition[where])
    assert_within(error, 32 * EPS, BATCH.families[where], "gap")


UNROLLED = functools.partial(refine_rotation, rotation=np.eye(3, dtype=np.float32), derivative="unrolled")
ACCELERATED = {
    "jit": jax.jit(nearest_rotation),
    "vmap": jax.vmap(nearest_rotation),
    "both": jax.jit(jax.vmap(nearest_rotation)),
    "jacfwd": jax.jit(jax.vmap(jax.jacfwd(nearest_rotation))),
    "jacrev": jax.jit(jax.vmap(jax.jacrev(nearest_rotation))),
    "unrolled": jax.jit(jax.vmap(jax.jacrev(UNROLLED))),
}


@pytest.mark.parametrize("name", mostly_exhaustive(ACCELERATED, "jit", "vmap", "both"))
def test_the_form_for_accelerators_runs_under_transformations(name, monkeypatch):
    matrices = BATCH.matrices[(BATCH.condition < 2) & (np.abs(SIZE[:, 0, 0] - 1) < 0.5)]
    expected = np.asarray(ACCELERATED[name](matrices))
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    jax.clear_caches()
    np.testing.assert_allclose(ACCELERATED[name](matrices), expected, rtol=1e-4, atol=1e-4)
    jax.clear_caches()


def test_the_interpreter_agrees_with_xla_but_for_rounding_and_a_division_that_is_off_is_noticed():
    matrices = BATCH.matrices[NORMAL & (BATCH.condition < 10)]
    (rotation,) = evaluate(nearest_rotation, [matrices], MACHINES["rounded"])
    np.testing.assert_allclose(rotation, nearest_rotation(jnp.asarray(matrices)), atol=16 * EPS)
    ones = np.float32([1, 2, 3])
    (exact,) = evaluate(jnp.divide, [ones, np.float32([3, 3, 7])], MACHINES["rounded"])
    (off,) = evaluate(jnp.divide, [ones, np.float32([3, 3, 7])], MACHINES["2 ulp above"])
    np.testing.assert_array_equal(exact, ones / np.float32([3, 3, 7]))
    assert (off > exact).all()

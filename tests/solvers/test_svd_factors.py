"""`jacobi_svd` and `implicit_qr_svd`: A = U diag(s) Vᵀ with rotations; `svd` and `davenport`: NaN without LAPACK."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from commands import CACHED

from jaxrot import METHODS
from jaxrot._algebra import mat3
from jaxrot._algebra.scaling import safe_divide, scaled
from jaxrot._nearest import solved
from jaxrot.evaluation import reference
from jaxrot.families import FAMILIES, with_non_finite
from jaxrot.solvers import implicit_qr_svd, jacobi_svd

MODULES = pytest.mark.parametrize("module", [jacobi_svd, implicit_qr_svd], ids=["jacobi_svd", "implicit_qr_svd"])


def decompose(module):
    @jax.jit
    def function(matrix):
        m = mat3.components(matrix)
        a = scaled(m)
        left, s, right = module.decompose(a)
        power = safe_divide(mat3.largest_entry(m), mat3.largest_entry(a))
        return mat3.stack(left), jnp.stack(s, axis=-1) * power[..., None], mat3.stack(right)

    return function


@MODULES
def test_the_factors_are_rotations_in_order_and_make_the_matrix(module, dtype):
    # What is subnormal XLA flushes to zero.
    names = [name for name in FAMILIES if name not in ("subnormal", "scale_tiny", "scale_mixed")]
    matrices = np.concatenate([FAMILIES[name].sample(30, dtype=np.dtype(dtype), seed=1).matrices for name in names])
    left, s, right = (np.asarray(x) for x in decompose(module)(matrices))
    eps = np.finfo(dtype).eps
    for factor in (left, right):
        # Not polished, unlike the rotation that `solve` makes of them.
        assert reference.orthogonality_error(factor).max() < 40 * eps
        assert (np.linalg.det(factor) > 0).all()
    assert (s[:, 0] >= s[:, 1]).all()
    assert (s[:, 1] >= np.abs(s[:, 2])).all()
    expected = reference.signed_singular_values(matrices)
    size = expected[:, :1] + np.finfo(dtype).tiny
    assert (np.abs(s - expected) / size).max() < 16 * eps
    product = np.einsum("nij,nj,nkj->nik", left, s.astype(np.longdouble), right)
    assert (np.abs(product - matrices) / size[:, None]).max() < 16 * eps


@MODULES
def test_equal_singular_values_are_sorted_alike_in_both_factors(module):
    """What XLA computes twice it may round differently; 2 of 20,000 such matrices once came out half a turn off."""
    matrices = FAMILIES["scaled_rotation"].sample(20_000, dtype=np.float64, seed=11).matrices
    left, s, right = (np.asarray(x) for x in decompose(module)(matrices))
    product = np.einsum("nij,nj,nkj->nik", left, s, right)
    assert (np.abs(product - matrices).max(axis=(1, 2)) < 1e-13 * s[:, 0]).all()


def test_a_zero_on_the_diagonal_of_the_bidiagonal_matrix_splits_off():
    """a0 = 0: the first column of BᵀB is zero, and an implicit step that starts from it turns nothing."""
    matrix = np.array([[0.0, 1.0, -1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    _, s, _ = decompose(implicit_qr_svd)(matrix)
    golden = (5**0.5 + 1) / 2
    np.testing.assert_allclose(s, [golden, 1 / golden, 0], atol=1e-15)


A = np.random.default_rng(0).standard_normal((9, 3, 3)).astype(np.float32)


@pytest.mark.parametrize(("method", "routine"), [("svd", "svd"), ("davenport", "eigh")])
def test_lapack_gets_finite_matrices_alone(method, routine, monkeypatch):
    original = getattr(jnp.linalg, routine)
    asked = []

    def checking(matrix, **options):
        asked.append(np.isfinite(matrix).all())
        return original(matrix, **options)

    monkeypatch.setattr(jnp.linalg, routine, checking)
    rotation = np.asarray(solved(METHODS[method].solve, jnp.asarray(with_non_finite(A))))
    assert asked == [True]
    np.testing.assert_array_equal(
        np.isnan(rotation).all(axis=(1, 2)), ~np.isfinite(with_non_finite(A)).all(axis=(1, 2))
    )
    clean = np.asarray(solved(METHODS[method].solve, jnp.asarray(A)))
    np.testing.assert_array_equal(rotation[1::3], clean[1::3])


def test_an_infinite_matrix_returns_within_a_time_limit():
    program = """
import jax, jax.numpy as jnp, jaxrot
matrix = jnp.diag(jnp.array([jnp.inf, 1, 1]))
for method in ("svd", "davenport"):
    for function in (jaxrot.nearest_rotation, jax.jacrev(jaxrot.nearest_rotation)):
        assert jnp.isnan(function(matrix, method=method)).all()
"""
    subprocess.run([sys.executable, "-c", program], env=CACHED, check=True, timeout=120)

"""LAPACK may loop for ever on an infinite matrix: NaN comes out, and LAPACK is not asked."""

import subprocess
import sys

import jax.numpy as jnp
import numpy as np
import pytest
from commands import CACHED

from jaxrot import METHODS
from jaxrot._nearest import solved
from jaxrot.families import with_non_finite

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

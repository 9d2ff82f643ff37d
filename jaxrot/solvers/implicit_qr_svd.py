"""The singular value decomposition by bidiagonalisation and implicitly shifted QR sweeps."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from jaxrot._algebra import jacobi, mat3
from jaxrot._algebra.jacobi import givens, rotate, rotate_rows
from jaxrot._algebra.mat3 import Mat3, Vec3
from jaxrot._algebra.scaling import safe_divide, safe_sqrt

# One more than 4e4 matrices of all families needed for 8 eps (1+κ). With two fewer 5 in 1e4 fail.
_SWEEPS = {"float32": 6, "float64": 7}


class _Bidiagonal(NamedTuple):
    """A = leftᵀ B right, B = ((a0, b0, 0), (0, a1, b1), (0, 0, a2)); left and right are kept transposed."""

    a: Vec3
    b: tuple[jax.Array, jax.Array]
    left: Mat3
    right: Mat3


def solve(a: Mat3) -> Mat3:
    """The nearest rotation U Vᵀ from A = U diag(s1, s2, s3) Vᵀ with rotations U and V.

    Returns:
        Rotations, for det A ≤ 0 too: the sign is in s3 and never in U or V.

    Cost: see `decompose`.
    Source: Sarabandi et al. 2020, section V, reference [33]; the determinant is repaired as in `jacobi_svd`.
    """
    left, _, right = decompose(a)
    # Without this step the rounding of some thirty plane rotations adds up to a defect of orthogonality of 42 eps.
    return mat3.newton_schulz(mat3.multiply(left, mat3.transpose(right)))


def decompose(a: Mat3) -> tuple[Mat3, Vec3, Mat3]:
    """The decomposition a = left diag(s) rightᵀ with s1 ≥ s2 ≥ |s3|.

    A becomes a bidiagonal matrix B. A fixed number of QR sweeps on BᵀB, which is never formed, drives one of the two
    off-diagonal entries to zero. A 2×2 decomposition remains. Selects replace the branches of the source: a negligible
    diagonal entry gets the shift zero, and the next sweep splits it off. A sweep over a matrix that has already split
    does nothing.

    Args:
        a: On components, the largest entry between 2 and 4 or zero (`scaled`).

    Returns:
        (left, s, right): left and right rotations, s3 < 0 iff det a < 0.

    Cost: about 1,600 flops, 41 square roots in float32; 170 and five of them a sweep.
    Source: Gast, Fu, Jiang and Teran, "Implicit-shifted symmetric QR singular value decomposition of 3×3 matrices",
    2016; Golub and Kahan 1965; the zero shift: Demmel and Kahan 1990.
    """
    # A smaller entry is rounding.
    negligible = float(jnp.finfo(a[0][0].dtype).eps) * safe_sqrt(mat3.squared_norm(a))
    state = lax.fori_loop(
        0, _SWEEPS[a[0][0].dtype.name], lambda _, state: _sweep(state, negligible), _bidiagonalised(a)
    )
    # The second pass changes nothing. It makes XLA keep the loop, and with it the results; see `ordered_svd`.
    (a0, a1, a2), _, left, right = lax.fori_loop(0, 2, lambda _, state: _last_block(state), state)
    return jacobi.ordered_svd(left, (a0, a1, a2), right)


def _bidiagonalised(a: Mat3) -> _Bidiagonal:
    left = right = mat3.identity_like(a)
    m = a
    for column, i, j in ((0, 1, 2), (0, 0, 1)):
        r = givens(m[i][column], m[j][column])
        m, left = rotate_rows(r, m, i, j), rotate_rows(r, left, i, j)
    r = givens(m[0][1], m[0][2])
    m, right = mat3.transpose(rotate_rows(r, mat3.transpose(m), 1, 2)), rotate_rows(r, right, 1, 2)
    r = givens(m[1][1], m[2][1])
    m, left = rotate_rows(r, m, 1, 2), rotate_rows(r, left, 1, 2)
    return _Bidiagonal((m[0][0], m[1][1], m[2][2]), (m[0][1], m[1][2]), left, right)


def _sweep(state: _Bidiagonal, negligible: jax.Array) -> _Bidiagonal:
    """One implicit QR step on BᵀB − shift: a rotation of two columns, then the bulge is chased out."""
    (a0, a1, a2), (b0, b1), left, right = state
    smallest = jnp.minimum(jnp.minimum(jnp.abs(a0), jnp.abs(a1)), jnp.abs(a2))
    is_singular = smallest <= negligible
    # Without a shift the first column of BᵀB is a0 (a0, b0). If a0 = 0, only its direction determines the rotation.
    x = jnp.where(is_singular, a0, a0 * a0 - _wilkinson_shift(state))
    y = jnp.where(is_singular, b0, a0 * b0)

    r = givens(x, y)
    (a0, b0), (bulge, a1) = rotate(r, a0, b0), rotate(r, jnp.zeros_like(a1), a1)
    right = rotate_rows(r, right, 0, 1)

    r = givens(a0, bulge)
    (a0, _), (b0, a1), (bulge, b1) = rotate(r, a0, bulge), rotate(r, b0, a1), rotate(r, jnp.zeros_like(b1), b1)
    left = rotate_rows(r, left, 0, 1)

    r = givens(b0, bulge)
    (b0, _), (a1, b1), (bulge, a2) = rotate(r, b0, bulge), rotate(r, a1, b1), rotate(r, jnp.zeros_like(a2), a2)
    right = rotate_rows(r, right, 1, 2)

    r = givens(a1, bulge)
    (a1, _), (b1, a2) = rotate(r, a1, bulge), rotate(r, b1, a2)
    left = rotate_rows(r, left, 1, 2)
    # Leave a matrix that has split unchanged: rotations by 0 are not exact, and their rounding adds up.
    has_split = jnp.minimum(jnp.abs(state.b[0]), jnp.abs(state.b[1])) <= negligible
    swept = _Bidiagonal((a0, a1, a2), (b0, b1), left, right)
    return jax.tree.map(lambda old, new: jnp.where(has_split, old, new), state, swept)


def _last_block(state: _Bidiagonal) -> _Bidiagonal:
    """Makes the 2×2 block that is left diagonal; the smaller of b0 and b1 is zero by now.

    If it is b0, the frame is rolled, so that the full block comes first.
    """
    (a0, a1, a2), (b0, b1), left, right = state
    zero = jnp.zeros_like(b0)
    is_last = jnp.abs(b0) < jnp.abs(b1)
    a0, a1, a2 = (jnp.where(is_last, x, y) for x, y in ((a1, a0), (a2, a1), (a0, a2)))
    b0 = jnp.where(is_last, b1, b0)
    left, right = jacobi.rolled(is_last, left), jacobi.rolled(is_last, right)
    by_rows, by_columns = jacobi.svd_2x2(a0, b0, zero, a1)
    (a0, below), (b0, a1) = rotate(by_rows, a0, zero), rotate(by_rows, b0, a1)
    a0, a1 = rotate(by_columns, a0, b0)[0], rotate(by_columns, below, a1)[1]
    left, right = rotate_rows(by_rows, left, 0, 1), rotate_rows(by_columns, right, 0, 1)
    return _Bidiagonal((a0, a1, a2), (zero, zero), left, right)


def _wilkinson_shift(state: _Bidiagonal) -> jax.Array:
    """The eigenvalue of the last 2×2 block of BᵀB that is nearer to its last entry."""
    (_, a1, a2), (b0, b1), _, _ = state
    last = a2 * a2 + b1 * b1
    half = (a1 * a1 + b0 * b0 - last) * 0.5
    coupling = a1 * b1
    root = jnp.sqrt(half * half + coupling * coupling)
    return last - safe_divide(coupling * coupling, jnp.where(half < 0, half - root, half + root))

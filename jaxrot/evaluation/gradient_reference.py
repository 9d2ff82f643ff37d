"""The derivative of the nearest rotation in arithmetic wider than float64."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jaxrot.evaluation.reference import Reference, solve


def pullback(matrices: ArrayLike, rotation_bar: ArrayLike, *, reference: Reference | None = None) -> NDArray:
    """Returns the cotangent of A for a cotangent of R: the derivative of ⟨R̄, R(A)⟩ with respect to A.

    It is R [h]× with h = (tr(S)·1 − S)⁻¹ vee(RᵀR̄ − R̄ᵀR), S = RᵀA. The eigenvalues of the inverted matrix are the sums
    of two singular values.

    Args:
        matrices: A, shape (n, 3, 3).
        rotation_bar: R̄, the same shape.
        reference: `solve(matrices)`, if known.

    Returns:
        Long double, shape (n, 3, 3); NaN if A is not finite, not finite if R is not unique.
    """
    solution = solve(matrices) if reference is None else reference
    bar = np.asarray(rotation_bar, np.longdouble)
    turned = np.einsum("nki,nkj->nij", solution.rotation, bar)
    x, y, z = (turned[:, j, i] - turned[:, i, j] for i, j in ((1, 2), (2, 0), (0, 1)))
    s1, s2, s3 = solution.singular_values.T
    gaps = np.stack([s2 + s3, s1 + s3, s1 + s2], axis=1)
    about_axes = np.einsum("nik,ni->nk", solution.right, np.stack([x, y, z], axis=1))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        h = np.einsum("nik,nk->ni", solution.right, about_axes / gaps)
    zero = np.zeros_like(h[:, 0])
    rows = [[zero, -h[:, 2], h[:, 1]], [h[:, 2], zero, -h[:, 0]], [-h[:, 1], h[:, 0], zero]]
    cross = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
    return np.einsum("nij,njk->nik", solution.rotation, cross)

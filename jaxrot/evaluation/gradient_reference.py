"""The derivative of the nearest rotation in arithmetic wider than float64."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jaxrot.evaluation.reference import Reference, solve


def pullback(matrices: ArrayLike, rotation_bar: ArrayLike, *, reference: Reference | None = None) -> NDArray:
    """Returns the cotangent of A for a cotangent of R: the derivative of ⟨R̄, R(A)⟩ with respect to A.

    It is R [h]× with h = (tr(S)·1 − S)⁻¹ vee(RᵀR̄ − R̄ᵀR), S = RᵀA. The eigenvalues of the inverted matrix are the sums
    of two singular values. All have the shape (n, 3, 3). The result is NaN if A is not finite, and not finite if R is
    not unique. `reference` is `solve(matrices)`, if known.
    """
    solution = solve(matrices) if reference is None else reference
    bar = np.asarray(rotation_bar, np.longdouble)
    turned = np.swapaxes(solution.rotation, 1, 2) @ bar
    torque = np.stack([turned[:, i - 1, i - 2] - turned[:, i - 2, i - 1] for i in range(3)], axis=1)
    s1, s2, s3 = solution.singular_values.T
    gaps = np.stack([s2 + s3, s1 + s3, s1 + s2], axis=1)
    about_axes = np.einsum("nik,ni->nk", solution.right, torque)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        h = np.einsum("nik,nk->ni", solution.right, about_axes / gaps)
        # The rows of R [h]× are the vector products of the rows of R and h.
        return np.cross(solution.rotation, h[:, None])

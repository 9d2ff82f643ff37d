"""Named families of 3×3 matrices with known singular values, ordinary, extreme and adversarial.

notation: s are the signed singular values s1 >= s2 >= |s3|, with s3 < 0 iff the determinant is negative. R is the
nearest rotation, kappa = s1 / (s2 + s3) its condition number, and eps = finfo(dtype).eps.
"""

import zlib
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from jaxrot._frozen import FrozenMapping

LARGE_BATCH = 32_769  # jaxlib 0.10.2 on CPU gives wrong numbers for some fused reductions from here on (jax#39103)


class Sample(NamedTuple):
    """Matrices of one family, and their singular values.

    Attributes:
        matrices: Shape (count, 3, 3), in the requested dtype.
        singular_values: Shape (count, 3), float64, signed. Prescribed, before the rounding that moves them by at most
            2 eps s1, or from LAPACK, within 18 float64 eps s1. NaN where the matrix is not finite.
    """

    matrices: NDArray[np.floating]
    singular_values: NDArray[np.float64]


class _Draw(NamedTuple):
    """The random numbers of a recipe. Every method draws one number or matrix for each matrix of the sample."""

    size: int
    dtype: np.dtype
    random: np.random.Generator

    @property
    def eps(self) -> float:
        return float(np.finfo(self.dtype).eps)

    def uniform(self, low: float, high: float) -> NDArray:
        return self.random.uniform(low, high, self.size)

    def log_uniform(self, low: float, high: float) -> NDArray:
        return np.exp(self.uniform(np.log(low), np.log(high)))

    def signed(self, low: float, high: float) -> NDArray:
        return self.random.choice((-1.0, 1.0), self.size) * self.log_uniform(low, high)

    def gaussian(self) -> NDArray:
        return self.random.standard_normal((self.size, 3, 3))

    def signed_permutations(self) -> NDArray:
        order = self.random.permuted(np.tile(np.arange(3), (self.size, 1)), axis=1)
        return np.eye(3)[order] * self.random.choice((-1.0, 1.0), (self.size, 3, 1))

    def rotations(self) -> NDArray[np.longdouble]:
        return _rotation_from_quaternion(self.random.standard_normal((4, self.size)))


class Family(NamedTuple):
    """A named family. `recipe` draws matrices, or the three entries of s in U diag(s) Vᵀ, or both, for each dtype."""

    name: str
    description: str
    recipe: Callable[[_Draw], NDArray | tuple | Sample]

    def sample(self, count: int, dtype: DTypeLike = np.float32, seed: int = 0) -> Sample:
        """Returns `count` ≥ 0 matrices in float32 or float64, the same ones for the same arguments."""
        dtype = np.dtype(dtype)
        if dtype not in (np.float32, np.float64):
            raise TypeError(f"dtype must be float32 or float64, got {dtype}")
        # The name in the seed: no two families share random numbers.
        draw = _Draw(count, dtype, np.random.default_rng([seed, zlib.crc32(self.name.encode())]))
        drawn = self.recipe(draw)
        if isinstance(drawn, Sample):
            return drawn
        if isinstance(drawn, tuple):
            return _composed(draw.rotations(), drawn, draw.rotations(), draw)
        rounded = np.broadcast_to(drawn, (count, 3, 3)).astype(dtype)
        is_finite = np.isfinite(rounded).all(axis=(1, 2))[:, None]  # LAPACK may never return from an infinity
        left, values, right = np.linalg.svd(np.where(is_finite[..., None], rounded, 0).astype(np.float64))
        values[:, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))  # det A itself could underflow
        return Sample(rounded, np.where(is_finite, values, np.nan))


def half_turn_starts(rotations: ArrayLike, axes: ArrayLike | None = None) -> NDArray[np.floating]:
    """Returns rotations half a turn from R about a principal axis of RᵀA, where the torque is 0, and starts near them.

    Args:
        rotations: The nearest rotations R, shape (..., 3, 3), float32 or float64.
        axes: The principal axes in the columns, shape (..., 3, 3); by default those of A = R diag(s).

    Returns:
        Shape (9, ..., 3, 3): exactly 180° about each axis, then the same turned by +eps and by -eps about all axes.

    Example:
        >>> half_turn_starts(np.eye(3))[0].diagonal().tolist()
        [1.0, -1.0, -1.0]

    Source: Müller et al. 2016, eq. (8) and below, which considers only maxima; some of these points are saddles.
    """
    rotations = np.asarray(rotations)
    axes = np.eye(3, dtype=np.longdouble) if axes is None else np.asarray(axes, np.longdouble)
    turn = float(np.finfo(rotations.dtype).eps) * np.array([[0, -1, 1], [1, 0, -1], [-1, 1, 0]])
    starts = [
        np.einsum("...ij,...jk,kl,...ml->...im", rotations, axes, (2 * np.diag(unit) - np.eye(3)) @ slight, axes)
        for slight in (np.eye(3), np.eye(3) + turn, np.eye(3) - turn)
        for unit in np.eye(3)
    ]
    return np.stack(starts).astype(rotations.dtype)


def with_non_finite(matrices: ArrayLike, seed: int = 0) -> NDArray[np.floating]:
    """Returns a copy of a batch (count, 3, 3) with NaN, inf or -inf in one random entry of every third matrix.

    Example:
        >>> np.isfinite(with_non_finite(np.ones((4, 3, 3)))).all(axis=(1, 2)).tolist()
        [False, True, True, False]
    """
    changed = np.array(matrices)
    matrix = np.arange(0, len(changed), 3)
    row, column = np.random.default_rng(seed).integers(0, 3, (2, len(matrix)))
    changed[matrix, row, column] = np.resize((np.nan, np.inf, -np.inf), len(matrix))
    return changed


def _rotation_from_quaternion(wxyz: ArrayLike) -> NDArray[np.longdouble]:
    """Rotations from quaternions of any length but 0, shape (4, count), orthogonal up to rounding in long double."""
    w, x, y, z = np.asarray(wxyz, np.longdouble)
    s = 2 / (w * w + x * x + y * y + z * z)
    rows = (
        (1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        (s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)),
        (s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)),
    )
    return np.stack([np.stack(row, -1) for row in rows], -2)


def _composed(left: NDArray, diagonal: tuple, right: NDArray, draw: _Draw) -> Sample:
    """U diag(s) Vᵀ, computed in long double and rounded once; s in any order and with any signs."""
    entries = np.stack([np.broadcast_to(np.asarray(s, np.longdouble), draw.size) for s in diagonal], -1)
    values = -np.sort(-np.abs(entries), axis=-1)
    values[:, 2] *= np.where((entries < 0).sum(-1) % 2, -1, 1)
    matrices = np.einsum("nij,nj,nkj->nik", left, entries, right)
    return Sample(matrices.astype(draw.dtype), values.astype(np.float64))


def _scaled(draw: _Draw, float32: ArrayLike, float64: ArrayLike) -> tuple:
    """Well-conditioned spectra, half of them inverted, that cycle through the scales given for the dtype."""
    scale = np.resize(np.asarray(float32 if draw.dtype == np.float32 else float64, np.longdouble), draw.size)
    return scale, scale * draw.uniform(0.5, 1), scale * draw.signed(0.1, 0.4)


def _subnormal(draw: _Draw) -> tuple:
    """Spectra from half the smallest normal number down to 16 times the smallest subnormal one, which keeps 4 bits."""
    scale = float(np.finfo(draw.dtype).smallest_normal) * draw.log_uniform(16 * draw.eps, 0.5)
    return _scaled(draw, scale, scale)


def _noisy(draw: _Draw, noise: ArrayLike, sign: int = 1) -> NDArray:
    """Q or -Q, a rotation, with uniform noise in ±noise on every entry, as in Sarabandi et al. 2020."""
    return sign * draw.rotations() + np.reshape(noise, (-1, 1, 1)) * draw.random.uniform(-1, 1, (draw.size, 3, 3))


def _with_gap(draw: _Draw, gap: NDArray) -> tuple:
    """Spectra with s1 = 1 and s2 + s3 = gap, s2 uniform over all possible values."""
    s2 = gap / 2 + (1 - gap / 2) * draw.uniform(0, 1)
    return 1, s2, np.asarray(gap, np.longdouble) - s2


def _inverted(matrices: NDArray) -> NDArray:
    """Of each matrix and its negative the one with a negative determinant."""
    return matrices * -np.sign(np.linalg.det(matrices))[:, None, None]


def _sparse_inverted(draw: _Draw) -> NDArray:
    """A signed permutation with magnitudes over five decades and one more entry, its determinant negative."""
    matrices = draw.signed_permutations() * 10.0 ** draw.random.uniform(-5, 0, (draw.size, 3, 1))
    return _inverted(matrices + draw.signed_permutations() * (1, 0, 0) * draw.log_uniform(1e-5, 1)[:, None, None])


def _across_the_boundary(draw: _Draw) -> Sample:
    """Neighbours 2k, 2k+1 share U, V and t, and lie on either side of s2 + s3 = 0, where R jumps by half a turn."""
    half = draw._replace(size=(draw.size + 1) // 2)
    gap, t = half.log_uniform(draw.eps / 64, 0.1), half.uniform(0.1, 1)
    left, right, gap, t = (np.repeat(a, 2, 0)[: draw.size] for a in (half.rotations(), half.rotations(), gap, t))
    return _composed(left, (1, t, np.resize((1, -1), draw.size) * gap.astype(np.longdouble) - t), right, draw)


def _near_half_turn(draw: _Draw) -> Sample:
    """Rot(n, 180° - angle) times a stretch; the angle is 0 in every third matrix, or log-uniform down to eps / 8."""
    angle = draw.log_uniform(draw.eps / 8, 0.01) * (np.arange(draw.size) % 3 > 0)
    x, y, z = draw.random.standard_normal((3, draw.size))
    turn = _rotation_from_quaternion((np.sqrt(x * x + y * y + z * z) * np.tan(angle / 2), x, y, z))
    axes = draw.rotations()
    return _composed(turn @ axes, (1, draw.uniform(0.3, 1), draw.uniform(-0.2, 0.3)), axes, draw)


_RECIPES: dict[str, tuple[str, Callable[[_Draw], NDArray | tuple | Sample]]] = {
    "gaussian": ("standard normal entries, half of them inverted", _Draw.gaussian),
    "rotation": ("rotations, rounded", lambda d: (1, 1, 1)),
    "drifted_rotation": ("rotations off by eps to 1e-2", lambda d: _noisy(d, d.log_uniform(d.eps, 0.01))),
    "noisy_rotation_0.1": ("uniform noise in ±0.1", lambda d: _noisy(d, 0.1)),
    "noisy_rotation_0.3": ("uniform noise in ±0.3", lambda d: _noisy(d, 0.3)),
    "noisy_rotation_0.5": ("uniform noise in ±0.5, where inversion begins", lambda d: _noisy(d, 0.5)),
    "scaled_rotation": ("c R, c from 1e-3 to 1e3", lambda d: (d.log_uniform(1e-3, 1e3),) * 3),
    "equal_large": ("(1, 1, t), t from 1 to -0.9: an element turned inside out", lambda d: (1, 1, d.uniform(-0.9, 1))),
    "equal_small": ("(1, t, t)", lambda d: (1, t := d.log_uniform(1e-3, 1), t)),
    "log_uniform": ("decades alike, to rank 1", lambda d: (1, d.log_uniform(d.eps, 1), d.signed(d.eps, 1))),
    "zero": ("every rotation is nearest", lambda d: np.zeros((3, 3))),
    "identity": ("1", lambda d: np.eye(3)),
    "minus_identity": ("-1, every half turn is nearest", lambda d: -np.eye(3)),
    "reflection": ("diag(1, 1, -1), R not unique", lambda d: np.diag((1, 1, -1))),
    "half_turn": ("diag(1, -1, -1)", lambda d: np.diag((1, -1, -1))),
    "swap": ("Müller et al. 2016, eq. (8), a half turn", lambda d: np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])),
    "signed_permutation": ("the 48 symmetries of the cube", _Draw.signed_permutations),
    "small_integers": ("-1, 0, 1: exact ties, exact low rank", lambda d: d.random.integers(-1, 2, (d.size, 3, 3))),
    "rank_one": ("(1, 0, 0), R free about one axis", lambda d: (1, 0, 0)),
    "single_entry": ("one non-zero entry, ±1", lambda d: d.signed_permutations() * (1, 0, 0)),
    "rank_two": ("(1, t, 0), R unique", lambda d: (1, d.uniform(0.01, 1), 0)),
    "planar": ("a shape in the plane z = 0: a zero column", lambda d: d.gaussian() * (1, 1, 0)),
    "planar_motion": ("it moves in the plane: a zero row too", lambda d: d.gaussian() * np.outer((1, 1, 0), (1, 1, 0))),
    "needle": ("kappa to 1/(8 eps)", lambda d: (1, t := d.log_uniform(8 * d.eps, 1), t * d.uniform(0, 1))),
    "stretch_1e7": ("(1e7, s2, s3), s2, s3 about 1", lambda d: (1e7, d.uniform(0.5, 1.5), d.uniform(0.5, 1.5))),
    "ill_conditioned": ("kappa from 1 to 1/(8 eps)", lambda d: _with_gap(d, d.log_uniform(8 * d.eps, 1))),
    "nearly_not_unique": ("kappa 1/(64 eps) to 16/eps", lambda d: _with_gap(d, d.log_uniform(d.eps / 16, 64 * d.eps))),
    "vanishing_gap": ("s2 + s3 from 0.1 to eps/64, on both sides of 0", _across_the_boundary),
    "vanishing_rank": ("s2, s3 to eps/64", lambda d: (1, d.log_uniform(d.eps / 64, 0.1), d.signed(d.eps / 64, 0.1))),
    "exact_tie": ("(1, 0.3, -0.3) to the last bit", lambda d: _inverted(d.signed_permutations() * (1, 0.3, 0.3))),
    "near_tie": ("(1, 0.5, -0.4999)", lambda d: (1, 0.5, -0.4999)),
    "minus_rotation": ("-Q, every half turn from Q is nearest", lambda d: (-1, -1, -1)),
    "minus_rotation_1e-1": ("-Q and uniform noise in ±1e-1", lambda d: _noisy(d, 1e-1, -1)),
    "minus_rotation_1e-2": ("-Q and uniform noise in ±1e-2", lambda d: _noisy(d, 1e-2, -1)),
    "minus_rotation_1e-4": ("-Q and uniform noise in ±1e-4", lambda d: _noisy(d, 1e-4, -1)),
    "minus_rotation_graded": ("-Q and noise from 1 to eps/8", lambda d: _noisy(d, d.log_uniform(d.eps / 8, 1), -1)),
    "sparse_inverted": ("a scaled signed permutation and one entry more", _sparse_inverted),
    "near_half_turn": ("R turns by 180° or nearly: the w of its quaternion is about 0", _near_half_turn),
    "scale_large": ("1e20, in float64 1e150 too", lambda d: _scaled(d, 1e20, (1e20, 1e150))),
    "scale_small": ("1e-20, in float64 1e-150 too", lambda d: _scaled(d, 1e-20, (1e-20, 1e-150))),
    "scale_huge": ("to the largest numbers", lambda d: _scaled(d, (1e38, 3e38), (1e38, 1e300, 1e308))),
    "scale_tiny": ("to the smallest normal numbers", lambda d: _scaled(d, 1e-38, (1e-38, 1e-300, 1e-307))),
    "scale_mixed": ("1e±30", lambda d: _scaled(d, *2 * (d.log_uniform(1e-30, 1e30),))),
    "subnormal": ("every entry below the smallest normal number", _subnormal),
}

FAMILIES: Mapping[str, Family] = FrozenMapping({name: Family(name, *rest) for name, rest in _RECIPES.items()})

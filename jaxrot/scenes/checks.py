"""Checks of the arguments of scenes."""

from collections.abc import Sequence

import numpy as np
from jax.typing import ArrayLike

# The limit for a vertex, in any unit. Volumes of larger bodies overflow in float64, and LAPACK may hang on an infinity.
LARGEST_COORDINATE = 1e100

_RULES = {
    "finite and > 0": lambda values: np.isfinite(values) & (values > 0),
    "finite and >= 0": lambda values: np.isfinite(values) & (values >= 0),
    "from 0 to 1": lambda values: (values >= 0) & (values <= 1),
    "finite": np.isfinite,
}


def check(rule: str, **values: ArrayLike) -> None:
    """Raises a ValueError that names the first of the numbers or arrays that breaks a rule, and its first wrong entry.

    Args:
        rule: What all entries must be, a key of `_RULES`.
        values: By the name of the argument.
    """
    for name, value in values.items():
        entries = np.asarray(value, dtype=np.float64)
        wrong = entries[~_RULES[rule](entries)]
        if wrong.size:
            raise ValueError(f"{name} must be {rule}; got {wrong.flat[0]}")


def check_gravity(gravity: Sequence[float] | np.ndarray) -> None:
    """Raises a ValueError if this is not a finite vector."""
    if np.shape(gravity) != (3,) or not np.isfinite(np.asarray(gravity)).all():
        raise ValueError(f"gravity must be three finite numbers; got {gravity}")


def checked_vertices(vertices: ArrayLike, name: str = "vertices") -> np.ndarray:
    """Returns the vertices as float64 of shape (n, 3), or raises a ValueError."""
    checked = np.asarray(vertices, dtype=np.float64)
    if checked.ndim != 2 or checked.shape[1] != 3 or not len(checked):
        raise ValueError(f"{name} must have shape (n, 3), n > 0; got shape {checked.shape}")
    bad = np.flatnonzero(~np.isfinite(checked).all(axis=1))
    if len(bad):
        raise ValueError(f"{name} must be finite; vertex {bad[0]} is {checked[bad[0]].tolist()}")
    if np.abs(checked).max() > LARGEST_COORDINATE:
        raise ValueError(
            f"{name} must be at most {LARGEST_COORDINATE:g} from the origin; got {np.abs(checked).max():.3g}"
        )
    return checked

"""The periodic body rates of a free, asymmetric top."""

import numpy as np
from numpy.typing import ArrayLike

_SUBSTEPS = 8


def tumbling_rates(inertia: ArrayLike, rates: ArrayLike, period_steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the body rates over one period of Euler's equations I ω' = (I ω) × ω without torque.

    Args:
        inertia: Principal moments, ascending, shape (3,), kg m².
        rates: Body rates ω at the start, shape (..., 3), rad/s.
        period_steps: The number of steps in a period, 8 or more.

    Returns:
        The rates in the middle of every step, shape (period_steps, ..., 3), rad/s, and the time step, shape (...), s.

    Raises:
        ValueError: Moments that are not finite, positive and different; rates that are not finite; a spin without a
            period, about a principal axis or on the separatrix; too few steps.

    Source: Landau and Lifshitz, Mechanics, section 37, for the period.
    """
    moments, w = np.asarray(inertia, dtype=np.float64), np.asarray(rates, dtype=np.float64)
    if moments.shape != (3,) or not np.all(np.isfinite(moments)) or not 0 < moments[0] < moments[1] < moments[2]:
        raise ValueError(f"inertia must be three finite, positive, ascending moments; got {inertia}")
    if w.shape[-1:] != (3,) or not np.all(np.isfinite(w)):
        raise ValueError(f"rates must be finite, of shape (..., 3); got shape {w.shape}")
    if period_steps < 8:
        raise ValueError(f"period_steps must be 8 or more; got {period_steps}")
    time_step = _period(moments, w) / period_steps
    h = time_step[..., None] / (2 * _SUBSTEPS)
    middles = []
    for half_step in range(2 * period_steps):
        if half_step % 2:
            middles.append(w)
        for _ in range(_SUBSTEPS):
            w = _runge_kutta(moments, w, h)
    return np.stack(middles), time_step


def _period(moments: np.ndarray, w: np.ndarray) -> np.ndarray:
    twice_energy, momentum = np.sum(moments * w**2, axis=-1), np.sum((moments * w) ** 2, axis=-1)
    low, high = momentum - twice_energy * moments[0], twice_energy * moments[2] - momentum
    middle = momentum - twice_energy * moments[1]
    # The rates circle about one of the two stable axes, which decides the roles of the moments.
    gaps = np.diff(moments)
    numerator = np.where(middle >= 0, gaps[0] * high, gaps[1] * low)
    denominator = np.where(middle >= 0, gaps[1] * low, gaps[0] * high)
    modulus = numerator / np.where(denominator == 0, 1, denominator)
    if not np.all((modulus > 0) & (modulus < 1)):
        raise ValueError("rates must be about no principal axis and not on the separatrix: there is no period")
    # The complete elliptic integral by the arithmetic-geometric mean.
    a, b = np.ones_like(modulus), np.sqrt(1 - modulus)
    for _ in range(8):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return 4 * np.pi / (2 * a) * np.sqrt(np.prod(moments) / denominator)


def _runge_kutta(moments: np.ndarray, w: np.ndarray, h: np.ndarray) -> np.ndarray:
    def change(rate: np.ndarray) -> np.ndarray:
        return np.cross(moments * rate, rate) / moments

    first = change(w)
    second = change(w + h / 2 * first)
    third = change(w + h / 2 * second)
    return w + h / 6 * (first + 2 * second + 2 * third + change(w + h * third))

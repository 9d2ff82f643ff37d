"""How machines divide and take roots in float32, what they do to subnormal numbers, and whether they fuse a·b + c.

IEEE 754 fixes all of that; accelerators keep to it for sums and products only. An error depends on the mantissas of the
operands, as in a machine: the same operands give the same result, at every scale.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
TINY = np.finfo(np.float32).tiny


@dataclasses.dataclass(frozen=True)
class Machine:
    """One arithmetic.

    Attributes:
        divide: a / b.
        root: √x.
        flushes: Subnormal operands and results are 0.
        fuses: A sum with a product keeps the product unrounded.
    """

    divide: Callable[[Floats, Floats], Floats] = np.divide
    root: Callable[[Floats], Floats] = np.sqrt
    flushes: bool = False
    fuses: bool = False

    def flush(self, x: np.ndarray) -> np.ndarray:
        """x, or 0 with its sign where x is subnormal and the machine has no such numbers."""
        if not self.flushes or x.dtype != np.float32:
            return x
        return np.where(np.abs(x) < TINY, np.copysign(np.float32(0), x), x)


def noise(*operands: Floats) -> NDArray[np.float64]:
    """A number between −1 and 1 that depends on the mantissas of the operands."""
    mixed = np.uint32(0)
    for x in operands:
        mantissa = np.ascontiguousarray(x, np.float32).view(np.uint32) & np.uint32(0x7FFFFF)
        mixed = (mantissa ^ mixed) * np.uint32(2654435761)
        mixed = (mixed ^ mixed >> np.uint32(15)) * np.uint32(2246822519)
        mixed = mixed ^ mixed >> np.uint32(13)
    return mixed.astype(np.float64) / 2.0**31 - 1


def moved(x: Floats, ulps: NDArray[np.float64]) -> Floats:
    """x, so many units in the last place further from zero; 0, infinity and NaN stay."""
    step = np.spacing(np.abs(x)).astype(np.float64)
    with np.errstate(over="ignore"):
        return np.where(np.isfinite(x) & (x != 0), x + np.sign(x) * np.rint(ulps) * step, x).astype(np.float32)


def _ordinary(a: Floats, b: Floats, product: np.ndarray) -> Floats:
    usual = np.isfinite(a) & np.isfinite(b) & (a != 0) & (b != 0)
    return np.where(usual, product.astype(np.float32), a / b)


def _by_reciprocal(a: Floats, b: Floats) -> Floats:
    """div.full of the PTX manual: a times 1/b to 1 ulp, of any exponent, because the hardware scales it."""
    mantissa, exponent = np.frexp(1 / b.astype(np.float64))
    off = np.where(np.abs(mantissa) == 0.5, 0, 1) * noise(b)
    return _ordinary(a, b, a.astype(np.float64) * np.ldexp(moved(mantissa.astype(np.float32), off), exponent))


def _by_estimate(a: Floats, b: Floats) -> Floats:
    """The TPU v5e's: an estimate of 1/b good to 2⁻¹⁴, one Newton step, and a product, all of them flushed."""
    flush = Machine(flushes=True).flush
    guess = flush(((1 / b.astype(np.float64)) * (1 + noise(b) * 2.0**-14)).astype(np.float32))
    refined = flush(guess + flush(guess * flush(1 - flush(guess * b))))
    return flush(_ordinary(a, b, a * np.where(guess == 0, guess, refined)))


def _root_by_estimate(x: Floats) -> Floats:
    """The TPU v5e's: x times an estimate of 1/√x good to 2⁻¹⁴ after a Newton step."""
    guess = ((1 / np.sqrt(x.astype(np.float64))) * (1 + noise(x) * 2.0**-14)).astype(np.float32)
    half = np.float32(0.5)
    refined = guess * (np.float32(1.5) - half * (x * guess) * guess)
    return np.where((x > 0) & np.isfinite(x), x * refined, np.sqrt(x))


MACHINES = {
    "rounded": Machine(),
    "fused": Machine(fuses=True),
    "flushed": Machine(flushes=True),
    "2 ulp off": Machine(
        divide=lambda a, b: moved(a / b, 2.49 * noise(a, b)), root=lambda x: moved(np.sqrt(x), 2.49 * noise(x))
    ),
    "2 ulp above": Machine(
        divide=lambda a, b: moved(a / b, np.full(np.broadcast(a, b).shape, 2.0)),
        root=lambda x: moved(np.sqrt(x), np.full(x.shape, 2.0)),
    ),
    "reciprocals": Machine(divide=_by_reciprocal, root=lambda x: moved(np.sqrt(x), noise(x))),
    "estimates": Machine(divide=_by_estimate, root=_root_by_estimate, flushes=True),
}

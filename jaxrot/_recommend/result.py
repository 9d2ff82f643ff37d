"""The result of `recommend`, and its summary in words."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax

from jaxrot._recommend.candidates import Candidate
from jaxrot.evaluation.formatting import listed, number
from jaxrot.solvers import DEFAULT_METHOD


class Recommendation(NamedTuple):
    """The recommended method or step, its measurements, and the alternatives.

    Every method, and with `previous` every step, occurs once: it is recommended, or in `runners_up`, `too_inaccurate`
    or `excluded`.

    Attributes:
        name: The method, or the step and the number of iterations.
        method: A name in `METHODS`, or None for a step.
        step: A name in `STEPS`, or None for a method.
        iterations: Number of steps, or None for a method.
        apply: The function to call, from matrices (..., 3, 3) to rotations; with `previous` also from the previous
            rotations. It computes in the dtype of its matrices.
        meets: The error is at most tolerance / margin.
        error: The largest error ‖R − R*‖_F on the sample; R* is computed in wider arithmetic.
        time_ns: Median time a matrix in ns, in batches of `batch`.
        time_quartiles_ns: The quartiles of that time.
        tolerance: As given.
        margin: Divides the tolerance.
        dtype: Of the computation, "float32" or "float64".
        batch: Matrices in a timed call.
        sample: Matrices whose error was measured.
        given: Matrices given.
        not_finite: Matrices left out because they or their starts hold NaN or inf.
        undetermined: Matrices of the sample whose R* is not determined: κ ≥ 1/(8 eps), or R depends on subnormal
            entries. There R must be a rotation and lose no more trace tr(RᵀA) than an error of tolerance / margin
            could, up to rounding.
        runners_up: Other candidates that meet the tolerance, the fastest first.
        too_inaccurate: Candidates that do not, the smallest error first; not timed.
        excluded: Methods, and steps with "steps" after the name, that are not for these matrices, with the reason.
    """

    name: str
    method: str | None
    step: str | None
    iterations: int | None
    apply: Callable[..., jax.Array]
    meets: bool
    error: float
    time_ns: float
    time_quartiles_ns: tuple[float, float]
    tolerance: float
    margin: float
    dtype: str
    batch: int
    sample: int
    given: int
    not_finite: int
    undetermined: int
    runners_up: tuple[Candidate, ...]
    too_inaccurate: tuple[Candidate, ...]
    excluded: Mapping[str, str]

    @property
    def statement(self) -> str:
        """The recommendation in a few sentences."""
        return " ".join([self._verdict(), *self._details()])

    def _verdict(self) -> str:
        finite = self.given - self.not_finite
        count = _matrices(self.sample) if self.sample == finite else f"{self.sample:,} of {_matrices(finite)}"
        low, high = self.time_quartiles_ns
        time = f"{number(self.time_ns)} ns a matrix ({number(low)}-{number(high)}) in batches of {self.batch:,}"
        bound = f"at most 1/{self.margin:g} of it"
        if self.meets:
            error = f"its largest error is {number(self.error)}, {bound}"
            if self.undetermined == self.sample:
                error = "no error is defined on them"
            return (
                f"{self.name} is the cheapest that meets the tolerance {number(self.tolerance)} on {count} in"
                f" {self.dtype}: {error}, and it takes {time}."
            )
        text = (
            f"Nothing meets the tolerance {number(self.tolerance)} on {count} in {self.dtype}, with a largest error of"
            f" {bound}. {self.name} comes nearest: its largest error is {number(self.error)}, and it takes {time}."
        )
        return text + (" That is within the tolerance, but without the margin." if self.error <= self.tolerance else "")

    def _details(self) -> list[str]:
        sentences = []
        if faster := [each.name for each in self.runners_up if each.time_ns < self.time_ns]:
            sentences.append(
                f"{listed(faster)} had a smaller median time, but the difference is within the spread, and"
                f" {self.name} has the smallest error."
            )
        default = [each.time_ns for each in self.runners_up if each.name == DEFAULT_METHOD]
        sentences += [f"The default, {DEFAULT_METHOD}, takes {number(time_ns)} ns." for time_ns in default]
        if self.excluded:
            shown = list(self.excluded)[:4]
            if len(self.excluded) > 4:
                shown.append(f"{len(self.excluded) - 4} more")
            sentences.append(
                f"Not considered, because their declared domain does not hold these matrices: {listed(shown)}."
            )
        if self.not_finite:
            sentences.append(
                f"{self.not_finite:,} of {_matrices(self.given)} left out: NaN or infinity in the matrix or its start."
            )
        if self.undetermined:
            sentences.append(
                f"The nearest rotation of {_matrices(self.undetermined)} is not determined: there every rotation that"
                " loses no trace tr(RᵀA) counts as right."
            )
        return sentences


def _matrices(count: int) -> str:
    return f"{count:,} {'matrix' if count == 1 else 'matrices'}"

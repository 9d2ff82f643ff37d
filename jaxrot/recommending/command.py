"""`python -m jaxrot recommend`: its options and their checks, and what it prints."""

import argparse
import math
import textwrap
from pathlib import Path

import numpy as np

from jaxrot import Recommendation
from jaxrot._recommend.candidates import Candidate
from jaxrot._recommend.recommend import recommend_step_by_step
from jaxrot.console.arguments import path
from jaxrot.console.environment import describe_environment, measuring_configuration
from jaxrot.console.errors import UserError, shown
from jaxrot.console.interrupts import Interrupts
from jaxrot.console.printing import show
from jaxrot.console.progress import check_installed, progress
from jaxrot.console.tables import Table, as_text
from jaxrot.evaluation.formatting import number
from jaxrot.report.inputs import Input, read_input

_DTYPES = ("float32", "float64")
_WIDTH = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options of a recommendation."""
    parser.add_argument("file", type=path, metavar="FILE", help="matrices like yours: .npy or .npz, (..., 3, 3)")
    parser.add_argument(
        "--tolerance", metavar="E", required=True, help="the largest error ‖R - R*‖_F that is good enough, 1e-5 say"
    )
    parser.add_argument(
        "--previous", type=path, metavar="FILE", help="starting rotations, one per matrix, such as the last frame's"
    )
    parser.add_argument(
        "--dtype", metavar="DTYPE", help=f"{' or '.join(_DTYPES)} (float64 where FILE holds float64, else float32)"
    )


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Measures and prints. Mistakes of the user are found before anything is measured.

    Returns:
        The exit status: 0, even if no method meets the tolerance. The text says so.
    """
    tolerance = _parse_tolerance(options.tolerance)
    if options.dtype not in (None, *_DTYPES):
        raise UserError(f"--dtype {shown(options.dtype)}: expected one of {', '.join(_DTYPES)}")
    check_installed([], "report")
    given = read_input(options.file, "FILE")
    matrices = np.concatenate(list(given.sets.values()))
    previous = None if options.previous is None else _read_previous(options.previous, given)
    dtype = options.dtype or given.dtype
    environment = describe_environment((dtype,))
    with measuring_configuration(), progress(interrupts) as say:
        try:
            with np.errstate(over="ignore", under="ignore"):
                result = recommend_step_by_step(matrices, tolerance, previous, dtype, say)
        except ValueError as error:
            # The content of the file is checked before anything is measured.
            raise UserError(str(error)) from None
    interrupts.hold()
    show(_as_text(result, given, environment))
    return 0


def _parse_tolerance(word: str) -> float:
    try:
        tolerance = float(word)
    except ValueError:
        tolerance = math.nan
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise UserError(f"--tolerance {shown(word)}: expected a number > 0, such as 1e-5")
    return tolerance


def _read_previous(file: Path, given: Input) -> np.ndarray:
    """The starts in the order of the matrices. The names match them if a file holds several arrays."""
    starts = read_input(file, "--previous")
    if len(given.sets) == len(starts.sets) == 1:
        pairs = [(*given.sets.values(), *starts.sets.values())]
    elif starts.sets.keys() >= given.sets.keys():
        pairs = [(part, starts.sets[name]) for name, part in given.sets.items()]
    else:
        raise UserError(
            f"--previous {shown(file)}: it holds {', '.join(starts.sets)};"
            f" expected arrays called {', '.join(given.sets)}"
        )
    for matrices, rotations in pairs:
        if len(matrices) != len(rotations):
            raise UserError(f"--previous {shown(file)}: {len(rotations):,} rotations; expected {len(matrices):,}")
    return np.concatenate([rotations for _, rotations in pairs])


def _as_text(result: Recommendation, given: Input, environment: dict[str, str]) -> str:
    measured = "; ".join([environment["device"], environment["threads"], f"load average {environment['load average']}"])
    paragraphs = [result.statement, *given.remarks, f"In Python: {_as_call(result)}", f"Measured on {measured}."]
    parts = ["\n".join(textwrap.wrap(paragraph, _WIDTH, break_long_words=False)) for paragraph in paragraphs]
    parts.append(as_text(_measured_table(result)))
    if result.excluded:
        rows = [[name, reason] for name, reason in result.excluded.items()]
        parts.append(as_text(Table("Not considered", ["name", "why"], rows)))
    return "\n\n".join(parts)


def _as_call(result: Recommendation) -> str:
    if result.step is None:
        return f'jaxrot.nearest_rotation(matrix, method="{result.method}")'
    return f'jaxrot.refine_rotation(matrix, rotation, step="{result.step}", iterations={result.iterations})'


def _measured_table(result: Recommendation) -> Table:
    verdict = "recommended" if result.meets else "nearest"
    lines = [(Candidate(*(getattr(result, field) for field in Candidate._fields)), verdict)]
    lines += [(candidate, "meets it") for candidate in result.runners_up]
    lines += [(candidate, "too inaccurate") for candidate in result.too_inaccurate]
    rows = [[candidate.name, number(candidate.error), _time(candidate), word] for candidate, word in lines]
    title = f"Tolerance {number(result.tolerance)}, margin {result.margin:g}"
    return Table(title, ["name", "largest error", f"ns at {result.batch:,}", "verdict"], rows)


def _time(candidate: Candidate) -> str:
    if math.isnan(candidate.time_ns):
        return "-"
    low, high = candidate.time_quartiles_ns
    return f"{number(candidate.time_ns)} ({number(low)}-{number(high)})"

"""`python -m jaxrot report`: options, their checks, and the order of things."""

import argparse
import contextlib
from pathlib import Path
from typing import NamedTuple

import jaxrot
from jaxrot._startup import INTERRUPTED
from jaxrot.console.arguments import path
from jaxrot.console.configuration import measuring_configuration
from jaxrot.console.environment import describe_environment
from jaxrot.console.errors import UserError, shown
from jaxrot.console.extras import check_installed
from jaxrot.console.interrupts import Interrupts
from jaxrot.console.output import check_writable, write_files
from jaxrot.console.printing import show
from jaxrot.console.progress import progress
from jaxrot.report import bench
from jaxrot.report.comparison import compare, read_report
from jaxrot.report.content import Content
from jaxrot.report.drawing.pictures import draw_pictures
from jaxrot.report.guards import prices
from jaxrot.report.inputs import dragon_input, read_input, thinned
from jaxrot.report.measurement import Plan
from jaxrot.report.sections import measure, number_of_steps
from jaxrot.report.stability import cells as stability
from jaxrot.report.writing import bench_document, document, records
from jaxrot.report.writing.page import as_page

_DTYPES = {"float32": ("float32",), "float64": ("float64",), "both": ("float32", "float64")}
_LARGEST_BATCH = 10**7


class _Size(NamedTuple):
    """How much a report measures where the user does not say."""

    dtype: str
    batches: tuple[int, ...]
    batch_if_time_permits: int | None
    clusters: int
    most_matrices: int
    matrices_a_family: int
    timing_budget_s: float
    peers_budget_s: float
    warm_starts_budget_s: float


_FULL = _Size("both", (100, 10_000, 100_000), 1_000_000, 400, 200_000, 200, 70.0, 40.0, 16.0)
_QUICK_BENCH = bench.Size(100, 10_000, 100_000, (10_000, 100_000), 1.0)
_QUICK = _Size("float32", (10_000,), None, 100, 20_000, 20, 4.0, 4.0, 2.0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options of the report."""
    parser.add_argument(
        "--out", type=path, default=Path("jaxrot-report"), metavar="FOLDER", help="where to write (%(default)s/)"
    )
    parser.add_argument("--input", type=path, metavar="FILE", help="your own matrices: .npy or .npz, (..., 3, 3)")
    parser.add_argument("--methods", metavar="A,B,...", help=f"which of {', '.join(jaxrot.METHODS)} (all)")
    parser.add_argument("--dtype", metavar="DTYPE", help=f"{', '.join(_DTYPES)} ({_FULL.dtype}; quick: {_QUICK.dtype})")
    parser.add_argument("--batch", metavar="N,N,...", help="batch sizes to time")
    parser.add_argument(
        "--peers", action="store_true", help="beside other packages, as far as they are installed (extra: peers)"
    )
    parser.add_argument("--compare", type=path, metavar="OLD.json", help="the report.json of an earlier run")
    parser.add_argument("--bench", action="store_true", help="instead: the library's own speed goals")
    parser.add_argument("--quick", action="store_true", help="under half a minute: one dtype, one batch size, no steps")


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Measures, writes and prints; every mistake of the user's is found before anything is measured.

    Once all is measured a Ctrl-C ends the drawing, and the report is written without pictures.

    Returns:
        The exit status: 0; 130 where the drawing was interrupted.

    Raises:
        UserError: Something the user can fix.
        UnreadError: Nobody reads standard output; the files are written.
        KeyboardInterrupt: The command was interrupted before all was measured.
    """
    if options.bench:
        return _run_bench(options, interrupts)
    size = _QUICK if options.quick else _FULL
    dtypes = _parse_dtype(size.dtype if options.dtype is None else options.dtype)
    batches = _parse_batches(options.batch) if options.batch is not None else size.batches
    is_everything = not options.quick and options.methods is None
    plan = Plan(
        methods=_parse_methods(options.methods) if options.methods is not None else tuple(jaxrot.METHODS),
        dtypes=dtypes,
        batches=batches,
        batch_if_time_permits=size.batch_if_time_permits if options.batch is None else None,
        matrices_a_family=size.matrices_a_family,
        timing_budget_s=size.timing_budget_s,
        peers_budget_s=size.peers_budget_s if options.peers else None,
        warm_starts_budget_s=size.warm_starts_budget_s if is_everything else None,
        map_steps=None if options.quick else stability.STEPS,
        guards_size=prices.Size() if is_everything else None,
    )
    before = options.compare and read_report(options.compare)
    check_installed(["markdown", "matplotlib"], "report")
    check_writable(options.out)
    given = (
        dragon_input(size.clusters) if options.input is None else thinned(read_input(options.input), size.most_matrices)
    )
    environment = describe_environment(dtypes)
    with measuring_configuration(), progress(number_of_steps(plan), interrupts) as advance:
        measured = measure(plan, given, advance)
    interrupts.hold()
    used = {name: shown(value) for name, value in vars(options).items() if isinstance(value, str | int | Path)}
    content = Content(given, environment, used, dtypes, **measured._asdict())
    if before:
        sets = {name: len(part) for name, part in given.sets.items()}
        content = content._replace(comparison=compare(shown(options.compare.name), before, measured.results, sets))
    pictures = _draw(content, interrupts)
    markdown = document.as_report_markdown(content, pictures)
    files = {
        "report.md": markdown.encode(),
        "report.html": as_page(markdown, pictures).encode(),
        "report.csv": records.as_csv(content.results).encode(),
        "report.json": records.as_json(content).encode(),
        **pictures,
    }
    write_files(options.out, files)
    parts = [document.as_terminal_text(content)]
    if not pictures:
        parts.append("Interrupted while drawing, without pictures.")
    parts.append(f"Written to {shown(options.out)}: {', '.join(files)}")
    show("\n\n".join(parts), options.out)
    return 0 if pictures else INTERRUPTED


def _draw(content: Content, interrupts: Interrupts) -> dict[str, bytes]:
    """The pictures, or none if a Ctrl-C came before all were drawn."""
    with contextlib.suppress(KeyboardInterrupt), interrupts.raising():
        return draw_pictures(content)
    return {}


def _run_bench(options: argparse.Namespace, interrupts: Interrupts) -> int:
    fixed = ("input", "methods", "dtype", "batch", "peers", "compare")
    for name in fixed:
        if getattr(options, name) not in (None, False):
            raise UserError(f"--bench measures a fixed list; it goes without {', '.join(f'--{x}' for x in fixed)}")
    check_writable(options.out)
    environment = describe_environment(("float32", "float64"))
    with measuring_configuration(), progress(len(bench.GROUPS), interrupts) as advance:
        measured = bench.run_bench(_QUICK_BENCH if options.quick else bench.Size(), advance)
    interrupts.hold()
    files = {
        "bench.md": bench_document.as_bench_markdown(measured, environment).encode(),
        "bench.json": records.as_bench_json(measured, environment).encode(),
    }
    write_files(options.out, files)
    text = bench_document.as_bench_text(measured, environment)
    show(f"{text}\n\nWritten to {shown(options.out)}: {', '.join(files)}", options.out)
    return 0


def _parse_dtype(word: str) -> tuple[str, ...]:
    if word not in _DTYPES:
        raise UserError(f"--dtype {shown(word)}: expected one of {', '.join(_DTYPES)}")
    return _DTYPES[word]


def _parse_methods(words: str) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(word.strip() for word in words.split(",")))
    unknown = [name for name in names if name not in jaxrot.METHODS]
    if unknown:
        listed = ", ".join(repr(name) for name in unknown)
        raise UserError(f"--methods {shown(words)}: unknown {listed}; expected some of {', '.join(jaxrot.METHODS)}")
    return names


def _parse_batches(words: str) -> tuple[int, ...]:
    expected = f"expected whole numbers from 1 to {_LARGEST_BATCH:,}, separated by commas"
    try:
        batches = sorted({int(word) for word in words.split(",")})
    except ValueError:
        raise UserError(f"--batch {shown(words)}: {expected}") from None
    if not 1 <= batches[0] <= batches[-1] <= _LARGEST_BATCH:
        raise UserError(f"--batch {shown(words)}: {expected}")
    return tuple(batches)

"""`python -m jaxrot report`: its options and their checks, and what it writes and prints."""

import argparse
import contextlib
from pathlib import Path

import jaxrot
from jaxrot._startup import INTERRUPTED
from jaxrot.console.arguments import path
from jaxrot.console.environment import describe_environment, measuring_configuration
from jaxrot.console.errors import UserError, shown
from jaxrot.console.interrupts import Interrupts
from jaxrot.console.output import check_writable, write_files
from jaxrot.console.printing import show
from jaxrot.console.progress import check_installed, progress
from jaxrot.report.comparison import compare, read_report
from jaxrot.report.data import ReportData
from jaxrot.report.inputs import dragon_input, read_input, thinned
from jaxrot.report.measure import bench
from jaxrot.report.plan import FULL, QUICK, Plan
from jaxrot.report.run import measure
from jaxrot.report.show import document, records
from jaxrot.report.show.page import as_page
from jaxrot.report.show.pictures import draw_pictures

_DTYPES = {"float32": ("float32",), "float64": ("float64",), "both": ("float32", "float64")}
_LARGEST_BATCH = 10**7
_QUICK_BENCH = bench.Size(small=100, middle=10_000, large=100_000, growth=(10_000, 100_000), budget_s=1.0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options of the report."""
    parser.add_argument(
        "--out", type=path, default=Path("jaxrot-report"), metavar="FOLDER", help="where to write (%(default)s/)"
    )
    parser.add_argument("--input", type=path, metavar="FILE", help="your own matrices: .npy or .npz, (..., 3, 3)")
    parser.add_argument("--methods", metavar="A,B,...", help=f"which of {', '.join(jaxrot.METHODS)} (all)")
    parser.add_argument("--dtype", metavar="DTYPE", help=f"{', '.join(_DTYPES)} (both; quick: float32)")
    parser.add_argument("--batch", metavar="N,N,...", help="batch sizes to time")
    parser.add_argument(
        "--peers", action="store_true", help="compare with other packages, if they are installed (extra: peers)"
    )
    parser.add_argument("--compare", type=path, metavar="OLD.json", help="the report.json of an earlier run")
    parser.add_argument("--bench", action="store_true", help="measure only the library's own speed goals")
    parser.add_argument("--quick", action="store_true", help="under half a minute: one dtype, one batch size, no steps")


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Measures, writes and prints. Mistakes of the user are found before anything is measured.

    After the measurements a Ctrl-C ends the drawing, and the report is written without pictures.

    Returns:
        The exit status: 0, or 130 if the drawing was interrupted.

    Raises:
        UserError: Something the user can fix.
        UnreadError: The reader closed standard output. The files are written.
        KeyboardInterrupt: The measurements were interrupted.
    """
    if options.bench:
        return _run_bench(options, interrupts)
    plan = _plan(options)
    before = options.compare and read_report(options.compare)
    check_installed(["markdown", "matplotlib"], "report")
    check_writable(options.out)
    given = (
        dragon_input(plan.clusters) if options.input is None else thinned(read_input(options.input), plan.most_matrices)
    )
    environment = describe_environment(plan.dtypes)
    with measuring_configuration(), progress(interrupts) as say:
        data = measure(plan, given, say)
    interrupts.hold()
    used = {name: shown(value) for name, value in vars(options).items() if isinstance(value, str | int | Path)}
    data = data._replace(environment=environment, options=used)
    if before:
        data = data._replace(comparison=compare(shown(options.compare.name), before, data.results, given.counts))
    pictures = _draw(data, interrupts)
    markdown = document.as_report_markdown(data, pictures)
    files = {
        "report.md": markdown.encode(),
        "report.html": as_page(markdown, pictures).encode(),
        "report.csv": records.as_csv(data.results).encode(),
        "report.json": records.as_json(data).encode(),
        **pictures,
    }
    write_files(options.out, files)
    parts = [document.as_terminal_text(data)]
    if not pictures:
        parts.append("Interrupted while drawing, without pictures.")
    parts.append(f"Written to {shown(options.out)}: {', '.join(files)}")
    show("\n\n".join(parts), options.out)
    return 0 if pictures else INTERRUPTED


def _plan(options: argparse.Namespace) -> Plan:
    plan = QUICK if options.quick else FULL
    if options.methods is not None:
        plan = plan._replace(methods=_parse_methods(options.methods), warm_starts_budget_s=None, guards=None)
    if options.dtype is not None:
        plan = plan._replace(dtypes=_parse_dtype(options.dtype))
    if options.batch is not None:
        plan = plan._replace(batches=_parse_batches(options.batch), batch_if_time_permits=None)
    return plan if options.peers else plan._replace(peers_budget_s=None)


def _draw(data: ReportData, interrupts: Interrupts) -> dict[str, bytes]:
    """The pictures, or none if a Ctrl-C came before all were drawn."""
    with contextlib.suppress(KeyboardInterrupt), interrupts.raising():
        return draw_pictures(data)
    return {}


def _run_bench(options: argparse.Namespace, interrupts: Interrupts) -> int:
    fixed = ("input", "methods", "dtype", "batch", "peers", "compare")
    for name in fixed:
        if getattr(options, name) not in (None, False):
            raise UserError(f"--bench measures a fixed list; it goes without {', '.join(f'--{x}' for x in fixed)}")
    check_writable(options.out)
    environment = describe_environment(("float32", "float64"))
    with measuring_configuration(), progress(interrupts) as say:
        say("speed goals")
        measured = bench.run_bench(_QUICK_BENCH if options.quick else bench.Size())
    interrupts.hold()
    files = {
        "bench.md": document.as_bench_markdown(measured, environment).encode(),
        "bench.json": records.as_bench_json(measured, environment).encode(),
    }
    write_files(options.out, files)
    text = document.as_bench_text(measured, environment)
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
        expected = f"expected some of {', '.join(jaxrot.METHODS)}"
        raise UserError(f"--methods {shown(words)}: unknown {', '.join(map(repr, unknown))}; {expected}")
    return names


def _parse_batches(words: str) -> tuple[int, ...]:
    try:
        batches = sorted({int(word) for word in words.split(",")})
    except ValueError:
        batches = [0]
    if not 1 <= batches[0] <= batches[-1] <= _LARGEST_BATCH:
        expected = f"expected whole numbers from 1 to {_LARGEST_BATCH:,}, separated by commas"
        raise UserError(f"--batch {shown(words)}: {expected}")
    return tuple(batches)

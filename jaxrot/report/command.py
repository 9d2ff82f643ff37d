"""`python -m jaxrot report`: options, their checks, and the order of things."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import jaxrot
from jaxrot.console.configuration import measuring_configuration
from jaxrot.console.environment import describe_environment
from jaxrot.console.errors import UserError
from jaxrot.console.extras import check_installed
from jaxrot.console.output import check_writable, write_files
from jaxrot.console.progress import progress
from jaxrot.report import bench, render
from jaxrot.report.findings import on_input, times_at_largest_batch
from jaxrot.report.inputs import Input, dragon_input, read_input, thinned
from jaxrot.report.measurement import Plan, Results, measure, number_of_steps
from jaxrot.report.pareto import Panel, Point, draw_pareto

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


_FULL = _Size("both", (100, 10_000, 100_000), 1_000_000, 400, 200_000, 200, 70.0)
_QUICK_BENCH = bench.Size(100, 10_000, 100_000, (10_000, 100_000), 20, 1.0)
_QUICK = _Size("float32", (10_000,), None, 100, 20_000, 20, 4.0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options of the report."""
    parser.add_argument(
        "--out", type=Path, default=Path("jaxrot-report"), metavar="FOLDER", help="where to write (%(default)s/)"
    )
    parser.add_argument("--input", type=Path, metavar="FILE", help="your own matrices: .npy or .npz, (..., 3, 3)")
    parser.add_argument("--methods", metavar="A,B,...", help=f"which of {', '.join(jaxrot.METHODS)} (all)")
    parser.add_argument("--dtype", metavar="DTYPE", help=f"{', '.join(_DTYPES)} ({_FULL.dtype}; quick: {_QUICK.dtype})")
    parser.add_argument("--batch", metavar="N,N,...", help="batch sizes to time")
    parser.add_argument(
        "--bench", action="store_true", help="instead: the library's own speed goals, and what each stage costs"
    )
    parser.add_argument("--quick", action="store_true", help="under 20 seconds: one dtype, one batch size, less of all")


def run(options: argparse.Namespace) -> int:
    """Measures, writes and prints; every mistake of the user's is found before anything is measured.

    Returns:
        The exit status.

    Raises:
        UserError: Something the user can mend.
    """
    if options.bench:
        return _run_bench(options)
    size = _QUICK if options.quick else _FULL
    dtypes = _parse_dtype(options.dtype or size.dtype)
    batches = _parse_batches(options.batch) if options.batch is not None else size.batches
    plan = Plan(
        methods=_parse_methods(options.methods) if options.methods is not None else tuple(jaxrot.METHODS),
        dtypes=dtypes,
        batches=batches,
        batch_if_time_permits=size.batch_if_time_permits if options.batch is None else None,
        matrices_a_family=size.matrices_a_family,
        timing_budget_s=size.timing_budget_s,
    )
    check_installed(["matplotlib"], "report")
    check_writable(options.out)
    given = (
        dragon_input(size.clusters) if options.input is None else thinned(read_input(options.input), size.most_matrices)
    )
    environment = describe_environment(dtypes)
    with measuring_configuration(), progress(number_of_steps(plan)) as advance:
        results = measure(plan, given, advance)
    used = {name: str(value) for name, value in vars(options).items() if isinstance(value, str | int | Path)}
    markdown = render.as_report_markdown(results, given, environment, dtypes, "pareto.png")
    files = {
        "report.md": markdown.encode(),
        "report.csv": render.as_csv(results).encode(),
        "report.json": render.as_json(results, given, environment, dtypes, used).encode(),
        "pareto.png": _picture(results, given, environment, dtypes),
    }
    write_files(options.out, files)
    print(render.as_terminal_text(results, given, environment, dtypes))
    print(f"\nWritten to {options.out}: {', '.join(files)}")
    return 0


def _run_bench(options: argparse.Namespace) -> int:
    fixed = ("input", "methods", "dtype", "batch")
    for name in fixed:
        if getattr(options, name) is not None:
            raise UserError(f"--bench measures a fixed list; it goes without {', '.join(f'--{x}' for x in fixed)}")
    check_writable(options.out)
    environment = describe_environment(("float32", "float64"))
    with measuring_configuration(), progress(len(bench.GROUPS)) as advance:
        measured = bench.run_bench(_QUICK_BENCH if options.quick else bench.Size(), advance)
    files = {
        "bench.md": render.as_bench_markdown(measured, environment).encode(),
        "bench.json": render.as_bench_json(measured, environment).encode(),
    }
    write_files(options.out, files)
    print(render.as_bench_text(measured, environment))
    print(f"\nWritten to {options.out}: {', '.join(files)}")
    return 0


def _parse_dtype(word: str) -> tuple[str, ...]:
    if word not in _DTYPES:
        raise UserError(f"--dtype {word}: expected one of {', '.join(_DTYPES)}")
    return _DTYPES[word]


def _parse_methods(words: str) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(word.strip() for word in words.split(",")))
    unknown = [name for name in names if name not in jaxrot.METHODS]
    if unknown:
        listed = ", ".join(repr(name) for name in unknown)
        raise UserError(f"--methods {words}: unknown {listed}; expected some of {', '.join(jaxrot.METHODS)}")
    return names


def _parse_batches(words: str) -> tuple[int, ...]:
    expected = f"expected whole numbers from 1 to {_LARGEST_BATCH:,}, separated by commas"
    try:
        batches = sorted({int(word) for word in words.split(",")})
    except ValueError:
        raise UserError(f"--batch {words}: {expected}") from None
    if not 1 <= batches[0] <= batches[-1] <= _LARGEST_BATCH:
        raise UserError(f"--batch {words}: {expected}")
    return tuple(batches)


def _picture(results: Results, given: Input, environment: Mapping[str, str], dtypes: tuple[str, ...]) -> bytes:
    panels = []
    for dtype in dtypes:
        times, accuracy = times_at_largest_batch(results, dtype), on_input(results, dtype)
        points = [
            Point(
                name=name,
                time_ns=time.median_ns,
                error=entry.forward_99th,
                error_median=entry.forward_median,
                error_max=entry.forward_max,
                is_exact=jaxrot.METHODS[name].exact,
            )
            for name, time in times.items()
            if (entry := accuracy[name]).forward_99th is not None
            and entry.forward_median is not None
            and entry.forward_max is not None
        ]
        panels.append(Panel(dtype, next(iter(times.values())).batch, points))
    count = sum(map(len, given.sets.values()))
    return draw_pareto(
        panels,
        f"Error against run time: {given.name}, {count:,} matrices\n{environment['device']}, {environment['threads']}",
    )

"""What `--bench` measured, as Markdown and for a terminal."""

from collections.abc import Mapping

from jaxrot.report.bench import Bench
from jaxrot.report.document import columns, header
from jaxrot.report.tables import as_markdown, as_text, goals_table, stages_table

_BENCH = """\
Gaussian matrices, float32 where not said otherwise. Ratios of times are medians and quartiles over rounds in which
every function of a group runs once, in random order; compiled and warmed up beforehand, each call waited for. The copy
is `A * c`, into a new array. *In blocks*: `in_blocks`. Outside the contract: matrices of all families."""


def as_bench_markdown(bench: Bench, environment: Mapping[str, str]) -> str:
    """bench.md: header and the two tables."""
    parts = ["# Speed of jaxrot", header(environment), _BENCH]
    for table in (goals_table(bench.goals), stages_table(bench.stages)):
        parts += [f"## {table.title}", as_markdown(table)]
    return "\n\n".join(parts) + "\n"


def as_bench_text(bench: Bench, environment: Mapping[str, str]) -> str:
    """What the command prints."""
    tables = (goals_table(bench.goals), stages_table(bench.stages))
    return "\n\n".join([columns(environment), *map(as_text, tables)])

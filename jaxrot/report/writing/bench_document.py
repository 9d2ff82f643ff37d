"""What `--bench` measured, as Markdown and for a terminal."""

from collections.abc import Mapping

from jaxrot.report.bench import Bench
from jaxrot.report.writing.document import columns, header
from jaxrot.report.writing.tables import as_markdown, as_text, goals_table

_BENCH = """\
Gaussian matrices, float32 where not said otherwise. Ratios of times are medians and quartiles over rounds in which
every function of a group runs once, in random order; compiled and warmed up beforehand, each call waited for. The copy
is `A * c`, into a new array. *In blocks*: `in_blocks`."""


def as_bench_markdown(bench: Bench, environment: Mapping[str, str]) -> str:
    """bench.md: header and table."""
    table = goals_table(bench.goals)
    parts = ["# Speed of jaxrot", header(environment), _BENCH, f"## {table.title}", as_markdown(table)]
    return "\n\n".join(parts) + "\n"


def as_bench_text(bench: Bench, environment: Mapping[str, str]) -> str:
    """What the command prints."""
    return "\n\n".join([columns(environment), as_text(goals_table(bench.goals))])

"""Tables of words, as plain text and as Markdown."""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, TypeVar

Item = TypeVar("Item")


class Table(NamedTuple):
    """A title, a header and rows, each with one text for every column."""

    title: str
    header: list[str]
    rows: list[list[str]]


def tabulate(title: str, items: Iterable[Item], columns: Mapping[str, Callable[[Item], str]]) -> Table:
    """A table with one row for each item and one column for each function."""
    return Table(title, list(columns), [[text(item) for text in columns.values()] for item in items])


def as_text(table: Table) -> str:
    """The table for a terminal, columns of numbers aligned to the right."""
    lines = [table.header, *table.rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(table.header))]
    set_lines = [
        "  ".join(
            word.rjust(width) if is_number else word.ljust(width)
            for word, width, is_number in zip(line, widths, _are_numbers(table), strict=True)
        ).rstrip()
        for line in lines
    ]
    rule = "  ".join("-" * width for width in widths)
    return "\n".join([table.title, "", set_lines[0], rule, *set_lines[1:]])


def as_markdown(table: Table) -> str:
    """The table as Markdown, without its title."""
    rule = ["---:" if is_number else ":---" for is_number in _are_numbers(table)]
    return "\n".join(f"| {' | '.join(line)} |" for line in [table.header, rule, *table.rows])


def _are_numbers(table: Table) -> list[bool]:
    """Whether each column holds numbers or signs that stand for numbers."""
    return [
        all(row[column][:1].isdigit() or row[column][:1] in "-∞·(*" for row in table.rows)
        for column in range(len(table.header))
    ]

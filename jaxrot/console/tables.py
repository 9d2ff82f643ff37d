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
    columns = []
    for words, is_number in zip(zip(table.header, *table.rows, strict=True), _are_numbers(table), strict=True):
        width = max(map(len, words))
        head, *entries = (word.rjust(width) if is_number else word.ljust(width) for word in words)
        columns.append([head, "-" * width, *entries])
    return "\n".join([table.title, "", *("  ".join(line).rstrip() for line in zip(*columns, strict=True))])


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

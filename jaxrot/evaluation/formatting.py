"""Numbers and lists as text."""

from collections.abc import Sequence


def number(value: float | None) -> str:
    """A number with at most three digits; a dash for None."""
    if value is None:
        return "-"
    if value == float("inf"):
        return "∞"
    if value == 0 or 0.01 <= abs(value) < 9999.5:
        return f"{value:.3g}" if abs(value) < 99.95 else f"{value:,.0f}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def listed(names: Sequence[str]) -> str:
    """The names, separated by commas and a last "and"."""
    return " and ".join([", ".join(names[:-1])] * (len(names) > 1) + [names[-1]])

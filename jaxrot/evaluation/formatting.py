"""Numbers and lists as words."""

from collections.abc import Sequence


def number(value: float | None) -> str:
    """Three digits at most; a dash where there is nothing to say."""
    if value is None:
        return "-"
    if value == float("inf"):
        return "∞"
    if value == 0 or 0.01 <= abs(value) < 9999.5:
        return f"{value:.3g}" if abs(value) < 99.95 else f"{value:,.0f}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def listed(names: Sequence[str]) -> str:
    """One, or one and another, or one, another and a third."""
    return " and ".join([", ".join(names[:-1])] * (len(names) > 1) + [names[-1]])

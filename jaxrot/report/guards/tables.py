"""The prices of the guards as a table of words."""

from collections.abc import Sequence

from jaxrot.evaluation.formatting import number
from jaxrot.report.guards.prices import Price, Time
from jaxrot.report.guards.verdict import Broken
from jaxrot.report.writing.tables import Table

GUARDS_CAPTION = """\
One guard left out at a time. The time is the ratio without over with it in the same rounds, for 100,000 Gaussian
matrices, median and quartiles, and a number only where both quartiles lie on one side of 1. *Outside*: what keeps every
promise with the guard and breaks one without it, of 500 matrices of every family, or of its starts; in the row
"nothing", all that breaks anyway. *Inside without it only*: the opposite; where it is as large, both are rounding.
*Worst*: the largest error over its bound, and whose bound: the contract's; for steps also the quaternion's length
(4 eps) and that a start that is nearest already is kept (32 eps). Steps start 45° and 135° off and at the nearest
rotation, *escape* at exact half turns, with as many iterations as they need to converge."""
_MOST_FAMILIES = 6


def guards_table(prices: Sequence[Price], title: str) -> Table:
    """One row a guard of each method or step, its dtypes side by side.

    *Outside*: what keeps every promise with the guard and breaks one without it; of these *not finite*; *worst*: the
    largest error of them over its bound, and whose bound that is. In the row "nothing" it is all that breaks anyway.
    *Inside without it only* is the opposite: where it is as large, both are rounding.

    Args:
        prices: `Guards.default` or `Guards.steps`.
        title: What the table shows.
    """
    rows: dict[tuple[str, str], list[Price]] = {}
    for price in prices:
        rows.setdefault((price.of, price.guard), []).append(price)
    with_step = ["step"] if len({of for of, _ in rows}) > 1 else []
    dtypes = " / ".join(dict.fromkeys(price.dtype for price in prices))
    header = [*with_step, "left out", f"time over that with it, {dtypes}: median (quartiles)", "outside", "not finite"]
    header += ["inside without it only"]
    header += ["worst / bound", "families that break: worst / bound"]
    words = [[*([of] if with_step else []), *_row(guard, by_dtype)] for (of, guard), by_dtype in rows.items()]
    return Table(title, header, words)


def _row(guard: str, prices: Sequence[Price]) -> list[str]:
    if guard:
        time = " / ".join(ratio_words(price.time) for price in prices)
    else:
        time = " / ".join(number(price.time.nanoseconds) for price in prices) + " ns a matrix"
    return [
        guard or "nothing",
        time,
        " / ".join(f"{price.outside:,}" for price in prices),
        " / ".join(f"{price.not_finite:,}" for price in prices),
        " / ".join(f"{price.gained:,}" for price in prices),
        " / ".join(_worst(price) for price in prices),
        _families([entry for price in prices for entry in price.broken]),
    ]


def ratio_words(time: Time) -> str:
    """A number only where it is one: the quartiles alone where they have 1 between them."""
    quartiles = f"({number(time.quartile_1)}-{number(time.quartile_3)})"
    return f"{number(time.ratio)} {quartiles}" if time.is_separated else f"within the spread {quartiles}"


def _worst(price: Price) -> str:
    return f"{number(price.broken[0].worst)} {price.broken[0].promise}" if price.broken else "-"


def _families(broken: Sequence[Broken]) -> str:
    """The worst few of any dtype, each with its largest error over its bound."""
    worst: dict[str, float] = {}
    for entry in broken:
        worst[entry.family] = max(entry.worst, worst.get(entry.family, 0.0))
    names = sorted(worst, key=lambda name: -worst[name])
    words = ", ".join(f"`{name}` {number(worst[name])}" for name in names[:_MOST_FAMILIES])
    return words + (f" and {len(names) - _MOST_FAMILIES} more" if len(names) > _MOST_FAMILIES else "") or "none"

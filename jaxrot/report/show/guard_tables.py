"""The price of every guard as a table."""

from collections.abc import Callable, Sequence

from jaxrot.console.tables import Table, tabulate
from jaxrot.evaluation.formatting import number
from jaxrot.report.measure.ablation_cost import Price, Time
from jaxrot.report.measure.verdict import Broken

GUARDS_CAPTION = """\
Each row leaves one guard out. The time is the ratio of the time without the guard over the time with it, in the same
rounds, for 100,000 Gaussian matrices: median and quartiles, or only the quartiles if 1 lies between them. *Outside*
counts the matrices that keep every promise with the guard and break one without it, of 500 matrices of every family;
for steps it counts starts. In the row "nothing" it counts all that break. *Inside without it only* counts the opposite;
if it is as large, both are rounding. *Worst* is the largest error over its bound, with the promise it breaks. The steps
promise two things in addition to the contract: the quaternion has length 1 to 4 eps, and a start that is one of the
nearest rotations moves by at most 32 eps. Steps start 45° and 135° off and at the nearest rotation, *escape* at exact
half turns, with as many iterations as they need to converge."""
_MOST_FAMILIES = 6


def guards_table(prices: Sequence[Price], title: str) -> Table:
    """One row for each guard of each method or step, its dtypes side by side; `GUARDS_CAPTION` explains the columns."""
    rows: dict[tuple[str, str], list[Price]] = {}
    for price in prices:
        rows.setdefault((price.of, price.guard), []).append(price)
    dtypes = " / ".join(dict.fromkeys(price.dtype for price in prices))

    def each(text: Callable[[Price], str]) -> Callable[[Sequence[Price]], str]:
        return lambda row: " / ".join(map(text, row))

    columns: dict[str, Callable[[Sequence[Price]], str]] = {
        "left out": lambda row: row[0].guard or "nothing",
        f"time over that with it, {dtypes}: median (quartiles)": _time,
        "outside": each(lambda price: f"{price.outside:,}"),
        "not finite": each(lambda price: f"{price.not_finite:,}"),
        "inside without it only": each(lambda price: f"{price.gained:,}"),
        "worst / bound": each(_worst),
        "families that break: worst / bound": lambda row: _families([entry for price in row for entry in price.broken]),
    }
    if len({of for of, _ in rows}) > 1:
        columns = {"step": lambda row: row[0].of} | columns
    return tabulate(title, rows.values(), columns)


def _time(row: Sequence[Price]) -> str:
    if row[0].guard:
        return " / ".join(ratio_words(price.time) for price in row)
    return " / ".join(number(price.time.nanoseconds) for price in row) + " ns per matrix"


def ratio_words(time: Time) -> str:
    """Median and quartiles, or only the quartiles if 1 lies between them."""
    quartiles = f"({number(time.quartile_1)}-{number(time.quartile_3)})"
    return f"{number(time.ratio)} {quartiles}" if time.is_separated else f"within the spread {quartiles}"


def _worst(price: Price) -> str:
    return f"{number(price.broken[0].worst)} {price.broken[0].promise}" if price.broken else "-"


def _families(broken: Sequence[Broken]) -> str:
    """The worst few families of any dtype, each with its largest error over its bound."""
    worst: dict[str, float] = {}
    for entry in broken:
        worst[entry.family] = max(entry.worst, worst.get(entry.family, 0.0))
    names = sorted(worst, key=lambda name: -worst[name])
    texts = [f"`{name}` {number(worst[name])}" for name in names[:_MOST_FAMILIES]]
    more = f" and {len(names) - _MOST_FAMILIES} more" if len(names) > _MOST_FAMILIES else ""
    return ", ".join(texts) + more or "none"

"""`python -m jaxrot.report.readme FOLDER` refreshes the measured tables and pictures of all README pages.

The pages are README.md and jaxrot/*/README.md of a clone. A measured region of a page stands between
`<!-- measured: NAME -->` and `<!-- /measured -->`. The command replaces its text. FOLDER holds the output of
`report --peers` and of `report --bench`, both run with `--out FOLDER`.
"""

import argparse
import json
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jaxrot
from jaxrot.console.tables import Table, as_markdown
from jaxrot.evaluation.domain import largest_condition
from jaxrot.evaluation.formatting import listed, number
from jaxrot.evaluation.timing import Timing
from jaxrot.report.inputs import WHOLE
from jaxrot.report.measure.ablation_cost import Time
from jaxrot.report.measure.results import largest_batch
from jaxrot.report.show import pictures
from jaxrot.report.show.guard_tables import ratio_words

PICTURES = (
    pictures.METHODS,
    pictures.PEERS,
    pictures.GRADIENTS,
    pictures.WARM_STARTS,
    pictures.conditions("float32"),
    pictures.SURVIVAL,
)
_REGION = re.compile(r"(?<=<!-- measured: )(\w+)( -->\n).*?(?=<!-- /measured -->)", re.DOTALL)
_DTYPES = ("float32", "float64")


def main(arguments: list[str] | None = None) -> None:
    """Rewrites the regions of all pages and copies their pictures."""
    parser = argparse.ArgumentParser(prog="python -m jaxrot.report.readme", description=__doc__)
    parser.add_argument("folder", type=Path, help="what `report --peers` and `report --bench` have written")
    parser.add_argument("--root", type=Path, default=Path(), help="the clone whose pages are written (here)")
    options = parser.parse_args(arguments)
    report, bench = (json.loads((options.folder / name).read_text("utf-8")) for name in ("report.json", "bench.json"))
    if report["peers"] is None or report["guards"] is None:
        parser.error(f"{options.folder} holds a report without peers or guards; expected that of `report --peers`")
    for page in pages(options.root):
        page.write_text(filled(page.read_text("utf-8"), report, bench), "utf-8")
    for name in PICTURES:
        shutil.copyfile(options.folder / name, options.root / "notebooks" / name)


def pages(root: Path) -> list[Path]:
    """The README of a clone and those of the package's folders."""
    return [root / "README.md", *sorted((root / "jaxrot").glob("*/README.md"))]


def filled(page: str, report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """A page with every region replaced.

    Raises:
        KeyError: A region's name is not in `REGIONS`.
    """

    def region(match: re.Match[str]) -> str:
        return f"{match[1]}{match[2]}{REGIONS[match[1]](report, bench)}\n"

    return _REGION.sub(region, page)


def methods_region(report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """Every method with its domain, its error on the report's input and its time; the fastest first."""
    accuracy = {(entry["method"], entry["dtype"]): entry for entry in report["accuracy"] if entry["set_name"] == WHOLE}
    batch, times = _times(report)
    count = next(iter(accuracy.values()))["matrices"]
    rows = []
    for name, method in sorted(jaxrot.METHODS.items(), key=lambda item: times[item[0], "float32"]["median_ns"]):
        is_default = name == jaxrot.DEFAULT_METHOD
        exactness = "exact" if method.exact else "approximation"
        errors = accuracy[name, "float32"]
        rows.append(
            [
                f"`{name}`{' (default)' if is_default else ''}",
                method.source,
                f"{exactness}, {'any det' if method.handles_inversion else 'det A > 0'}",
                " / ".join(_limit(method, dtype) for dtype in _DTYPES),
                " / ".join(number(float(errors[what])) for what in ("forward_median", "forward_99th")),
                " / ".join(f"{accuracy[name, dtype]['outside']:,}" for dtype in _DTYPES),
                " / ".join(number(times[name, dtype]["median_ns"]) for dtype in _DTYPES),
            ]
        )
    header = ["method", "source", "domain", "contract kept to κ, float32 / float64"]
    header += ["error on the dragon, float32: median / 99 %", f"outside the contract, float32 / float64, of {count:,}"]
    header += ["ns a matrix, float32 / float64"]
    default, control = (times[name, "float32"] for name in (jaxrot.DEFAULT_METHOD, "svd"))
    return (
        f"{_table(header, rows)}\n\n"
        f"Measured on {_date(report)} by `python -m jaxrot report`; {_machine(report)}, batches of {batch:,}, medians"
        f" of interleaved runs. The input is {count:,} shape-matching matrices of the Stanford dragon, which is"
        " twisted, bent, squashed, turned inside out and scrambled. Half of the default method's times lie between"
        f" {_quartiles(default)} ns, half of those of `svd` between {_quartiles(control)} ns. A smaller difference"
        " between two methods is noise."
    )


def summary_region(report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """The default method's time compared with that of LAPACK's SVD."""
    batch, times = _times(report)
    default, control = (
        " and ".join(f"{number(times[name, dtype]['median_ns'])} ns a matrix in {dtype}" for dtype in _DTYPES)
        for name in (jaxrot.DEFAULT_METHOD, "svd")
    )
    return (
        f"The default method, `{jaxrot.DEFAULT_METHOD}`, takes {default}. LAPACK's singular value decomposition,"
        f" `svd`, takes {control}. Measured on {_date(report)} by `python -m jaxrot report`; {_machine(report)},"
        f" batches of {batch:,}."
    )


def peers_region(report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """The default method compared with every peer in float32, and the finding on peers."""
    contenders = [entry for entry in report["peers"]["contenders"] if entry["dtype"] == "float32"]
    shown = [entry for entry in contenders if not entry["is_own"] or entry["name"].startswith(jaxrot.DEFAULT_METHOD)]
    rows = []
    for entry in sorted(shown, key=lambda entry: entry["time"]["median"]):
        gradient = entry["gradient_error"]
        name = f"**{entry['name']}**" if entry["is_own"] else entry["name"]
        rows.append(
            [
                name,
                f"{entry['threads']}",
                f"{entry['batch']:,}",
                _pair(entry["error"]),
                f"{entry['outside']:,}",
                number(entry["time"]["median"]),
                "-" if gradient is None else _pair(gradient),
                "-" if gradient is None else f"{len(entry['families_no_number'])}",
                "-" if gradient is None else number(entry["gradient_time"]["median"]),
            ]
        )
    header = ["", "threads", "batch", "error: median / 99 %", "outside the contract", "ns a matrix"]
    header += ["gradient's error: median / 99 %", "families with a NaN or infinite gradient", "ns with gradient"]
    sentence = next(sentence for sentence in report["findings"] if sentence.startswith("Peers: "))
    return (
        f"{_table(header, rows)}\n\nIn float32; measured on {_date(report)} by `python -m jaxrot report --peers`;"
        f" {_machine(report)}. {sentence}"
    )


def speed_region(report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """The library's own speed goals."""
    rows = []
    for goal in bench["goals"]:
        spread = f"{number(goal['median'])} ({number(goal['quartile_1'])}-{number(goal['quartile_3'])})"
        is_single = goal["quartile_1"] == goal["quartile_3"]
        bound = f"{'≥' if goal['at_least'] else '≤'} {number(goal['bound'])}"
        rows.append(
            [
                re.sub(r"\b(svd|singular_pair|newton|quaternion_average)\b", r"`\1`", goal["what"]),
                f"{goal['batch']:,}",
                number(goal["median"]) if is_single else spread,
                bound if goal["is_met"] else f"{bound}, missed",
            ]
        )
    return (
        f"{_table(['what', 'batch', 'measured: median (quartiles)', 'goal'], rows)}\n\nMeasured on {_date(bench)} by"
        f" `python -m jaxrot report --bench`; {_machine(bench)}."
    )


def guards_region(report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """Every guard of the default method: its time, and what breaks without it."""
    by_guard: dict[str, list[Mapping[str, Any]]] = {}
    for price in report["guards"]["default"]:
        by_guard.setdefault(price["guard"], []).append(price)
    rows = []
    for guard, prices in by_guard.items():
        families = dict.fromkeys(f"`{entry['family']}`" for price in prices for entry in price["broken"])
        most = list(families)[:4] + ([f"{len(families) - 4} more"] if len(families) > 4 else [])
        rows.append(
            [
                guard or "nothing",
                " / ".join(ratio_words(Time(**price["time"])) if guard else "1" for price in prices),
                " / ".join(f"{sum(entry['matrices'] for entry in price['broken']):,}" for price in prices),
                listed(most) if most else "none",
            ]
        )
    nothing = " / ".join(f"{number(price['time']['nanoseconds'])}" for price in by_guard[""])
    header = ["left out", "time without it over time with it, float32 / float64: median (quartiles)"]
    header += ["matrices outside the contract", "families of these matrices, the worst first"]
    return (
        f"{_table(header, rows)}\n\nMeasured on {_date(report)} by `python -m jaxrot report`, on 100,000 Gaussian"
        f" matrices; {_machine(report)}. With all guards the default method takes {nothing} ns a matrix."
    )


REGIONS: Mapping[str, Callable[[Mapping[str, Any], Mapping[str, Any]], str]] = {
    "summary": summary_region,
    "methods": methods_region,
    "peers": peers_region,
    "speed": speed_region,
    "guards": guards_region,
}


def _table(header: list[str], rows: list[list[str]]) -> str:
    return as_markdown(Table("", header, rows))


def _times(report: Mapping[str, Any]) -> tuple[int, dict[tuple[str, str], Mapping[str, Any]]]:
    """The largest batch and its times by method and dtype."""
    batch = largest_batch([Timing(**entry) for entry in report["timing"]])
    return batch, {(entry["method"], entry["dtype"]): entry for entry in report["timing"] if entry["batch"] == batch}


def _limit(method: jaxrot.Method, dtype: str) -> str:
    limit = method.condition_limit[dtype]
    return "all" if limit >= largest_condition(dtype) else number(limit) if limit else "-"


def _pair(error: Mapping[str, Any]) -> str:
    return " / ".join(number(float(error[what])) for what in ("median", "percentile_99"))


def _quartiles(timing: Mapping[str, Any]) -> str:
    return f"{number(timing['quartile_1_ns'])} and {number(timing['quartile_3_ns'])}"


def _date(content: Mapping[str, Any]) -> str:
    return content["environment"]["date"].split()[0]


def _machine(content: Mapping[str, Any]) -> str:
    environment = content["environment"]
    device, threads = environment["device"].partition(": ")[2], environment["threads"].removesuffix(" usable")
    return f"{device}, {threads}, jax {environment['jax, jaxlib, numpy'].split(',')[0]}"


if __name__ == "__main__":
    main()

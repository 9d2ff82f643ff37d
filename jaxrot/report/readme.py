"""`python -m jaxrot.report.readme FOLDER`: the README's measured tables and pictures, from a report and its bench.

The README holds regions between `<!-- measured: NAME -->` and `<!-- /measured -->`; each is written anew. FOLDER is
what `report --peers` and `report --bench` wrote to, both with `--out FOLDER`.
"""

import argparse
import json
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jaxrot
from jaxrot.measuring.domain import largest_condition
from jaxrot.measuring.timing import Timing
from jaxrot.measuring.words import listed, number
from jaxrot.report.drawing import pictures
from jaxrot.report.findings import largest_batch
from jaxrot.report.guards.prices import Time
from jaxrot.report.guards.tables import ratio_words
from jaxrot.report.measurement import WHOLE
from jaxrot.report.writing.tables import Table, as_markdown

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
    """Writes the README's regions and copies its pictures."""
    parser = argparse.ArgumentParser(prog="python -m jaxrot.report.readme", description=__doc__)
    parser.add_argument("folder", type=Path, help="what `report --peers` and `report --bench` have written")
    parser.add_argument("--readme", type=Path, default=Path("README.md"))
    parser.add_argument("--pictures", type=Path, default=Path("notebooks"))
    options = parser.parse_args(arguments)
    report, bench = (json.loads((options.folder / name).read_text("utf-8")) for name in ("report.json", "bench.json"))
    if report["peers"] is None or report["guards"] is None:
        parser.error(f"{options.folder} holds a report without peers or guards; expected that of `report --peers`")
    options.readme.write_text(filled(options.readme.read_text("utf-8"), report, bench), "utf-8")
    for name in PICTURES:
        shutil.copyfile(options.folder / name, options.pictures / name)


def filled(readme: str, report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """The README with every region written anew.

    Raises:
        KeyError: A region's name is none of `REGIONS`.
    """

    def region(match: re.Match[str]) -> str:
        return f"{match[1]}{match[2]}{REGIONS[match[1]](report, bench)}\n"

    return _REGION.sub(region, readme)


def methods_region(report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """Every method with its domain, its error on the report's input and its time, the fastest first."""
    accuracy = {(entry["method"], entry["dtype"]): entry for entry in report["accuracy"] if entry["set_name"] == WHOLE}
    batch = largest_batch([Timing(**entry) for entry in report["timing"]])
    times = {(e["method"], e["dtype"]): e for e in report["timing"] if e["batch"] == batch}
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
        f"Measured on {_date(report)} by `python -m jaxrot report`: {count:,} matrices A_pq of clusters of the Stanford"
        " dragon, twisted, bent, squashed, turned inside out and scrambled;"
        f" {_machine(report)}, batches of {batch:,}, medians of interleaved runs. Timings of the default spread from"
        f" {_quartiles(default)} ns between the quartiles, those of `svd` from {_quartiles(control)}. Times of methods"
        " that differ by less than such a spread do not tell them apart."
    )


def peers_region(report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """The sentence on the front, and jaxrot's default beside every peer in float32."""
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
    header += ["gradient's error: median / 99 %", "families where it is no number", "ns with gradient"]
    sentence = next(sentence for sentence in report["findings"] if sentence.startswith("Peers: "))
    return (
        f"{_table(header, rows)}\n\nIn float32; measured on {_date(report)} by `python -m jaxrot report --peers`;"
        f" {_machine(report)}. {sentence}"
    )


def speed_region(report: Mapping[str, Any], bench: Mapping[str, Any]) -> str:
    """The library's own goals."""
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
    """The guards of the default method."""
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
    header = ["left out", "time without it over with it, float32 / float64: median (quartiles)"]
    header += ["matrices outside the contract", "in the families, the worst first"]
    return (
        f"{_table(header, rows)}\n\nMeasured on {_date(report)} by `python -m jaxrot report`, on 100,000 Gaussian"
        f" matrices, for which the default takes {nothing} ns each; {_machine(report)}."
    )


REGIONS: Mapping[str, Callable[[Mapping[str, Any], Mapping[str, Any]], str]] = {
    "methods": methods_region,
    "peers": peers_region,
    "speed": speed_region,
    "guards": guards_region,
}


def _table(header: list[str], rows: list[list[str]]) -> str:
    return as_markdown(Table("", header, rows))


def _limit(method: jaxrot.Method, dtype: str) -> str:
    limit = method.condition_limit[dtype]
    return "all" if limit >= largest_condition(dtype) else number(limit) if limit else "-"


def _pair(error: Mapping[str, Any]) -> str:
    return " / ".join(number(float(error[what])) for what in ("median", "percentile_99"))


def _quartiles(timing: Mapping[str, Any]) -> str:
    return f"{number(timing['quartile_1_ns'])} to {number(timing['quartile_3_ns'])}"


def _date(content: Mapping[str, Any]) -> str:
    return content["environment"]["date"].split()[0]


def _machine(content: Mapping[str, Any]) -> str:
    environment = content["environment"]
    device, threads = environment["device"].partition(": ")[2], environment["threads"].removesuffix(" usable")
    return f"{device}, {threads}, jax {environment['jax, jaxlib, numpy'].split(',')[0]}"


if __name__ == "__main__":
    main()

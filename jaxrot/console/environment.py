"""The header of a report: the machine, the versions and the settings behind its numbers."""

import datetime
import os
import platform
import subprocess
from pathlib import Path

import jax
import jaxlib.version
import numpy as np

import jaxrot


def describe_environment(dtypes: tuple[str, ...]) -> dict[str, str]:
    """The lines of the header, values by name, in order."""
    device = jax.devices()[0]
    return {
        "jaxrot": f"{jaxrot.__version__}, commit {commit()}",
        "date": datetime.datetime.now().astimezone().isoformat(sep=" ", timespec="seconds"),
        "python": f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        "jax, jaxlib, numpy": f"{jax.__version__}, {jaxlib.version.__version__}, {np.__version__}",
        "device": f"{device.platform}: {processor() if device.platform == 'cpu' else device.device_kind}",
        "threads": f"{usable_cores()} cores usable",
        "load average": f"{load_average()} before the start",
        "XLA_FLAGS": os.environ.get("XLA_FLAGS", "") or "none",
        "dtype": ", ".join(dtypes),
    }


def commit() -> str:
    """The short hash of the checkout that jaxrot was imported from, with a `+` if files differ.

    git must track this file, because an installed copy may lie inside a checkout of another project.
    """
    here = Path(__file__)
    if _git("ls-files", "--error-unmatch", here.name, folder=here.parent) is None:
        return "unknown (not a checkout)"
    name = _git("rev-parse", "--short=12", "HEAD", folder=here.parent)
    changed = _git("status", "--porcelain", "--untracked-files=no", folder=here.parent)
    return "unknown" if name is None else name + ("+" if changed else "")


def _git(*arguments: str, folder: Path) -> str | None:
    try:
        done = subprocess.run(
            ["git", *arguments], cwd=folder, capture_output=True, text=True, timeout=10, check=True, encoding="utf-8"
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def processor() -> str:
    """The processor's name, if the operating system tells it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine() or "unknown processor"


def usable_cores() -> int:
    """The cores that this process may use: fewer than the machine has under `taskset` or in a container."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load_average() -> str:
    """The one-minute load average. If it is well above 0, other processes disturbed the timings."""
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"

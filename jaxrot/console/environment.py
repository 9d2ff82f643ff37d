"""The machine, the versions and the settings behind measured numbers."""

import contextlib
import datetime
import os
import platform
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import jax
import jaxlib.version
import numpy as np

import jaxrot


@contextlib.contextmanager
def measuring_configuration() -> Iterator[None]:
    """Allows float64, and disables the compilation cache, which would shorten the measured compile times."""
    wanted = {"jax_enable_x64": True, "jax_enable_compilation_cache": False}
    before = {name: getattr(jax.config, name) for name in wanted}
    try:
        for name, value in wanted.items():
            jax.config.update(name, value)
        yield
    finally:
        for name, value in before.items():
            jax.config.update(name, value)


def describe_environment(dtypes: tuple[str, ...]) -> dict[str, str]:
    """The lines of a report's header, values by name."""
    device = jax.devices()[0]
    # If it is well above 0, other processes disturbed the timings.
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    return {
        "jaxrot": f"{jaxrot.__version__}, commit {commit()}",
        "date": datetime.datetime.now().astimezone().isoformat(sep=" ", timespec="seconds"),
        "python": f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        "jax, jaxlib, numpy": f"{jax.__version__}, {jaxlib.version.__version__}, {np.__version__}",
        "device": f"{device.platform}: {processor() if device.platform == 'cpu' else device.device_kind}",
        "threads": f"{usable_cores()} cores usable",
        "load average": f"{load} before the start",
        "XLA_FLAGS": os.environ.get("XLA_FLAGS", "") or "none",
        "dtype": ", ".join(dtypes),
    }


def commit() -> str:
    """The short hash of the checkout that jaxrot was imported from, with a `+` if files differ.

    git must track this file, because an installed copy may lie inside a checkout of another project.
    """
    folder, name = os.path.split(__file__)

    def git(*arguments: str) -> str:
        command = ["git", *arguments]
        done = subprocess.run(command, cwd=folder, capture_output=True, timeout=10, check=True, encoding="utf-8")
        return done.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", name)
        return git("describe", "--always", "--exclude=*", "--abbrev=12", "--dirty=+")
    except (OSError, subprocess.SubprocessError):
        return "unknown (not a checkout)"


def processor() -> str:
    """The processor's name, if the operating system tells it."""
    with contextlib.suppress(OSError):
        content = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        if found := re.search(r"^model name\s*:\s*(.+)$", content, re.MULTILINE):
            return found[1].strip()
    return platform.processor() or platform.machine() or "unknown processor"


def usable_cores() -> int:
    """The cores that this process may use: fewer than the machine has under `taskset` or in a container."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

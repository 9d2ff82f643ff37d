"""A progress display on a terminal, silence elsewhere, and the check for the packages that a command needs."""

import importlib.util
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from jaxrot.console.errors import UserError
from jaxrot.console.interrupts import Interrupts
from jaxrot.console.printing import is_watched


def check_installed(needed: Sequence[str], extra: str) -> None:
    """Raises a UserError if a package of an extra is missing, or tqdm, which a terminal needs."""
    needed = [*needed, *(["tqdm"] if is_watched() else [])]
    missing = [name for name in needed if importlib.util.find_spec(name) is None]
    if missing:
        raise UserError(f"not installed: {', '.join(missing)}; expected: pip install 'jaxrot[{extra}]'")


@contextmanager
def progress(interrupts: Interrupts) -> Iterator[Callable[[str], None]]:
    """Yields `say(label)`, which shows what the command does next.

    `say` raises KeyboardInterrupt if Ctrl-C was pressed and has had no effect yet. The display goes to standard error,
    so that standard output can be redirected. If standard error is no terminal, nothing is shown.
    """
    if not is_watched():
        yield lambda label: interrupts.check()
        return
    from tqdm import tqdm

    with tqdm(leave=False, bar_format="{elapsed} {desc}") as display:

        def say(label: str) -> None:
            interrupts.check()
            display.set_description_str(label)

        yield say

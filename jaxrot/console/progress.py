"""A progress display on a terminal, and silence elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from jaxrot.console.interrupts import Interrupts
from jaxrot.console.printing import is_watched


@contextmanager
def progress(interrupts: Interrupts) -> Iterator[Callable[[str], None]]:
    """Yields `say(label)`, which shows what the command does next.

    `say` raises KeyboardInterrupt if Ctrl-C was pressed and has had no effect yet. The display goes to standard error,
    so that standard output can be redirected. If standard error is no terminal, nothing is shown, and tqdm is not
    needed.
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

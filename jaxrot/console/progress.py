"""A progress bar where somebody is looking, silence elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from jaxrot.console.interrupts import Interrupts
from jaxrot.console.printing import is_watched


@contextmanager
def progress(steps: int, interrupts: Interrupts) -> Iterator[Callable[[str], None]]:
    """Yields the function to call before each of `steps` steps, with what it is.

    The function raises KeyboardInterrupt if Ctrl-C was pressed and nothing has dealt with it yet.

    The bar goes to stderr, so that the table on stdout can be redirected; where stderr is no terminal nothing is
    written and tqdm is not needed.
    """
    if not is_watched():
        yield lambda step: interrupts.check()
        return
    from tqdm import tqdm

    begun: list[str] = []
    with tqdm(total=steps, leave=False, bar_format="{percentage:3.0f}% |{bar:24}| {elapsed} {desc}") as bar:

        def advance(step: str) -> None:
            interrupts.check()
            bar.set_description_str(step, refresh=False)
            # A step counts when the next begins: the bar is full only when the work is done.
            begun.append(step)
            bar.n = len(begun) - 1
            bar.refresh()

        yield advance

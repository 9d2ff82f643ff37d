"""A progress bar where somebody is looking, silence elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress(steps: int) -> Iterator[Callable[[str], None]]:
    """Yields the function to call before each of `steps` steps, with what it is.

    The bar goes to stderr, so that the table on stdout can be redirected; where stderr is no terminal nothing is
    written and tqdm is not needed.
    """
    if not sys.stderr.isatty():
        yield lambda step: None
        return
    from tqdm import tqdm

    begun: list[str] = []
    with tqdm(total=steps, leave=False, bar_format="{percentage:3.0f}% |{bar:24}| {elapsed} {desc}") as bar:

        def advance(step: str) -> None:
            bar.set_description_str(step, refresh=False)
            # A step counts when the next begins: the bar is full only when the work is done.
            begun.append(step)
            bar.n = len(begun) - 1
            bar.refresh()

        yield advance

"""Standard output and standard error, which may be closed, full, or a pipe that nobody reads."""

import contextlib
import os
import sys
from pathlib import Path
from typing import TextIO

from jaxrot.console.errors import UnreadError, UserError, shown


def show(text: str, folder: Path | None = None) -> None:
    """Prints to standard output, and checks that the text arrives. An error message names the folder of the results.

    Raises:
        UserError: Standard output is closed, or cannot be written to, as on a full disk.
        UnreadError: Standard output is a pipe, and its reader has gone.
    """
    results = "" if folder is None else f"; the results are in {shown(folder)}"
    if sys.stdout is None:
        raise UserError(f"standard output is closed{results}")
    try:
        print(text, flush=True)
    except BrokenPipeError:
        _discard(sys.stdout)
        raise UnreadError from None
    except OSError as error:
        _discard(sys.stdout)
        reason = (error.strerror or str(error)).lower()
        raise UserError(f"standard output cannot be written to ({reason}){results}") from None


def complain(text: str) -> None:
    """Prints to standard error. If that is not possible, only the exit status reports the error."""
    if sys.stderr is None:
        return  # print would take standard output instead
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        _discard(sys.stderr)


def is_watched() -> bool:
    """Whether standard error is a terminal."""
    return sys.stderr is not None and sys.stderr.isatty()


def _discard(stream: TextIO) -> None:
    """Discards the buffer. Python would try to write it again at exit, and print a traceback."""
    with contextlib.suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)

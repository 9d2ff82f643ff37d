"""Ctrl-C while `python -m jaxrot` is still importing.

Python imports this package, which takes a second, before it runs `jaxrot/__main__.py`. A `try` in that file is too
late. So the package imports this module first. Where another program imports jaxrot, nothing happens here.
"""

import contextlib
import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130  # 128 + SIGINT: what a shell reports of a program that Ctrl-C ended


def exit_at_once(number: int, frame: FrameType | None) -> None:
    """Says so in one line and ends the process: a command that is still importing has nothing to save."""
    # No exception: an extension module may catch it during its import, and raise something else.
    with contextlib.suppress(OSError):
        os.write(2, b"python -m jaxrot: interrupted, nothing written\n")
    os._exit(INTERRUPTED)


def is_command() -> bool:
    """Whether this process is `python -m jaxrot`, and Python is still looking for its `__main__`."""
    words = getattr(sys, "argv", None) or [""]
    # Until it has found it, Python leaves "-m" where the name of the program belongs. What follows are the arguments.
    return words[0] == "-m" and sys.orig_argv[-len(words)].removeprefix("-m") == "jaxrot"


# A shell starts a background job with SIGINT ignored. That must stay so.
if is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, exit_at_once)

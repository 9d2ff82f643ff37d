"""Ctrl-C while `python -m jaxrot` is still importing.

Python imports this package, which takes a second, before it runs `jaxrot/__main__.py`. A `try` in that file is too
late. So the package imports this module first. If another program imports jaxrot, this module does nothing.
"""

import contextlib
import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130  # 128 + SIGINT, the exit status that a shell reports after Ctrl-C


def exit_at_once(number: int, frame: FrameType | None) -> None:
    """Prints one line and ends the process. A command that is still importing has nothing to save."""
    # Raise no exception: an extension module may catch it during its import, and raise another one.
    with contextlib.suppress(OSError):
        os.write(2, b"python -m jaxrot: interrupted, nothing written\n")
    os._exit(INTERRUPTED)


def is_command() -> bool:
    """Whether this process is `python -m jaxrot`, and Python has not found its `__main__` yet."""
    words = getattr(sys, "argv", None) or [""]
    # Until then sys.argv[0] is "-m" instead of the name of the program. The arguments follow it.
    return words[0] == "-m" and sys.orig_argv[-len(words)].removeprefix("-m") == "jaxrot"


# A shell starts a background job with SIGINT ignored. Keep it ignored: Ctrl-C in the foreground must not end that job.
if is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, exit_at_once)

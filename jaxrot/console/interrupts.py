"""Ctrl-C during a command: one line where nothing is finished, and no result lost where something is."""

import math
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from types import FrameType
from typing import Any

from jaxrot._startup import exit_at_once

# A compilation may take ten seconds, and Python sees a Ctrl-C only when it is done.
_PATIENCE_S = 0.5
_REPEAT_S = 0.05


class Interrupts:
    """What Ctrl-C does: it raises KeyboardInterrupt until `hold`, and is only noted from then on.

    Attributes:
        pending: Ctrl-C was pressed, and has had no effect yet.
        has_results: The command has results to lose.
        handled_at: When Python last saw a Ctrl-C, on the monotonic clock.
    """

    def __init__(self) -> None:
        self.pending = False
        self.has_results = False
        self.handled_at = -math.inf
        self._is_raising = True

    def handle(self, number: int, frame: FrameType | None) -> None:
        """The signal handler. A second Ctrl-C raises in any case, unless the first has had its effect."""
        self.handled_at = time.monotonic()
        is_second, self.pending = self.pending, True
        if is_second or self._is_raising:
            raise KeyboardInterrupt

    def repeat(self) -> None:
        """Raises again, from any thread into the main one, what was raised in vain."""
        if self.pending and self._is_raising:
            signal.raise_signal(signal.SIGINT)

    def hold(self) -> None:
        """From now on there are results to lose: a Ctrl-C is noted, and the command asks for it where it can stop."""
        self.has_results, self._is_raising = True, False

    def check(self) -> None:
        """Raises KeyboardInterrupt if Ctrl-C was pressed and has had no effect yet."""
        if self.pending:
            self.forget()
            raise KeyboardInterrupt

    def forget(self) -> None:
        """A Ctrl-C up to now has had its effect."""
        self.pending = False

    @contextmanager
    def raising(self) -> Iterator[None]:
        """For work that takes long and may be lost: here Ctrl-C raises KeyboardInterrupt at once, held or not."""
        before, self._is_raising = self._is_raising, True
        try:
            self.check()
            yield
        except BaseException:
            # Code that cleans up after a KeyboardInterrupt may raise an error of its own in its place.
            if self.pending:
                raise KeyboardInterrupt from None
            raise
        finally:
            self._is_raising, self.pending = before, False


@contextmanager
def watched(*, owns_process: bool = False) -> Iterator[Interrupts]:
    """Handles Ctrl-C for one command, where the process lets it: in the main thread, and not as a background job.

    Args:
        owns_process: The process runs nothing but the command, and may be ended where Python does not see the Ctrl-C.
    """
    interrupts = Interrupts()
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield interrupts
        return
    report_unraisable = sys.unraisablehook

    def hook(unraisable: Any) -> None:
        # Python cannot raise in a finalizer or in a callback of the garbage collector, such as JAX has one. It would
        # print a traceback and go on.
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(_REPEAT_S, interrupts.repeat).start()
        else:
            report_unraisable(unraisable)

    sys.unraisablehook = hook
    signal.signal(signal.SIGINT, interrupts.handle)
    try:
        with _ending_if_stuck(interrupts) if owns_process else nullcontext():
            yield interrupts
    finally:
        signal.signal(signal.SIGINT, before)
        sys.unraisablehook = report_unraisable


@contextmanager
def _ending_if_stuck(interrupts: Interrupts) -> Iterator[None]:
    """Ends the process if there is nothing to save and a Ctrl-C does not get through to Python."""
    reader, writer = socket.socketpair()

    def watch() -> None:
        with reader:
            while signal.SIGINT in reader.recv(64):
                arrived = time.monotonic()
                time.sleep(_PATIENCE_S)
                if not interrupts.has_results and interrupts.handled_at < arrived - _PATIENCE_S:
                    exit_at_once(signal.SIGINT, None)

    with writer:
        writer.setblocking(False)
        # A byte arrives here at once. The handler has to wait until the main thread is back in Python.
        before = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
        threading.Thread(target=watch, daemon=True).start()
        try:
            yield
        finally:
            signal.set_wakeup_fd(before)

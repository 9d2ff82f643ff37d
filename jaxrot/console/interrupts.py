"""Ctrl-C during a command: one line before there are results, and no result lost after that."""

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
    """The effect of Ctrl-C: it raises KeyboardInterrupt until `hold`, and is only noted from then on."""

    def __init__(self) -> None:
        self.pending = False  # Ctrl-C was pressed and has had no effect yet
        self.has_results = False  # The command has results to lose
        self.handled_at = -math.inf  # When Python last saw a Ctrl-C, on the monotonic clock
        self._is_raising = True

    def handle(self, number: int, frame: FrameType | None) -> None:
        """The signal handler. A second Ctrl-C raises in any case, unless the first has had its effect."""
        self.handled_at = time.monotonic()
        is_second, self.pending = self.pending, True
        if is_second or self._is_raising:
            raise KeyboardInterrupt

    def repeat(self) -> None:
        """Raises again in the main thread, from any thread, if the first exception was lost."""
        if self.pending and self._is_raising:
            signal.raise_signal(signal.SIGINT)

    def hold(self) -> None:
        """From now on a Ctrl-C is only noted, because there are results to lose. The command calls `check` to stop."""
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
        """Inside, Ctrl-C raises KeyboardInterrupt at once, for long work whose result may be lost."""
        before, self._is_raising = self._is_raising, True
        try:
            self.check()
            yield
        except BaseException:
            # Code that cleans up after a KeyboardInterrupt may raise an error of its own instead.
            if self.pending:
                raise KeyboardInterrupt from None
            raise
        finally:
            self._is_raising, self.pending = before, False


@contextmanager
def watched(*, owns_process: bool = False) -> Iterator[Interrupts]:
    """Handles Ctrl-C for one command, in the main thread and unless the process is a background job.

    A process that runs only the command, `owns_process`, is ended if a Ctrl-C does not reach Python.
    """
    interrupts = Interrupts()
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield interrupts
        return
    report_unraisable = sys.unraisablehook

    def hook(unraisable: Any) -> None:
        # Python cannot raise in a finalizer or in a callback of the garbage collector, such as that of JAX. It would
        # print a traceback and continue.
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
    """Ends the process if there is no result to save and a Ctrl-C does not reach Python."""
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

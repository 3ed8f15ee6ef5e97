"""Premature ends of a command: Ctrl-C, similar signals, and a closed output pipe."""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from robot_model.system.interrupts import ENDING

__all__ = [
    "CLOSED_PIPE",
    "Interrupted",
    "Signals",
    "closed_pipe",
    "interrupting",
    "nothing_more_written",
]

#: Exit code of a program ended by a signal: this plus the signal's number.
BY_SIGNAL = 128
#: Exit code as after SIGPIPE (13), which ends other programs when nobody reads their output any more.
CLOSED_PIPE = BY_SIGNAL + 13

#: Time after which to check whether an interrupt was dropped [s].
AGAIN = 0.2


class Interrupted(Exception):
    """A command was interrupted; the message, if any, says how to continue."""


class Signals:
    """The received signals, and their handlers.

    A library that queries Python attributes, as CasADi does for every operation between its matrices, may
    drop an exception raised by a handler there. So a timer checks whether the interrupt is being handled, and
    raises it again if not.
    """

    def __init__(self) -> None:
        self._first: int | None = None

    def raise_interrupt(self, number: int, frame: FrameType | None) -> None:
        """Handler of signals that request an end."""
        self._first = self._first or number
        self._look_again(AGAIN)
        raise KeyboardInterrupt

    def raise_again(self, number: int, frame: FrameType | None) -> None:
        """Handler of the timer."""
        if self._first is not None and not _is_being_handled(sys.exc_info()[1]):
            raise KeyboardInterrupt

    def arrived(self) -> None:
        """Note that the interrupt has been caught."""
        self._look_again(0.0)

    def _look_again(self, interval: float) -> None:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, interval, interval)

    @property
    def exit_code(self) -> int:
        """Exit code of the interrupted program."""
        return BY_SIGNAL + (self._first or signal.SIGINT)

    @property
    def words(self) -> str:
        """Message about the interrupt."""
        if self._first is None or self._first == signal.SIGINT:
            return "interrupted"
        return f"ended by {signal.Signals(self._first).name}"


def _is_being_handled(handled: BaseException | None) -> bool:
    """Whether an interrupt is being handled: cleaning up after it must not be interrupted by another one."""
    while handled is not None:
        if isinstance(handled, KeyboardInterrupt | GeneratorExit):
            return True
        handled = handled.__context__
    return False


@contextmanager
def interrupting() -> Iterator[Signals]:
    """SIGTERM and SIGHUP raise `KeyboardInterrupt` like Ctrl-C; ignored ones (nohup) stay ignored."""
    signals = Signals()
    if threading.current_thread() is not threading.main_thread():
        yield signals
        return
    caught = [kind for kind in ENDING if kind == signal.SIGINT or signal.getsignal(kind) != signal.SIG_IGN]
    before = {kind: signal.signal(kind, signals.raise_interrupt) for kind in caught}
    if hasattr(signal, "SIGALRM"):
        before[signal.SIGALRM] = signal.signal(signal.SIGALRM, signals.raise_again)
    try:
        yield signals
    finally:
        signals.arrived()
        for kind, handler in before.items():
            signal.signal(kind, handler)


def closed_pipe(error: BaseException) -> bool:
    """Whether the output pipe is closed; rich and typer raise `SystemExit` in that case."""
    return isinstance(error.__context__ if isinstance(error, SystemExit) else error, BrokenPipeError)


def nothing_more_written() -> None:
    """Discard output to a closed pipe, also when Python exits."""
    with open(os.devnull, "wb") as nowhere:
        for number in filter(_has_no_reader, _printed()):
            os.dup2(nowhere.fileno(), number)


def _printed() -> Iterator[int]:
    """File descriptors of standard output and standard error, where there are any."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # closed, or no file at all
            yield stream.fileno()


def _has_no_reader(number: int) -> bool:
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    poll.register(number, 0)
    return any(event & select.POLLERR for _, event in poll.poll(0))

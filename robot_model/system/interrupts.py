"""Interrupts that libraries swallow, and short blocks that must not be interrupted.

Ctrl-C and signals like it arrive as an exception, `KeyboardInterrupt`, which their handler raises between two
instructions of Python. A library that calls back into Python may catch it there and report its own error
instead: CasADi reports a failed right-hand side, Exudyn an error in the user's Python code.
"""

from __future__ import annotations

import io
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["ENDING", "interruptible", "undisturbed"]

Handler = Callable[[int, FrameType | None], object]


def _known(*names: str) -> tuple[signal.Signals, ...]:
    return tuple(getattr(signal, name) for name in names if hasattr(signal, name))


#: Signals that request a program to end, as far as this system has them.
ENDING = _known("SIGINT", "SIGTERM", "SIGHUP")
#: Signals whose handlers may raise an exception: a program may use the timer to repeat an interrupt.
RAISING = (*ENDING, *_known("SIGALRM"))


@contextmanager
def interruptible() -> Iterator[None]:
    """Exceptions of signal handlers during the block leave the block, even if a library replaces them.

    The library's misleading messages to `sys.stderr` are dropped.
    """
    raised: list[BaseException] = []
    heard = sys.stderr

    def noting(handler: Handler) -> Handler:
        def noted(number: int, frame: FrameType | None) -> None:
            try:
                handler(number, frame)
            except BaseException as error:
                raised.append(error)
                sys.stderr = io.StringIO()
                raise

        return noted

    with _handled_by(noting):
        try:
            yield
        except Exception:
            if raised:
                raise raised[0] from None
            raise
        finally:
            sys.stderr = heard
    if raised:
        raise raised[0]


@contextmanager
def undisturbed() -> Iterator[None]:
    """Defer signals that end a program until after the block, for blocks of some milliseconds."""
    waiting: list[tuple[Handler, int]] = []

    def deferring(handler: Handler) -> Handler:
        return lambda number, frame: waiting.append((handler, number))

    try:
        with _handled_by(deferring):
            yield
    finally:
        for handler, number in waiting:
            handler(number, None)


@contextmanager
def _handled_by(other: Callable[[Handler], Handler]) -> Iterator[None]:
    """Replace every Python handler by `other` of it; only the main thread has handlers."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in RAISING}
    ours = {number: handler for number, handler in before.items() if callable(handler)}
    try:
        for number, handler in ours.items():
            signal.signal(number, other(handler))
        yield
    finally:
        for number, handler in ours.items():
            signal.signal(number, handler)

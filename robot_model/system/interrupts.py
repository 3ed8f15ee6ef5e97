"""Interrupts that libraries swallow, and short stretches that an interrupt must not cut in two.

Ctrl-C and signals like it arrive as an exception, `KeyboardInterrupt`, which their handler raises between two
instructions of Python. A library that calls back into Python may meet it there and report a fault of its own
instead: CasADi says that a right-hand side failed, Exudyn that the user's Python code is wrong.
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


#: Signals that ask a program to end: those of them that this system has.
ENDING = _known("SIGINT", "SIGTERM", "SIGHUP")
#: Those whose handlers may raise something: a program may use the timer to repeat an interrupt.
RAISING = (*ENDING, *_known("SIGALRM"))


@contextmanager
def interruptible() -> Iterator[None]:
    """What a signal's handler raises during the block leaves the block, whatever a library makes of it.

    What the library then writes to `sys.stderr`, about a fault that is none, is dropped.
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
    """Signals that end a program take effect after the block, for stretches of some milliseconds."""
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
    """`other` of every Python handler takes its place; only the main thread has handlers."""
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

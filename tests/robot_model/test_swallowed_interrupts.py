"""Interrupts that a library swallows are raised; those in short protected sections wait."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress

import pytest

from robot_model.system.interrupts import interruptible, undisturbed


def interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def swallowed() -> None:
    with suppress(KeyboardInterrupt):
        interrupt()


def taken_for_a_fault() -> None:
    try:
        interrupt()
    except KeyboardInterrupt:
        raise RuntimeError("check your code") from None


@pytest.mark.parametrize("library", [interrupt, swallowed, taken_for_a_fault])
def test_an_interrupt_leaves_the_block_even_if_a_library_swallows_it(library: Callable[[], None]) -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), interruptible():
        library()
    assert signal.getsignal(signal.SIGINT) is before


def test_an_error_without_an_interrupt_is_unchanged() -> None:
    with pytest.raises(RuntimeError, match="check your code"), interruptible():
        raise RuntimeError("check your code")


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interruptible():
            interrupt()
    finally:
        signal.signal(signal.SIGINT, before)


def test_it_may_be_called_outside_the_main_thread() -> None:
    """Where there are no handlers to set."""
    done: list[str] = []

    def work() -> None:
        with interruptible(), undisturbed():
            done.append("work")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == ["work"]


def test_an_interrupt_is_deferred_to_the_end_of_a_block() -> None:
    done: list[str] = []

    def stretch() -> None:
        with undisturbed():
            interrupt()
            done.append("first half")
            interrupt()
            done.append("second half")
        done.append("after")

    with pytest.raises(KeyboardInterrupt):
        stretch()
    assert done == ["first half", "second half"]

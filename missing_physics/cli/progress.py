"""Progress on stderr: the current step, the completed fraction and the duration."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock, Timer
from time import perf_counter

from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from missing_physics.reporting.terminal.console import DescriptionColumn, PlainConsole

__all__ = ["Steps", "phases", "steps"]

#: Number of lines for a phase with a known fraction, if stderr is not a terminal.
PARTS = 10
#: Seconds for which the first lines are held back: most unusable input is detected by then, and only the
#: sentence about it is printed.
HELD = 1.0


class Steps:
    """Shows the steps of a command: bars on a terminal, lines elsewhere, nothing when quiet."""

    def __init__(self, console: PlainConsole | None = None, bars: Progress | None = None) -> None:
        self._console, self._bars = console, bars

    @contextmanager
    def step(self, name: str, *, total: float | None = None) -> Iterator[Callable[[float], None]]:
        """One step; yields a function to be called with the progress so far, of `total`."""
        begin = perf_counter()
        task = None if self._bars is None else self._bars.add_task(name, total=total)

        def update(done: float) -> None:
            if self._bars is not None and task is not None:
                self._bars.update(task, completed=done)

        yield update
        if self._bars is not None and task is not None:
            self._bars.update(task, total=total or 1.0, completed=total or 1.0)
        else:
            self.note(f"{name}: {perf_counter() - begin:.1f} s")

    def note(self, text: str) -> None:
        """Print a permanent line."""
        if self._console is not None:
            self._console.print(text, soft_wrap=True)


class _Lines:
    """Lines if stderr is not a terminal: one at the start of each phase, one for each of its `PARTS`."""

    def __init__(self, console: PlainConsole) -> None:
        self._console, self._begin = console, perf_counter()
        self._phrase, self._part = "", 0
        self._held: list[str] | None = []
        self._lock = Lock()
        self._timer = Timer(HELD, self.release)
        self._timer.daemon = True
        self._timer.start()

    def show(self, phrase: str, share: float | None = None) -> None:
        part = int(PARTS * (share or 0.0) + 1e-9)  # shares such as 0.3 are rounded down a little
        if phrase != self._phrase:
            self._add(phrase)
        elif part > self._part:
            self._add(f"{phrase}: {100 * part // PARTS} %")
        self._phrase, self._part = phrase, part

    def _add(self, words: str) -> None:
        line = f"{perf_counter() - self._begin:6.0f} s  {words}"
        with self._lock:
            if self._held is None:
                self._console.print(line, soft_wrap=True)
            else:
                self._held.append(line)

    def release(self) -> None:
        """Print the lines held back, and every further line at once."""
        with self._lock:
            for line in self._held or ():
                self._console.print(line, soft_wrap=True)
            self._held = None

    def stop(self) -> None:
        """Discard lines that were not printed yet."""
        self._timer.cancel()


@contextmanager
def phases(*, quiet: bool, measured: bool = False) -> Iterator[Callable[..., None]]:
    """A function that takes a phrase for the current phase and, if known, the completed fraction.

    They are shown on stderr: in place on a terminal, otherwise as lines, so that a log shows the progress of
    a long run.

    Args:
        quiet: show nothing.
        measured: whether fractions are given, so that a bar and the remaining time can be shown.
    """
    if quiet:
        yield lambda phrase, share=None: None
        return
    console = PlainConsole(stderr=True)
    if not console.is_terminal:
        lines = _Lines(console)
        try:
            yield lines.show
            lines.release()
        finally:
            lines.stop()
        return
    known = (BarColumn(), TimeRemainingColumn()) if measured else ()
    columns = (SpinnerColumn(), DescriptionColumn(), *known, TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bars:
        task = bars.add_task("starting", total=1.0 if measured else None)

        def show(phrase: str, share: float | None = None) -> None:
            if share == 0.0:
                bars.reset(task)
            bars.update(task, description=phrase, completed=share)

        yield show


@contextmanager
def steps(*, quiet: bool) -> Iterator[Steps]:
    """Steps shown on stderr while the block runs, unless `quiet`."""
    console = PlainConsole(stderr=True)
    if quiet or not console.is_terminal:
        yield Steps(None if quiet else console)
        return
    columns = (
        SpinnerColumn(),
        DescriptionColumn(),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bars:
        yield Steps(console, bars)

"""Progress on stderr: what runs, how far it is, how long it takes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

__all__ = ["Steps", "steps"]


class Steps:
    """Tells the steps of a command: bars on a terminal, lines elsewhere, nothing when quiet."""

    def __init__(self, console: Console | None = None, bars: Progress | None = None) -> None:
        self._console, self._bars = console, bars

    @contextmanager
    def step(self, name: str, *, total: float | None = None) -> Iterator[Callable[[float], None]]:
        """One step; gives a function that is called with how far it has come, of `total`."""
        begin = perf_counter()
        task = None if self._bars is None else self._bars.add_task(name, total=total)

        def tell(done: float) -> None:
            if self._bars is not None and task is not None:
                self._bars.update(task, completed=done)

        yield tell
        if self._bars is not None and task is not None:
            self._bars.update(task, total=total or 1.0, completed=total or 1.0)
        else:
            self.note(f"{name}: {perf_counter() - begin:.1f} s")

    def note(self, text: str) -> None:
        """A line that stays."""
        if self._console is not None:
            self._console.print(text, markup=False, highlight=False, soft_wrap=True)


@contextmanager
def steps(*, quiet: bool) -> Iterator[Steps]:
    """Steps shown on stderr while the block runs; with `quiet` they are not."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield Steps(None if quiet else console)
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bars:
        yield Steps(console, bars)

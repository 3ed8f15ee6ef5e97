"""Progress on stderr: what runs, how far it is, how long it takes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

__all__ = ["Steps", "steps"]


class Steps:
    """Tells the steps of a command; without a display it is silent."""

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress

    @contextmanager
    def step(self, name: str, *, total: float | None = None) -> Iterator[Callable[[float], None]]:
        """One step; gives a function that is called with how far it has come, of `total`."""
        if self._progress is None:
            yield lambda done: None
            return
        display = self._progress
        task = display.add_task(name, total=total)
        yield lambda done: display.update(task, completed=done)
        display.update(task, total=total or 1.0, completed=total or 1.0)

    def note(self, text: str) -> None:
        """A line that stays."""
        if self._progress is not None:
            self._progress.console.print(text, markup=False, highlight=False)


@contextmanager
def steps(*, quiet: bool) -> Iterator[Steps]:
    """Steps shown on stderr while the block runs; with `quiet` they are not."""
    if quiet:
        yield Steps()
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        yield Steps(progress)

"""``python -m missing_physics``: the same command line as ``missing-physics``."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from types import FrameType

__all__ = ["main"]

#: Exit codes from here on are those of a program that a signal ended.
BY_SIGNAL = 128


def main() -> None:
    """The command line; Ctrl-C ends it at once, also while its libraries are loaded, which takes seconds."""
    before = signal.signal(signal.SIGINT, _end_at_once)
    from missing_physics.cli import main as run

    signal.signal(signal.SIGINT, before)
    try:
        run()
    except SystemExit as end:
        if isinstance(end.code, int) and end.code > BY_SIGNAL:
            with suppress(AttributeError, OSError):  # where nothing can be printed any more
                sys.stdout.flush()
            os._exit(end.code)  # Python would first free all that is in memory, for as long as a second
        raise


def _end_at_once(number: int, frame: FrameType | None) -> None:
    """Nothing has begun yet that would have to be tidied up."""
    os._exit(BY_SIGNAL + number)


if __name__ == "__main__":
    main()

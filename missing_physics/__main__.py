"""``python -m missing_physics``: the same command line as ``missing-physics``."""

from __future__ import annotations

import importlib.util
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from types import FrameType

__all__ = ["foreign_room", "main"]

#: Packages that are installed next to this one.
ROOMS = ("robot_model", "reference_model", "exudyn_model")
UNUSABLE = 2

#: Exit codes from here on are those of a program that a signal ended.
BY_SIGNAL = 128


def main() -> None:
    """The command line; Ctrl-C ends it at once, also while its libraries are loaded, which takes seconds."""
    before = signal.signal(signal.SIGINT, _end_at_once)
    if sentence := foreign_room():
        print(f"missing-physics: {sentence}", file=sys.stderr)
        raise SystemExit(UNUSABLE)
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


def foreign_room() -> str:
    """What to do where another distribution's package hides one of `ROOMS`; empty where none does."""
    here = Path(__file__).resolve().parents[1]
    for name in ROOMS:
        found = importlib.util.find_spec(name)
        origin = None if found is None else found.origin
        if origin is None or Path(origin).resolve().parents[1] == here:
            continue  # one that is kept from a blind diagnosis is not needed by it
        return (
            f"the package {name} of missing-physics is needed, and that in {origin} hides it; install "
            "missing-physics in an environment of its own."
        )
    return ""


def _end_at_once(number: int, frame: FrameType | None) -> None:
    """Nothing has begun yet that would have to be tidied up."""
    os._exit(BY_SIGNAL + number)


if __name__ == "__main__":
    main()

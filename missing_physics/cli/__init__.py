"""The front door: one file per command, gathered here."""

from __future__ import annotations

import importlib
import pkgutil
import sys

import typer

from robot_model import InputError, lacks_room

__all__ = ["app", "main"]

UNUSABLE_INPUT = 2
#: The disk is full or failing, or there are too many files; nothing is said of the input.
TRY_AGAIN = 75

app = typer.Typer(
    name="missing-physics",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Find the physics that a robot's simulation leaves out: locate, name, model, prove.",
)


def _register() -> None:
    """Every module of this package that has a `register(app)` is a command."""
    for info in sorted(pkgutil.iter_modules(__path__), key=lambda item: item.name):
        module = importlib.import_module(f"{__name__}.{info.name}")
        if hasattr(module, "register"):
            module.register(app)


_register()


def main() -> None:
    """Run the command line; unusable input gives one sentence on stderr and exit code 2.

    Where the machine refuses, as for want of room on the disk, the exit code is 75: another try may succeed.
    """
    try:
        app()
    except InputError as error:
        print(f"missing-physics: {error}", file=sys.stderr)
        sys.exit(TRY_AGAIN if lacks_room(error) else UNUSABLE_INPUT)
    except OSError as error:
        where = f" ({error.filename})" if error.filename else ""
        print(f"missing-physics: the system refused: {error.strerror or error}{where}.", file=sys.stderr)
        sys.exit(TRY_AGAIN if lacks_room(error) else UNUSABLE_INPUT)

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
#: What a command line that cannot be read raises.
UsageError: type[Exception] = typer.BadParameter.__bases__[0]

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
        code = app(prog_name="missing-physics", standalone_mode=False)
    except UsageError as error:
        sys.exit(_told(error))
    except typer.Abort:
        sys.exit(1)
    except InputError as error:
        print(f"missing-physics: {error}", file=sys.stderr)
        sys.exit(TRY_AGAIN if lacks_room(error) else UNUSABLE_INPUT)
    except OSError as error:
        where = f" ({error.filename})" if error.filename else ""
        print(f"missing-physics: the system refused: {error.strerror or error}{where}.", file=sys.stderr)
        sys.exit(TRY_AGAIN if lacks_room(error) else UNUSABLE_INPUT)
    sys.exit(code if isinstance(code, int) else 0)


def _told(error: Exception) -> int:
    """Say in a sentence what is wrong with the command line; where nothing was asked for, show the help."""
    context = getattr(error, "ctx", None)
    if type(error).__name__ == "NoArgsIsHelpError" and context is not None:
        print(context.get_help())
    else:
        told = " ".join(str(getattr(error, "format_message", error.__str__)()).split())
        path = context.command_path if context is not None else "missing-physics"
        print(f"missing-physics: {told.rstrip('.')}; see {path} --help.", file=sys.stderr)
    return UNUSABLE_INPUT

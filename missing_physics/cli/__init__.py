"""The command line: one file per command, gathered here."""

from __future__ import annotations

import sys
from importlib import metadata
from typing import Annotated

import typer

from missing_physics.cli.interrupts import (
    CLOSED_PIPE,
    Interrupted,
    Signals,
    closed_pipe,
    interrupting,
    nothing_more_written,
)
from missing_physics.cli.listing import Commands
from robot_model import InputError, OutOfMemoryError, lacks_memory, lacks_room

__all__ = ["app", "main"]

UNUSABLE_INPUT = 2
#: Exit code if disk or memory is full or failing, or too many files are open; the input may be valid.
TRY_AGAIN = 75
#: Raised for a command line that cannot be parsed.
UsageError: type[Exception] = typer.BadParameter.__bases__[0]

HELP = "Find the physics that a robot's simulation leaves out: locate, name, model, prove."

app = typer.Typer(
    name="missing-physics",
    cls=Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _version(asked: bool) -> None:
    """Print the version and exit, if requested."""
    if asked:
        print(f"missing-physics {metadata.version('missing-physics')}")
        raise typer.Exit


@app.callback(help=HELP)
def _program(
    version: Annotated[
        bool, typer.Option("--version", help="print the version", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Options before every command."""


def main() -> None:
    """Run the command line; unusable input gives one sentence on stderr and exit code 2.

    If the machine fails, as with a full disk or too little memory, the exit code is 75: another attempt may
    succeed. A signal gives 128 plus its number, and so does a closed pipe, silently, as after SIGPIPE.
    """
    with interrupting() as signals:
        try:
            code = _carried_out(signals)
        except (BrokenPipeError, SystemExit) as error:
            if not closed_pipe(error):
                raise
            nothing_more_written()
            code = CLOSED_PIPE
    sys.exit(code)


def _carried_out(signals: Signals) -> int:
    """Run the requested command; returns its exit code, after printing a sentence on what stopped it."""
    try:
        code = app(prog_name="missing-physics", standalone_mode=False)
        if sys.stdout is not None:  # closed by whoever started the program
            sys.stdout.flush()
    except UsageError as error:
        return _usage_error(error)
    except typer.Abort:
        return 1
    except (Interrupted, KeyboardInterrupt) as error:
        signals.arrived()
        print(f"missing-physics: {signals.words}. {error}".rstrip(), file=sys.stderr)
        return signals.exit_code
    except InputError as error:
        print(f"missing-physics: {error}", file=sys.stderr)
        return TRY_AGAIN if lacks_room(error) else UNUSABLE_INPUT
    except OSError as error:
        if closed_pipe(error):
            raise
        where = f" ({error.filename})" if error.filename else ""
        print(f"missing-physics: the system refused: {error.strerror or error}{where}.", file=sys.stderr)
        return TRY_AGAIN if lacks_room(error) else UNUSABLE_INPUT
    except Exception as error:
        if not lacks_memory(error):
            raise
        own = isinstance(error, OutOfMemoryError)
        text = str(error) if own else "this takes more memory than is free; close other programs, or cut it."
        print(f"missing-physics: {text}", file=sys.stderr)
        return TRY_AGAIN
    return code if isinstance(code, int) else 0


def _usage_error(error: Exception) -> int:
    """Print a sentence on what is wrong with the command line, or the help if it is empty."""
    context = getattr(error, "ctx", None)
    if type(error).__name__ == "NoArgsIsHelpError" and context is not None:
        print(context.get_help())
    else:
        message = " ".join(str(getattr(error, "format_message", error.__str__)()).split())
        path = context.command_path if context is not None else "missing-physics"
        print(f"missing-physics: {message.rstrip('.')}; see {path} --help.", file=sys.stderr)
    return UNUSABLE_INPUT

"""The commands, each loaded on demand: the general help and completion do not load them."""

from __future__ import annotations

from importlib import import_module
from types import MappingProxyType
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_group

from missing_physics.cli.interrupts import Interrupted

__all__ = ["SUMMARIES", "Commands"]

#: Command, which is also the name of its module, and the first sentence of its help.
SUMMARIES = MappingProxyType(
    {
        "challenge": "Conceal physics in simulated robots, seal the truth, diagnose blindly, open, score.",
        "crosscheck": "Run the robot's reference motion in both engines and compare every channel.",
        "datasets": "Public real recordings: list them, or fetch one by commit and checksum.",
        "demo": (
            "Hide something in a simulated space robot, seal what it is, diagnose the recordings, "
            "open the seal."
        ),
        "diagnose": "Locate, name, model and prove the physics that ROBOT leaves out of RECORDING...",
        "effects": "The catalogue of effects that can be named, or everything about the effect ID.",
        "export": ("Write the robot with what was found in DIR as a model that other simulators read."),
        "init": "Draft the map of LOG, and an overlay for ROBOT.",
        "inspect": (
            "What is in RECORDING: channels, rate, noise; what is wrong with it; what it can and cannot show."
        ),
        "simulate": "Run the robot's reference motion; writes a recording.",
        "view": "Open the comparison in DIR in the rerun viewer (bound to 127.0.0.1).",
    }
)


class Commands(TyperGroup):
    """Loads a command on demand; distinguishes an interrupt from a command that returned its exit code."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._listing = False
        for name, summary in SUMMARIES.items():
            self.commands.setdefault(name, TyperCommand(name, help=summary))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of that name; while all are listed, a placeholder with its description."""
        return (
            super().get_command(ctx, cmd_name)
            if self._listing or cmd_name not in SUMMARIES
            else loaded(cmd_name)
        )

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The help of the whole program."""
        self._listing = True
        try:
            super().format_help(ctx, formatter)
        finally:
            self._listing = False

    def invoke(self, ctx: Any) -> Any:
        """Run the requested command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            raise Interrupted(*error.args) from None


def loaded(name: str) -> Any:
    """The command in the module of that name."""
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    alone.callback()(_nothing)  # a group, even with a single command
    import_module(f"missing_physics.cli.commands.{name}").register(alone)
    return get_group(alone).commands[name]


def _nothing() -> None:
    """Callback without effect before a command."""

"""The printed output of an inspection."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table

from missing_physics.reporting.terminal.console import PlainConsole, styled

__all__ = ["print_inspection"]

#: Largest width of a table [characters].
WIDEST = 1000
_STYLES = {"error": "bold red", "warning": "yellow", "note": "dim"}


def print_inspection(content: dict[str, Any], console: PlainConsole) -> None:
    """Print an inspection: channels, motion, findings, outlook.

    Args:
        content: of `missing_physics.inspect`.
        console: the output.
    """
    console.print(content["source"], style="bold", soft_wrap=True)
    console.print(
        f"{content['samples']} samples over {content['duration_s']:.6g} s, {content['sample_rate_hz']:.6g} Hz"
    )
    if content["constants"]:
        constants = [f"{name} = {value:.6g}" for name, value in content["constants"].items()]
        console.print("constants of the file: " + ", ".join(constants), soft_wrap=True)
    console.print()
    _print_whole(_channels(content["channels"]), console)
    if content["motion"]:
        console.print()
        _print_whole(_motion(content["motion"]), console)
    console.print()
    if not content["findings"]:
        console.print("No problems found.")
    for finding in content["findings"]:
        severity = f"{finding['severity']:8}", _STYLES[finding["severity"]]
        console.print(styled(severity, f" {finding['sentence']}"), soft_wrap=True)
    if content["map"]:
        console.print("\nMap that corrects it", style="bold")
        console.print(content["map"], soft_wrap=True)
    for title, key, sign in (("It can tell", "can_tell", "+"), ("It cannot tell", "cannot_tell", "-")):
        console.print(f"\n{title}", style="bold")
        for sentence in content[key]:
            console.print(f" {sign} {sentence}", soft_wrap=True)


def _print_whole(table: Table, console: PlainConsole) -> None:
    """Print a table with all names and numbers; its lines break on a narrower terminal."""
    table.width = console.measure(table, options=console.options.update(width=WIDEST)).maximum
    console.print(table, soft_wrap=True)


def _channels(channels: list[dict[str, Any]]) -> Table:
    table = Table(box=None)
    for title in ("channel", "unit"):
        table.add_column(title, no_wrap=True)
    for title in ("smallest", "largest", "noise", "step", "missing"):
        table.add_column(title, justify="right")
    for row in channels:
        numbers = [row[key] for key in ("smallest", "largest", "noise", "resolution")]
        cells = ["-" if x is None or math.isnan(x) else f"{x:.4g}" for x in numbers]
        table.add_row(row["name"], row["unit"], *cells, str(row["missing"] or "-"))
    return table


def _motion(moves: list[dict[str, Any]]) -> Table:
    table = Table(box=None)
    table.add_column("motion of")
    for title in ("range", "top speed", "rms acc.", "reversals", "at rest", "+/-", "speeds", "band"):
        table.add_column(title, justify="right")
    for move in moves:
        table.add_row(
            move["place"],
            f"{move['position_range']:.4g}",
            f"{move['max_speed']:.4g}",
            f"{move['rms_acceleration']:.4g}",
            str(move["reversals"]),
            f"{100 * move['at_rest']:.0f} %",
            f"{100 * move['forward']:.0f}/{100 * move['backward']:.0f} %",
            f"{move['speed_levels']}/10",
            f"{move['bandwidth_hz']:.3g} Hz",
        )
    return table

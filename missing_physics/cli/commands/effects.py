"""`missing-physics effects`: the catalogue of effects, or one effect's page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from missing_physics.reporting.terminal.console import PlainConsole, styled
from reference_model.effects.base import Effect
from reference_model.effects.catalogue import catalogue, get_effect
from reference_model.effects.page import PLACES, facts, picture_of, range_of
from robot_model import InputError, replacing_set

__all__ = ["description", "print_page", "register"]

#: Endings of a page's name.
PAGES = (".html", ".htm")
#: Most columns of a plot, and fewest columns in which one is drawn.
WIDEST, NARROWEST = 80, 40


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(effects)


def effects(
    effect_id: Annotated[
        str | None, typer.Argument(metavar="[ID]", help="the effect to show; all by default")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html|DIR",
            help="write self-contained HTML pages instead of printing: one effect's to FILE.html, or those "
            "of all effects shown into a folder",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print as JSON to stdout")] = False,
) -> None:
    """The catalogue of effects that can be named, or everything about the effect ID.

    One effect's page ends with a plot of how the effect shows in a simulation.
    """
    chosen = [get_effect(effect_id)] if effect_id is not None else list(catalogue().values())
    written = [] if out is None else _write(chosen, out, alone=effect_id is not None)
    if as_json:
        content = [description(effect) for effect in chosen]
        print(json.dumps(content[0] if effect_id is not None else content, indent=1))
        return
    if out is not None:
        print("\n".join(map(str, written)))
        return
    console = PlainConsole()
    if effect_id is not None:
        print_page(console, chosen[0])
    else:
        console.print(_table(chosen))
        console.print("`missing-physics effects ID` shows one of them in full.", style="dim")


def _write(chosen: Sequence[Effect], out: Path, *, alone: bool) -> list[Path]:
    """Pages of the chosen effects, in a folder unless `out` is a page's name."""
    from missing_physics.reporting.pages.effect_page import (
        write_effect,  # the report's libraries take a second
    )

    if out.suffix.lower() not in PAGES or out.is_dir():
        with replacing_set(out) as fresh:
            for effect in chosen:
                write_effect(effect, fresh / f"{effect.id}.html")
        return [out / f"{effect.id}.html" for effect in chosen]
    if not alone:
        raise InputError(f"--out {out} is one page; name its effect, or a folder for the pages of all.")
    write_effect(chosen[0], out)
    return [out]


def description(effect: Effect) -> dict[str, Any]:
    """The catalogue's entry of an effect, ready for JSON; `plot` is the path of an SVG file."""
    picture = picture_of(effect)
    return {
        "id": effect.id,
        "title": effect.title,
        "place": effect.place,
        "equation": effect.equation,
        "parameters": [asdict(parameter) for parameter in effect.parameters],
        "signature": effect.signature,
        "confused_with": list(effect.confused_with),
        "experiment": effect.experiment,
        "family": effect.family,
        "rung": effect.rung,
        "builds_on": list(effect.builds_on),
        "needs": list(effect.needs),
        "searched": effect.is_searched or effect.turns_base,
        "source": effect.source,
        "plot": str(picture) if picture is not None else None,
    }


def _table(chosen: list[Effect]) -> Table:
    table = Table("place", "id", "what it is", "parameters", title="Effects", title_justify="left")
    table.columns[1].no_wrap = True
    for place in PLACES:
        for effect in chosen:
            if effect.place == place:
                names = ", ".join(p.name for p in effect.estimated)
                table.add_row(place, effect.id, effect.title, names)
    return table


def print_page(console: PlainConsole, effect: Effect) -> None:
    """One effect in full, with its plot where the terminal can show it."""
    console.print(styled((effect.id, "bold"), f"  {effect.title} ({effect.place})"))
    console.print(f"  {PLACES[effect.place].replace('`', '')}")
    console.print(f"\n  {effect.equation}\n")
    console.print(_parameters(effect))
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="bold", no_wrap=True)
    for label, text in facts(effect).items():
        grid.add_row(label, text)
    console.print(grid)
    _print_plot(console, effect)


def _print_plot(console: PlainConsole, effect: Effect) -> None:
    picture, columns = picture_of(effect), min(console.width, WIDEST)
    if picture is None or columns < NARROWEST:
        return
    from missing_physics.reporting.terminal.plot import drawn, read

    text = Text.from_ansi(drawn(read(picture.read_text("utf-8")), columns=columns))
    if _shows(console, text.plain):
        console.print("\nIn a simulation:", style="bold")
        console.print(text, no_wrap=True, highlight=False)


def _shows(console: PlainConsole, text: str) -> bool:
    """Whether the terminal's encoding has all characters of a text."""
    try:
        text.encode(console.encoding)
    except UnicodeEncodeError:
        return False
    return True


def _parameters(effect: Effect) -> Table:
    table = Table("parameter", "unit", "meaning", "range", "no influence at", "default")
    table.columns[0].no_wrap = True
    for column in table.columns:
        column.overflow = "fold"
    for p in effect.parameters:
        absent = "" if p.absent is None else f"{p.absent:g}"
        default = "" if p.default is None else f"{p.default:g}"
        note = "" if p.estimated else " (not estimated)"
        table.add_row(p.name, p.unit, p.meaning + note, range_of(p), absent, default)
    return table

"""`missing-physics effects`: the catalogue of effects, or one effect's page."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from reference_model.effects.base import Effect
from reference_model.effects.catalogue import catalogue, get_effect
from reference_model.effects.page import PLACES, range_of

__all__ = ["description", "register"]


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(effects)


def effects(
    effect_id: Annotated[
        str | None, typer.Argument(metavar="[ID]", help="the effect to show; all when left out")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print as JSON to stdout")] = False,
) -> None:
    """The catalogue of effects that can be named, or everything about the effect ID."""
    chosen = [get_effect(effect_id)] if effect_id is not None else list(catalogue().values())
    if as_json:
        content = [description(effect) for effect in chosen]
        print(json.dumps(content[0] if effect_id is not None else content, indent=1))
        return
    console = Console()
    if effect_id is not None:
        _print_page(console, chosen[0])
    else:
        console.print(_table(chosen))
        console.print("`missing-physics effects ID` shows one of them in full.", markup=False, style="dim")


def description(effect: Effect) -> dict[str, Any]:
    """Everything the catalogue says of an effect, ready for JSON."""
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
        "source": effect.source,
    }


def _table(chosen: list[Effect]) -> Table:
    table = Table("place", "id", "what it is", "parameters", title="Effects", title_justify="left")
    table.columns[1].no_wrap = True
    for place in PLACES:
        for effect in chosen:
            if effect.place == place:
                names = ", ".join(p.name for p in effect.estimated)
                table.add_row(place, effect.id, escape(effect.title), escape(names))
    return table


def _print_page(console: Console, effect: Effect) -> None:
    console.print(f"[bold]{effect.id}[/]  {escape(effect.title)} ({effect.place})")
    console.print(f"\n  {escape(effect.equation)}\n", highlight=False)
    console.print(_parameters(effect))
    rows = {
        "shows as": effect.signature,
        "can be taken for": ", ".join(effect.confused_with) or "nothing known",
        "to tell apart": effect.experiment,
        "needs": ", ".join(effect.needs),
        "comes on top of": " or ".join(effect.builds_on),
        "source": effect.source,
    }
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="bold", no_wrap=True)
    for label, text in rows.items():
        if text:
            grid.add_row(label, escape(text))
    console.print(grid)


def _parameters(effect: Effect) -> Table:
    table = Table("parameter", "unit", "meaning", "range", "no influence at", "default")
    table.columns[0].no_wrap = True
    for p in effect.parameters:
        absent = "" if p.absent is None else f"{p.absent:g}"
        default = "" if p.default is None else f"{p.default:g}"
        note = "" if p.estimated else " (not estimated)"
        table.add_row(p.name, p.unit, escape(p.meaning + note), range_of(p), absent, default)
    return table

"""The ladder of explanations: everything that was tried, and its effect on the held-out error."""

from __future__ import annotations

import math
from collections.abc import Sequence

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.figures import Figure, axis, label, layout
from missing_physics.reporting.elements.formatting import effect_title, number
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Result, Rung
from robot_model import Robot

__all__ = ["section"]

#: Rungs in the picture; the table lists all.
MOST_BARS = 25
#: Prefix of the ids of unnamed forces.
UNNAMED = "unknown_of_"


def section(result: Result, robot: Robot) -> Section | None:
    """Table and bars; None when nothing was tried."""
    if not result.ladder:
        return None
    rungs = _distinct(result.ladder)
    return Section(
        anchor="ladder",
        heading="Ladder of explanations",
        values={"rows": [_row(rung) for rung in rungs]},
        figures=[_bars(rungs)],
    )


def _distinct(ladder: Sequence[Rung]) -> list[Rung]:
    """Every explanation once: a search with several starts tries some of them again with equal results."""
    found: dict[tuple[object, ...], Rung] = {}
    for rung in ladder:
        found.setdefault((rung.effect, rung.location, rung.added_to, number(rung.evidence)), rung)
    return list(found.values())


def _row(rung: Rung) -> dict[str, object]:
    return {
        "title": _title(rung.effect),
        "location": rung.location,
        "added_to": [_label(term) for term in rung.added_to],
        "train": number(rung.train_rms),
        "held": number(rung.validation_rms),
        "evidence": number(rung.evidence),
        "kept": rung.kept,
        "why": rung.why,
    }


def _label(term: str) -> str:
    """`effect@place` in words."""
    effect, _, place = term.partition("@")
    return f"{_title(effect)} at {place}" if place else _title(effect)


def _title(effect: str) -> str:
    """An effect's title; for an unnamed force the variable of its curve."""
    if effect.startswith(UNNAMED):
        words, of, joint = effect.removeprefix(UNNAMED).partition("velocity_of_")
        return f"Force without a name, over {(words + of).replace('_', ' ')}{joint}"
    return effect_title(effect)


def _bars(rungs: Sequence[Rung]) -> Figure:
    usable = [rung for rung in rungs if math.isfinite(rung.evidence)]
    kept = [rung for rung in usable if rung.kept]
    others = sorted((r for r in usable if not r.kept), key=lambda r: -r.evidence)
    shown = [r for r in usable if r.kept or r in others[: max(MOST_BARS - len(kept), 0)]][:MOST_BARS]
    words = [
        label(f"{count} · {_title(rung.effect)} at {rung.location}")
        for count, rung in enumerate(rungs, 1)
        if any(rung is one for one in shown)
    ]
    bars = {
        "type": "bar",
        "orientation": "h",
        "y": words,
        "x": [rung.evidence for rung in shown],
        "text": [f"{number(rung.evidence)} {'kept' if rung.kept else 'rejected'}" for rung in shown],
        "textposition": "outside",
        "cliponaxis": False,
        "marker": {
            "color": [palette.AFTER if rung.kept else "#BDBDBD" for rung in shown],
            "pattern": {"shape": ["" if rung.kept else "/" for rung in shown], "fgcolor": "#8C8C8C"},
        },
        "hovertemplate": "%{y}: %{x:.4g}<extra></extra>",
    }
    return Figure(
        name="ladder-bars",
        data=[bars],
        layout=layout(
            xaxis=axis("log score gained over leaving it out, prior included [nats]", rangemode="tozero"),
            yaxis=axis("", autorange="reversed", ticks=""),
            margin={"l": 20, "r": 110, "t": 40, "b": 50},
            bargap=0.35,
        ),
        caption=(
            "Numbered as in the table. Blue: part of the answer; hatched: rejected in the end, for what "
            "explains more or is more credible. Each is compared with what it was added to."
        ),
        height=120 + 30 * len(shown),
    )

"""The ladder of explanations: everything that was tried, and its effect on the held-out error."""

from __future__ import annotations

import math

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.figures import Figure, axis, label, layout
from missing_physics.reporting.elements.formatting import effect_title, number
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Result, Rung
from robot_model import Robot

__all__ = ["section"]

#: Rungs in the picture; the table lists all.
MOST_BARS = 25


def section(result: Result, robot: Robot) -> Section | None:
    """Table and bars; None when nothing was tried."""
    if not result.ladder:
        return None
    return Section(
        anchor="ladder",
        heading="Ladder of explanations",
        values={"rows": [_row(rung) for rung in result.ladder]},
        figures=[_bars(result)],
    )


def _row(rung: Rung) -> dict[str, object]:
    return {
        "title": effect_title(rung.effect),
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
    return f"{effect_title(effect)} at {place}" if place else effect_title(effect)


def _bars(result: Result) -> Figure:
    usable = [rung for rung in result.ladder if math.isfinite(rung.validation_rms)]
    kept = [rung for rung in usable if rung.kept]
    others = sorted((r for r in usable if not r.kept), key=lambda r: r.validation_rms)
    shown = [r for r in usable if r.kept or r in others[: max(MOST_BARS - len(kept), 0)]][:MOST_BARS]
    words = [
        label(f"{count} · {effect_title(rung.effect)} at {rung.location}")
        for count, rung in _numbered(result, shown)
    ]
    bars = {
        "type": "bar",
        "orientation": "h",
        "y": words,
        "x": [rung.validation_rms for rung in shown],
        "text": [f"{number(rung.validation_rms)} {'kept' if rung.kept else 'rejected'}" for rung in shown],
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
            xaxis=axis("held-out rms after adding it (whitened)", rangemode="tozero"),
            yaxis=axis("", autorange="reversed", ticks=""),
            margin={"l": 20, "r": 110, "t": 40, "b": 50},
            bargap=0.35,
        ),
        caption="Numbered as in the table. Blue: kept; hatched: rejected. Shorter is better.",
        height=120 + 30 * len(shown),
    )


def _numbered(result: Result, shown: list[Rung]) -> list[tuple[int, Rung]]:
    return [(next(i for i, r in enumerate(result.ladder, 1) if r is rung), rung) for rung in shown]

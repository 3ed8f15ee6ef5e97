"""The history of the benchmarks as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import jinja2

from benchmarks.history.rows import ALLOWED, ENOUGH, WINDOW, Row, changes

__all__ = ["page", "peers"]

#: Size of a small picture of a ratio's history [px].
WIDTH, HEIGHT, EDGE = 150, 30, 4
#: Packages for comparison, and number of recent rows listed.
PEERS, LISTED = {"exudyn": "exudyn", "mujoco": "mujoco", "pinocchio": "pin"}, 40


def peers() -> dict[str, str]:
    """Versions of the peers that are installed, by the name in ratios."""
    found = {}
    for name, package in PEERS.items():
        try:
            found[name] = version(package)
        except PackageNotFoundError:
            continue
    return found


def page(rows: Sequence[Row]) -> str:
    """The complete, self-contained file."""
    folder = Path(__file__).parent / "templates"
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder), autoescape=True, trim_blocks=True
    )
    environment.globals.update(course=lambda name: _course(rows, name))
    judged = sorted(changes(rows), key=lambda change: (not change.regressed, change.name))
    return environment.get_template("history.html").render(
        changes=judged,
        slower=sum(change.regressed for change in judged),
        last=rows[-1] if rows else None,
        rows=list(reversed(rows[-LISTED:])),
        count=len(rows),
        allowed=ALLOWED,
        window=WINDOW,
        enough=ENOUGH,
        size=(WIDTH, HEIGHT),
    )


def _course(rows: Sequence[Row], name: str) -> str:
    """Points of a ratio over the rows, scaled between lowest and highest, for an SVG polyline."""
    values = [row.ratios[name] for row in rows if name in row.ratios]
    low, high = min(values), max(values)
    span, steps = high - low or 1.0, max(1, len(values) - 1)
    inner = WIDTH - 2 * EDGE, HEIGHT - 2 * EDGE
    places = [
        (EDGE + inner[0] * k / steps, HEIGHT - EDGE - inner[1] * (value - low) / span)
        for k, value in enumerate(values)
    ]
    if len(places) == 1:
        places = [(EDGE, HEIGHT / 2), (WIDTH - EDGE, HEIGHT / 2)]
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)

"""The README's picture: residual force of the model of a real axis, before and after."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.evidence import percent
from missing_physics.diagnosis import Result
from missing_physics.reporting.elements.palette import AFTER, BEFORE, INK

__all__ = ["Scale", "picture"]

Array = NDArray[np.float64]

#: Points drawn in each panel, and the seed of their choice.
POINTS, SEED = 2500, 0
#: Sizes [px].
WIDTH, HEIGHT = 860, 356
PANEL_WIDTH, PANEL_HEIGHT = 360, 236
LEFT, TOP, GAP = 64, 58, 40
#: Fraction of the range left free at each side of an axis, and the desired number of marks.
MARGIN, MARKS = 0.06, 5


@dataclass(frozen=True)
class Panel:
    """One scatter plot: title, colour, position, and points."""

    title: str
    colour: str
    left: float
    x: Array
    y: Array


@dataclass(frozen=True)
class Scale:
    """From a value to a pixel: `low` at `first`, `high` at `last`."""

    low: float
    high: float

    def at(self, value: Array | float, first: float, last: float) -> Array:
        return np.asarray(first + (np.asarray(value) - self.low) / (self.high - self.low) * (last - first))

    def marks(self) -> list[float]:
        """Round values within the range."""
        raw = (self.high - self.low) / MARKS
        power = 10.0 ** np.floor(np.log10(raw))
        step = float(power * min((1, 2, 5, 10), key=lambda factor: abs(factor * power - raw)))
        first = int(np.ceil(self.low / step))
        return [step * i for i in range(first, int(np.floor(self.high / step)) + 1)]


def picture(result: Result) -> str:
    """The SVG: unexplained force against velocity on the held-out recording, before and after."""
    series = next(s for s in result.series if s.role == "validation")
    assert series.velocity is not None
    chosen = np.sort(np.random.default_rng(SEED).permutation(series.time.size)[:POINTS])
    before, after = series.measured - series.nominal, series.measured - series.augmented
    count = len(result.diagnosis.findings)
    titles = (
        f"Before: only the mass is known, error {_part(before, series.measured)} of the force",
        f"After: {count} effects named and fitted, {_part(after, series.measured)}",
    )
    lefts = (LEFT, LEFT + PANEL_WIDTH + GAP)
    panels = [
        Panel(title, colour, left, series.velocity[chosen], left_over[chosen])
        for title, colour, left, left_over in zip(titles, (BEFORE, AFTER), lefts, (before, after))
    ]
    x, y = _scale(series.velocity), _scale(before)
    body = "\n".join([*_frame(), *(line for panel in panels for line in _panel(panel, x, y))])
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" '
        f'viewBox="0 0 {WIDTH} {HEIGHT}" font-family="Helvetica, Arial, sans-serif" font-size="13" '
        f'fill="{INK}">\n{body}\n</svg>\n'
    )


def _part(left: Array, measured: Array) -> str:
    """rms of an error relative to that of the measured force."""
    return percent(float(np.sqrt(np.nanmean(left**2) / np.nanmean(measured**2))), 1)


def _scale(values: Array) -> Scale:
    free = MARGIN * float(np.ptp(values))
    return Scale(float(values.min()) - free, float(values.max()) + free)


def _frame() -> Iterator[str]:
    yield f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>'
    title = (
        "EMPS, a real axis with a ball screw: force that the model leaves unexplained, on data never fitted"
    )
    yield f'<text x="{WIDTH / 2}" y="24" text-anchor="middle" font-size="15">{title}</text>'
    middle = TOP + PANEL_HEIGHT / 2
    turned = f'transform="translate(18 {middle}) rotate(-90)" text-anchor="middle"'
    yield f"<text {turned}>measured minus model, N</text>"


def _panel(panel: Panel, x: Scale, y: Scale) -> Iterator[str]:
    left, right, bottom = panel.left, panel.left + PANEL_WIDTH, TOP + PANEL_HEIGHT
    for value in y.marks():
        height = float(y.at(value, bottom, TOP))
        colour = "#999" if value == 0 else "#e4e4e4"
        yield f'<path d="M{left} {height:.1f}H{right}" stroke="{colour}"/>'
        if left == LEFT:
            yield f'<text x="{left - 8}" y="{height + 4:.1f}" text-anchor="end">{value:g}</text>'
    for value in x.marks():
        place = float(x.at(value, left, right))
        yield f'<path d="M{place:.1f} {bottom}v5" stroke="#999"/>'
        yield f'<text x="{place:.1f}" y="{bottom + 19}" text-anchor="middle">{value:.2g}</text>'
    columns, rows = x.at(panel.x, left, right), y.at(panel.y, bottom, TOP)
    points = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(columns, rows))
    yield f'<path d="{points}" stroke="{panel.colour}" stroke-width="2.4" stroke-linecap="round"/>'
    centre = (left + right) / 2
    yield f'<text x="{centre}" y="{TOP - 12}" text-anchor="middle" fill="{panel.colour}">{panel.title}</text>'
    yield f'<text x="{centre}" y="{bottom + 40}" text-anchor="middle">velocity, m/s</text>'

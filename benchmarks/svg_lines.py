"""Figures of lines as SVG text, for pages of evidence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from benchmarks.machines.emps_picture import Scale
from missing_physics.reporting.elements.decimate import envelope_indices
from missing_physics.reporting.elements.palette import INK

__all__ = ["Line", "Panel", "figure"]

Array = NDArray[np.float64]

#: Sizes [px]: a panel's area, and its margins.
PANEL_WIDTH, PANEL_HEIGHT = 372, 208
LEFT, RIGHT, ABOVE, BELOW = 74, 18, 36, 48
#: Sizes [px]: head of the figure with its title and one row of its legend, and each further row.
HEAD, LEGEND_ROW = 58, 20
LEGEND_MARK, LEGEND_GAP, LETTER = 26, 22, 7.0
#: Maximum number of points drawn of a line, by each of its coordinates; extremes are kept.
POINTS = 900
#: Fraction of the range left free at each end of an axis, and the range of a constant line.
MARGIN, FLAT = 0.05, 1e-12
#: Decades shown below the largest value of a logarithmic axis.
DECADES = 6


@dataclass(frozen=True)
class Line:
    """One curve, in the order of its points; the same label has the same colour in all panels."""

    label: str
    colour: str
    x: Array
    y: Array
    dashed: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes; `log` draws the decades of y."""

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    log: bool = False


def figure(title: str, panels: Sequence[Panel], *, columns: int = 2) -> str:
    """The SVG: a title, one legend, and the panels row by row."""
    rows = -(-len(panels) // columns)
    width = columns * (LEFT + PANEL_WIDTH + RIGHT)
    legend = _legend_rows(panels, width - 2 * RIGHT)
    head = HEAD + LEGEND_ROW * (len(legend) - 1)
    height = head + rows * (ABOVE + PANEL_HEIGHT + BELOW)
    body = [
        f'<rect width="{width}" height="{height}" fill="white"/>',
        f'<text x="{width / 2:g}" y="22" text-anchor="middle" font-size="15">{escape(title)}</text>',
        *_legend(legend, width),
    ]
    for k, panel in enumerate(panels):
        left = LEFT + (k % columns) * (LEFT + PANEL_WIDTH + RIGHT)
        top = head + ABOVE + (k // columns) * (ABOVE + PANEL_HEIGHT + BELOW)
        body += _panel(panel, left, top)
    lines = "\n".join(body)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" font-family="Helvetica, Arial, sans-serif" font-size="12" '
        f'fill="{INK}">\n{lines}\n</svg>\n'
    )


def _legend_rows(panels: Sequence[Panel], width: float) -> list[list[Line]]:
    """One line for each distinct label, in as many rows as the width requires."""
    rows: list[list[Line]] = [[]]
    for line in {line.label: line for panel in panels for line in panel.lines}.values():
        if rows[-1] and _row_width([*rows[-1], line]) > width:
            rows.append([])
        rows[-1].append(line)
    return rows


def _row_width(row: Sequence[Line]) -> float:
    return sum(_mark_width(line) for line in row) + LEGEND_GAP * (len(row) - 1)


def _mark_width(line: Line) -> float:
    return LEGEND_MARK + 6 + LETTER * len(line.label)


def _legend(rows: Sequence[Sequence[Line]], width: float) -> Iterator[str]:
    """Marks and names, each row centred."""
    for k, row in enumerate(rows):
        x, y = (width - _row_width(row)) / 2, 43 + k * LEGEND_ROW
        for line in row:
            yield f'<path d="M{x:.1f} {y}h{LEGEND_MARK}" {_stroke(line)}/>'
            yield f'<text x="{x + LEGEND_MARK + 6:.1f}" y="{y + 4}">{escape(line.label)}</text>'
            x += _mark_width(line) + LEGEND_GAP


def _panel(panel: Panel, left: float, top: float) -> Iterator[str]:
    right, bottom = left + PANEL_WIDTH, top + PANEL_HEIGHT
    x = _scale(np.concatenate([line.x for line in panel.lines]), free=0.0)
    y = _scale(_heights(panel, np.concatenate([line.y for line in panel.lines])), free=MARGIN)
    for value in y.marks():
        height = float(y.at(value, bottom, top))
        name = f"1e{value:g}" if panel.log else f"{value:.6g}"
        colour = "#999" if value == 0 and not panel.log else "#e4e4e4"
        yield f'<path d="M{left} {height:.1f}H{right}" stroke="{colour}"/>'
        if not panel.log or float(value).is_integer():
            yield f'<text x="{left - 7}" y="{height + 4:.1f}" text-anchor="end">{name}</text>'
    for value in x.marks():
        place = float(x.at(value, left, right))
        yield f'<path d="M{place:.1f} {bottom}v5" stroke="#999"/>'
        yield f'<text x="{place:.1f}" y="{bottom + 18}" text-anchor="middle">{value:.6g}</text>'
    yield f'<path d="M{left} {bottom}H{right}" stroke="#999"/>'
    for line in panel.lines:
        yield _curve(line, _heights(panel, line.y), x, y, (left, right, top, bottom))
    middle = (left + right) / 2
    centred = f'x="{middle:g}" text-anchor="middle"'
    yield f'<text {centred} y="{top - 12}" font-size="13">{escape(panel.title)}</text>'
    yield f'<text {centred} y="{bottom + 36}">{escape(panel.x_label)}</text>'
    turned = f'transform="translate({left - 58} {(top + bottom) / 2:g}) rotate(-90)" text-anchor="middle"'
    yield f"<text {turned}>{escape(panel.y_label)}</text>"


def _curve(line: Line, heights: Array, x: Scale, y: Scale, box: tuple[float, float, float, float]) -> str:
    left, right, top, bottom = box
    kept = np.union1d(envelope_indices(line.x, POINTS), envelope_indices(heights, POINTS))
    columns, rows = x.at(line.x[kept], left, right), y.at(heights[kept], bottom, top)
    points = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(columns, rows))
    return f'<path d="M{points}" {_stroke(line)}/>'


def _stroke(line: Line) -> str:
    dashes = ' stroke-dasharray="6 4"' if line.dashed else ""
    return f'fill="none" stroke="{line.colour}" stroke-width="1.4" stroke-linejoin="round"{dashes}'


def _heights(panel: Panel, values: Array) -> Array:
    """Values as drawn: of a logarithmic axis the exponents, cut off `DECADES` below the panel's largest."""
    if not panel.log:
        return values
    largest = max(float(np.max(line.y)) for line in panel.lines)
    return np.asarray(np.log10(np.maximum(values, largest * 10.0**-DECADES)))


def _scale(values: Array, *, free: float) -> Scale:
    low, high = float(values.min()), float(values.max())
    room = free * (high - low) if high - low > FLAT else max(abs(high), FLAT)
    return Scale(low - room, high + room)

"""Unnamed forces: their measured curves with confidence intervals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.curves import Band, Panel, Variable, fine, panels, title_of, variables
from missing_physics.reporting.elements.figures import Figure, Spec, axis, label, layout, line, packed
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Result, Unnamed
from robot_model import Robot

__all__ = ["section"]

Array = NDArray[np.float64]

COLOURS = {"forward": palette.FORWARDS, "backward": palette.BACKWARDS}
#: Height of a row of panels, of the room between rows, and of all around them [px].
ROW, GAP, AROUND = 210, 78, 130
#: Colour scales from braking over zero to driving forces, and of widths.
SIGNED = [[0.0, palette.AFTER], [0.5, "#FFFFFF"], [1.0, palette.BEFORE]]
WIDTHS = [[0.0, "#FFFFFF"], [1.0, "#555555"]]
#: Share of the knots whose values a colour scale holds.
SHOWN = 0.9
#: Words of the captions.
TORQUE = "what the actuator delivers beyond what the model needs"
INTERVAL = "95 % confidence interval from one stretch of the data to another"
COLOURS_END = "One knot in ten lies beyond the ends of the colours."
BETWEEN = (
    "Between its knots it is interpolated linearly, which no interval counts. "
    "Nothing is drawn where the data say nothing."
)


def section(result: Result, robot: Robot) -> Section | None:
    """Sentence and figure of each unnamed force; None where there are none."""
    items = result.diagnosis.unnamed
    if not items:
        return None
    drawn = [_figure(item, robot, order) for order, item in enumerate(items)]
    return Section(
        anchor="unnamed",
        heading="Forces without a name",
        values={"items": [{"words": item.words, "figure": figure} for item, figure in zip(items, drawn)]},
        figures=[figure for figure in drawn if figure],
    )


def _figure(item: Unnamed, robot: Robot, order: int) -> Figure | None:
    rows = panels(item, robot)
    if not rows:
        return None
    over = variables(item, robot)
    alone = len(over) == 1
    data, axes, caption = _curves(over[0], rows) if alone else _surfaces(over, rows)
    count = len(rows) if alone else sum(len(row.bands) for row in rows)
    return Figure(
        name=f"unnamed-{order}",
        data=data,
        layout=layout(**axes),
        title=title_of(item),
        caption=caption,
        height=AROUND + ROW * count + GAP * (count - 1),
    )


def _curves(over: Variable, rows: tuple[Panel, ...]) -> tuple[list[Spec], Spec, str]:
    """One panel below the other over one variable."""
    data: list[Spec] = []
    axes: Spec = {"annotations": []}
    for row, panel in enumerate(rows):
        where, name, domain = _place(row, row, len(rows))
        for band in panel.bands:
            data += [spec | where for spec in _band(band, panel)]
        across = axis(_titled(over.name, over.unit), anchor=f"y{name}")
        axes[f"xaxis{name}"] = across | ({"matches": "x"} if name else {})
        axes[f"yaxis{name}"] = axis(_titled(panel.channel, panel.unit), domain=domain, anchor=f"x{name}")
        if panel.words:
            axes["annotations"].append(_heading(panel.words, 0.5, domain[1]))
    return data, axes, f"Line: {TORQUE}. Band: {INTERVAL}. {BETWEEN}"


def _band(band: Band, panel: Panel) -> list[Spec]:
    """The interval as an area around each determined stretch, and the curve with its knots."""
    colour = COLOURS.get(band.carrier, palette.AFTER)
    areas: list[Spec] = []
    for part in np.ma.clump_unmasked(np.ma.masked_invalid(band.value)):
        x = np.concatenate([band.knots[part], band.knots[part][::-1]])
        y = np.concatenate([band.high[part], band.low[part][::-1]])
        areas.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": packed(x, "f8"),
                "y": packed(y),
                "fill": "toself",
                "fillcolor": palette.rgba(colour, 0.25),
                "line": {"width": 0},
                "hoverinfo": "skip",
                "showlegend": False,
            }
        )
    name = band.words or panel.words or panel.channel
    shown = {"mode": "lines+markers", "width": 2.0, "showlegend": bool(band.words)}
    return [*areas, line(band.knots, band.value, name=name, colour=colour, **shown)]


def _surfaces(over: tuple[Variable, ...], rows: tuple[Panel, ...]) -> tuple[list[Spec], Spec, str]:
    """A row for each direction of motion: the surface to the left, its uncertainty to the right."""
    first, second = over
    bands = [(panel, band) for panel in rows for band in panel.bands]
    reach = _most(np.concatenate([np.abs(band.value).ravel() for _, band in bands]))
    widest = _most(np.concatenate([(band.high - band.low).ravel() / 2 for _, band in bands]))
    data: list[Spec] = []
    axes: Spec = {"annotations": []}
    for row, (panel, band) in enumerate(bands):
        looks = (
            (
                band.value,
                {"colorscale": SIGNED, "zmin": -reach, "zmax": reach},
                ", ".join(filter(None, (panel.channel, band.words))),
            ),
            (
                (band.high - band.low) / 2,
                {"colorscale": WIDTHS, "zmin": 0.0, "zmax": widest},
                "half its interval",
            ),
        )
        for column, (values, look, words) in enumerate(looks):
            where, name, domain = _place(2 * row + column, row, len(bands))
            left = 0.56 * column
            bar = {"title": {"text": label(f"[{panel.unit}]")}, "thickness": 12, "x": left + 0.385}
            bar |= {"xanchor": "left", "y": sum(domain) / 2, "len": domain[1] - domain[0]}
            data.append(_surface(over, values) | look | where | {"colorbar": bar})
            span = {"domain": [left, left + 0.38], "anchor": f"y{name}"}
            axes[f"xaxis{name}"] = axis(_titled(second.name, second.unit), **span)
            upright = axis(_titled(first.name, first.unit) if column == 0 else "")
            axes[f"yaxis{name}"] = upright | {"domain": domain, "anchor": f"x{name}"}
            axes["annotations"].append(_heading(words, left + 0.19, domain[1]))
    return data, axes, f"Left: {TORQUE}. Right: half the width of its {INTERVAL}. {BETWEEN} {COLOURS_END}"


def _most(values: Array) -> float:
    """End of a colour scale, chosen so that a few outlying knots do not compress the others' colours."""
    return float(np.nanquantile(values, SHOWN)) or 1.0


def _surface(over: tuple[Variable, ...], values: Array) -> Spec:
    """Interpolation between the knots, linear along each variable, drawn as a fine grid."""
    x, y, grid = fine(over, values)
    return {
        "type": "heatmap",
        "x": packed(x, "f8"),
        "y": packed(y, "f8"),
        "z": packed(grid),
        "hovertemplate": "%{x:.4g}, %{y:.4g}: %{z:.4g}<extra></extra>",
    }


def _place(number: int, row: int, rows: int) -> tuple[Spec, str, list[float]]:
    """Axes of a panel in plotly's names, their suffix, and the panel's share of the height."""
    name = str(number + 1) if number else ""
    whole = rows * ROW + (rows - 1) * GAP
    top = 1 - row * (ROW + GAP) / whole
    return {"xaxis": f"x{name}", "yaxis": f"y{name}"}, name, [max(top - ROW / whole, 0.0), top]


def _titled(words: str, unit: str) -> str:
    return f"{words} [{unit}]"


def _heading(words: str, x: float, y: float) -> Spec:
    return {
        "text": label(words),
        "x": x,
        "y": y,
        "xref": "paper",
        "yref": "paper",
        "xanchor": "center",
        "yanchor": "bottom",
        "yshift": 3,
        "showarrow": False,
        "font": {"size": 14},
    }

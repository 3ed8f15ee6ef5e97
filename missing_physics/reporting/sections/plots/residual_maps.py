"""Residual over velocity and position of its place, before and after side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.figures import Figure, Spec, axis, layout, packed, rectangle
from missing_physics.reporting.elements.selection import MOST_CHANNELS, channels, mismatch_of, residuals
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import ChannelSeries, Result
from robot_model import Robot

__all__ = ["Binned", "binned_quantiles", "section"]

Array = NDArray[np.float64]

#: Even, so that over a range symmetric about zero no bin mixes both signs of velocity.
BINS = 40
FEWEST_SAMPLES = 10
QUANTILES = (0.1, 0.5, 0.9)
DENSITY = (72, 54)
#: Share of the residuals within the vertical range; the share outside is stated.
SHOWN = 0.998
TOLD_OUTSIDE = 5e-4
#: Space between the rows of panels, as a fraction of the height.
ROW_GAP = 0.15
#: Length of the dash of one bin [px]: about the width of a bin, so that the dashes meet.
DASH = 9
#: A dependence over more of the range than this needs no mark.
MARKED_RANGE = 0.8
OPEN_FIGURES = 2


@dataclass(frozen=True)
class Binned:
    """Quantiles of a residual in bins of a variable: centres (B,), low, median, high (B,), NaN where thin."""

    centre: Array
    low: Array
    median: Array
    high: Array


@dataclass(frozen=True)
class _Data:
    """Samples of one channel over all recordings: variable, residual before and after, shape (N,)."""

    variable: Array
    before: Array
    after: Array


def section(result: Result, robot: Robot) -> Section | None:
    """One figure per channel that has a position or a velocity; None when no channel has."""
    figures: list[Figure] = []
    for channel in channels(result)[:MOST_CHANNELS]:
        figure = _figure(result, channel, len(figures))
        figures += [figure] if figure else []
    if not figures:
        return None
    return Section(anchor="residual_maps", heading="What the residual depends on", figures=figures)


def binned_quantiles(variable: Array, residual: Array, edges: Array) -> Binned:
    """Quantiles of `residual` (N,) in the bins of `variable` (N,) between `edges` (B + 1,)."""
    count = edges.size - 1
    bins = np.clip(np.searchsorted(edges, variable, side="right") - 1, 0, count - 1)
    order = np.argsort(bins, kind="stable")
    pieces = np.split(residual[order], np.searchsorted(bins[order], np.arange(1, count)))
    rows = [
        np.quantile(piece, QUANTILES) if piece.size >= FEWEST_SAMPLES else np.full(3, np.nan)
        for piece in pieces
    ]
    low, median, high = np.array(rows).T
    return Binned((edges[1:] + edges[:-1]) / 2, low, median, high)


def _figure(result: Result, channel: str, order: int) -> Figure | None:
    series = [item for item in result.series if item.channel == channel]
    rows = [(name, _gathered(series, name)) for name in ("velocity", "position")]
    present = [(name, data) for name, data in rows if data is not None]
    if not present:
        return None
    reach, outside = _reach([data for _, data in present], series[0].noise_floor)
    data: list[Spec] = []
    shapes: list[Spec] = []
    axes: Spec = {}
    for row, (name, values) in enumerate(present):
        edges = _edges(values.variable, symmetric=name == "velocity")
        unit = series[0].variable_units[0 if name == "position" else 1]
        for column, residual in enumerate((values.before, values.after)):
            number = 1 + 2 * row + column
            data += _panel(values.variable, residual, edges, reach, column=column, number=number)
            axes |= _axes(
                f"{name} [{unit}]",
                series[0].unit if column == 0 else None,
                span=(edges[0], edges[-1]),
                reach=reach,
                number=number,
                rows=len(present),
            )
            shapes += _bands(result, series[0], name, number, span=float(edges[-1] - edges[0]))
    return Figure(
        name=f"map-{order}",
        data=data,
        layout=layout(**axes, shapes=shapes, annotations=_headings(), showlegend=False, margin=_MARGIN),
        title=channel,
        caption=_caption(outside, bool(shapes)),
        height=90 + 300 * len(present),
        folded=order >= OPEN_FIGURES,
    )


_MARGIN = {"l": 70, "r": 20, "t": 64, "b": 50}


def _caption(outside: float, bands: bool) -> str:
    words = "Density of all samples; thick dashes: median, thin dashes: 10 and 90 % of each bin."
    words += " Violet: the range in which the mismatch was located." if bands else ""
    if outside > TOLD_OUTSIDE:
        words += f" {100 * outside:.1f} % of the samples lie outside the picture."
    return words


def _gathered(series: list[ChannelSeries], name: str) -> _Data | None:
    """All finite samples of the channel with that variable; None when no recording has it."""
    parts = [(getattr(s, name), *residuals(s)) for s in series if getattr(s, name) is not None]
    if not parts:
        return None
    table = np.concatenate([np.column_stack(part) for part in parts])
    table = table[np.all(np.isfinite(table), axis=1)]
    return _Data(*table.T) if table.shape[0] >= FEWEST_SAMPLES else None


def _reach(rows: list[_Data], floor: float) -> tuple[float, float]:
    """Half height of the panels in the channel's unit, and the share of samples beyond it."""
    values = np.abs(np.concatenate([np.concatenate((row.before, row.after)) for row in rows]))
    reach = max(1.05 * float(np.quantile(values, SHOWN)), 2 * floor, 1e-12)
    return reach, float(np.mean(values > reach))


def _edges(variable: Array, *, symmetric: bool) -> Array:
    low, high = float(variable.min()), float(variable.max())
    if symmetric:
        high = max(abs(low), abs(high))
        low = -high
    if high <= low:
        low, high = low - 0.5, high + 0.5
    return np.linspace(low, high, BINS + 1)


def _panel(
    variable: Array, residual: Array, edges: Array, reach: float, *, column: int, number: int
) -> list[Spec]:
    """Density and quantile lines of one panel; `column` 0 is before, 1 after."""
    dark, shade = ((palette.BEFORE_DARK, palette.BEFORE), (palette.AFTER_DARK, palette.AFTER))[column]
    # Empty cells are clear; a single sample can be seen.
    scale = [[0.0, "rgba(255,255,255,0)"], [1 / 255, palette.rgba(shade, 0.12)], [1.0, shade]]
    where = {"xaxis": f"x{number}" if number > 1 else "x", "yaxis": f"y{number}" if number > 1 else "y"}
    found = binned_quantiles(variable, residual, edges)
    lines = ((found.low, 1.0), (found.median, 3.0), (found.high, 1.0))
    return [
        _density(variable, residual, (edges[0], edges[-1]), reach) | {"colorscale": scale} | where,
        *(
            {
                "type": "scatter",
                "mode": "markers",
                "x": packed(found.centre),
                "y": packed(y),
                "marker": {
                    "symbol": "line-ew-open",
                    "size": DASH,
                    "color": dark,
                    "line": {"width": width, "color": dark},
                },
                "hovertemplate": "%{x:.4g}: %{y:.4g}<extra></extra>",
                **where,
            }
            for y, width in lines
        ),
    ]


def _density(variable: Array, residual: Array, span: tuple[float, float], reach: float) -> Spec:
    counts, x, y = np.histogram2d(variable, residual, bins=DENSITY, range=(span, (-reach, reach)))
    shade = np.log1p(counts) / np.log1p(max(float(counts.max()), 1.0))
    return {
        "type": "heatmap",
        "x": packed((x[1:] + x[:-1]) / 2),
        "y": packed((y[1:] + y[:-1]) / 2),
        "z": packed(np.round(255 * shade.T), "u1"),
        "zmin": 0,
        "zmax": 255,
        "showscale": False,
        "hoverinfo": "skip",
    }


def _axes(
    title: str, unit: str | None, *, span: tuple[float, float], reach: float, number: int, rows: int
) -> Spec:
    """Axes of panel `number`, counted by rows from 1; `unit` of the residual, None on the right."""
    row, column = divmod(number - 1, 2)
    suffix = str(number) if number > 1 else ""
    height = (1 - ROW_GAP * (rows - 1)) / rows
    top = 1 - row * (height + ROW_GAP)
    left = 0.53 * column
    across = axis(title, domain=[left, left + 0.47], anchor=f"y{suffix}", range=list(span))
    vertical = axis(f"residual [{unit}]") if unit is not None else axis("", showticklabels=False)
    upright = {"domain": [top - height, top], "range": [-reach, reach], "anchor": f"x{suffix}"}
    return {f"xaxis{suffix}": across, f"yaxis{suffix}": vertical | upright}


def _bands(result: Result, series: ChannelSeries, name: str, number: int, *, span: float) -> list[Spec]:
    found = mismatch_of(result, series.channel)
    suffix = str(number) if number > 1 else ""
    axes: Spec = {"xref": f"x{suffix}", "yref": f"y{suffix} domain"}
    return [
        rectangle(*d.range, palette.rgba(palette.WINDOW, 0.35), **axes)
        for d in (found.depends_on if found else ())
        if d.variable == f"{series.location}.{name}" and d.range[1] - d.range[0] < MARKED_RANGE * span
    ]


def _headings() -> list[Spec]:
    words = (
        ("before: nominal robot", 0.235, palette.BEFORE),
        ("after: augmented robot", 0.765, palette.AFTER),
    )
    return [
        {
            "text": text,
            "x": x,
            "y": 1.0,
            "xanchor": "center",
            "yanchor": "bottom",
            "yshift": 4,
            "xref": "paper",
            "yref": "paper",
            "showarrow": False,
            "font": {"size": 14, "color": colour},
        }
        for text, x, colour in words
    ]

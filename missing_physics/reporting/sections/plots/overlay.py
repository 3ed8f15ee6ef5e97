"""Before and after: the fit in numbers, and measured, nominal and augmented over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.decimate import envelope_indices, intervals
from missing_physics.reporting.elements.figures import Figure, Spec, axis, layout, line, rectangle, swatch
from missing_physics.reporting.elements.formatting import number, percent
from missing_physics.reporting.elements.selection import drawn_series, residuals, short_names, windows_of
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import ChannelFit, ChannelSeries, Result
from robot_model import Robot

__all__ = ["section"]

#: Total number of points of all time figures; at 12 bytes each, packed, about 1.6 MB of the page.
DRAWN_POINTS = 100_000
MOST_POINTS_PER_LINE = 5000
LINES = 5
#: Speed below which a joint rests, as a fraction of its largest, and the fraction of such samples from which
#: it is mentioned.
AT_REST, WORTH_TELLING = 0.01, 0.05
#: Figures beyond this many are folded, so that the page opens quickly.
OPEN_FIGURES = 3


def section(result: Result, robot: Robot) -> Section:
    """Table of the fit and one figure per series, the most informative first."""
    drawn = drawn_series(result)
    limit = min(MOST_POINTS_PER_LINE, DRAWN_POINTS // max(LINES * len(drawn), 1))
    figures = [_figure(result, item, order, limit) for order, item in enumerate(drawn)]
    channels = result.diagnosis.fit.channels
    return Section(
        anchor="overlay",
        heading="Before and after",
        values={
            "rows": [_fit_row(name, fit) for name, fit in channels.items()],
            "left_out": len(result.series) - len(drawn),
            "thinned": any(item.time.size > limit for item in drawn),
            "any": bool(drawn),
        },
        figures=figures,
    )


def _fit_row(channel: str, fit: ChannelFit) -> dict[str, str]:
    before, after = fit.before, fit.after
    gain = 1 - after.validation_rms / before.validation_rms if before.validation_rms > 0 else float("nan")
    return {
        "channel": channel,
        "unit": fit.unit,
        "train_before": number(before.train_rms),
        "train_after": number(after.train_rms),
        "held_before": number(before.validation_rms),
        "held_after": number(after.validation_rms),
        "gain": percent(gain),
        "noise_floor": number(fit.noise_floor),
    }


def _figure(result: Result, series: ChannelSeries, order: int, limit: int) -> Figure:
    part = "held-out stretches shaded" if series.held_out.any() else "fitted"
    held = "held out entirely" if series.role == "validation" else part
    return Figure(
        name=f"time-{order}",
        data=[*_overlay(series, limit), *_residuals(series, limit), *_legend(result, series)],
        layout=_layout(result, series),
        title=f"{series.channel} in {short_names(result)[series.recording]}",
        caption=f"Above: measured against both models. Below: measured minus model; {held}.{_rest(series)}",
        height=560,
        folded=order >= OPEN_FIGURES,
    )


def _rest(series: ChannelSeries) -> str:
    """A note on intervals at rest, if these are a significant fraction."""
    if series.velocity is None or series.channel.endswith(".position"):
        return ""
    speed = np.abs(series.velocity[np.isfinite(series.velocity)])
    share = float(np.mean(speed < AT_REST * speed.max())) if speed.size else 0.0
    if share < WORTH_TELLING:
        return ""
    return (
        f" The joint rests for {percent(share)} of the time: static friction then holds any torque up to its "
        "level, and these samples count in neither error."
    )


def _overlay(series: ChannelSeries, limit: int) -> list[Spec]:
    lines = (
        (series.measured, "measured", palette.MEASURED, 2.6),
        (series.nominal, "nominal model (before)", palette.BEFORE, 1.2),
        (series.augmented, "augmented model (after)", palette.AFTER, 1.2),
    )
    return [
        _thinned(series.time, y, limit, name=name, colour=colour, width=width)
        for y, name, colour, width in lines
    ]


def _residuals(series: ChannelSeries, limit: int) -> list[Spec]:
    before, after = residuals(series)
    lower = {"yaxis": "y2", "showlegend": False, "width": 1.0}
    return [
        _thinned(series.time, before, limit, name="residual before", colour=palette.BEFORE, **lower),
        _thinned(series.time, after, limit, name="residual after", colour=palette.AFTER, **lower),
    ]


def _thinned(time: NDArray[np.float64], y: NDArray[np.float64], limit: int, **look: object) -> Spec:
    keep = envelope_indices(y, limit)
    return line(time[keep], y[keep], **look)  # type: ignore[arg-type]


def _legend(result: Result, series: ChannelSeries) -> list[Spec]:
    entries = []
    if series.role == "train" and series.held_out.any():
        entries.append(swatch("held out", palette.rgba(palette.HELD_OUT, 0.35)))
    if windows_of(result, series):
        entries.append(swatch("located window", palette.rgba(palette.WINDOW, 0.5)))
    return [*entries, _noise_entry()] if series.noise_floor > 0 else entries


def _noise_entry() -> Spec:
    """Legend entry of the dashed lines."""
    look = {"mode": "lines", "line": {"color": palette.NOISE, "dash": "dash", "width": 2}}
    return swatch("± noise floor (rms)", palette.NOISE) | look


def _noise_lines(series: ChannelSeries) -> list[Spec]:
    look = {"color": palette.NOISE, "dash": "dash", "width": 1.2}
    ends = {"type": "line", "xref": "paper", "yref": "y2", "x0": 0, "x1": 1, "line": look}
    return [ends | {"y0": y, "y1": y} for y in (-series.noise_floor, series.noise_floor)]


def _layout(result: Result, series: ChannelSeries) -> Spec:
    held = intervals(series.time, series.held_out) if series.role == "train" else ()
    shapes = [rectangle(a, b, palette.rgba(palette.HELD_OUT, 0.2)) for a, b in held]
    shapes += [
        rectangle(a, b, palette.rgba(palette.WINDOW, 0.28), y1=0.44) for a, b in windows_of(result, series)
    ]
    shapes += _noise_lines(series) if series.noise_floor > 0 else []
    return layout(
        xaxis=axis("time [s]", anchor="y2"),
        yaxis=axis(f"{series.channel} [{series.unit}]", domain=[0.5, 1.0]),
        yaxis2=axis(f"residual [{series.unit}]", domain=[0.0, 0.44]),
        shapes=shapes,
    )

"""Curves of unnamed forces in the rerun viewer.

A rerun plot is over time. A curve over anything else is drawn with its axes as lines in a plane, scaled to a
frame, and its numbers are stored separately, unscaled; a surface has a line for each knot of its first
variable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.curves import Band, Panel, Variable, panels, title_of, variables
from missing_physics.reporting.elements.formatting import number
from missing_physics.results.result import Unnamed
from robot_model import Robot

__all__ = ["curve_views", "send_curves"]

Array = NDArray[np.float64]
Span = tuple[float, float]

#: Width and height of a frame, in units of the plane, whose second axis points down.
WIDTH, HEIGHT = 3.0, 2.0
#: Distance of labels from the frame, and length of a tick.
NEAR, FAR, TICK = 0.12, 0.3, 0.04
#: Visible part of the plane.
BOUNDS = rrb.VisualBounds2D(x_range=[-0.7, WIDTH + 0.3], y_range=[-0.5, HEIGHT + 0.6])
#: The viewer hangs words below their point: about half their height.
RAISED = 0.05
#: About so many ticks on an axis, and room beyond a curve as a share of its range.
TICKS, MARGIN = 5, 0.06
GREY = (150, 150, 150)
COLOURS = {"forward": palette.FORWARDS, "backward": palette.BACKWARDS}
#: Radii of lines in points of the screen, which rerun writes as negative numbers.
CURVE, EDGE = -1.8, -0.8


@dataclass(frozen=True)
class Picture:
    """Content of a frame: entity path, name, variables (the axis last) and curves."""

    path: str
    name: str
    over: tuple[Variable, ...]
    panel: Panel


def curve_views(unnamed: tuple[Unnamed, ...], robot: Robot) -> list[rrb.View]:
    """A view for each picture."""
    return [
        rrb.Spatial2DView(origin=f"/{picture.path}", name=picture.name, visual_bounds=BOUNDS)
        for picture in _pictures(unnamed, robot)
    ]


def send_curves(stream: rr.RecordingStream, unnamed: tuple[Unnamed, ...], robot: Robot) -> None:
    """Every measured curve, static, with its interval."""
    for picture in _pictures(unnamed, robot):
        _send(stream, picture)


def _pictures(unnamed: tuple[Unnamed, ...], robot: Robot) -> Iterator[Picture]:
    """One for each panel; of surfaces one for each direction of motion."""
    for item in unnamed:
        over = variables(item, robot)
        made = panels(item, robot)
        if len(over) > 1:
            made = tuple(
                replace(panel, words=band.words, bands=(band,)) for panel in made for band in panel.bands
            )
        for order, panel in enumerate(made):
            path = str(rr.new_entity_path(["unnamed", item.channel, f"part{order + 1}"]))
            yield Picture(path, ": ".join(filter(None, (title_of(item), panel.words))), over, panel)


def _send(stream: rr.RecordingStream, picture: Picture) -> None:
    panel, over = picture.panel, picture.over[-1]
    across = _span(np.concatenate([band.knots if band.knots.size else over.knots for band in panel.bands]))
    heights = [band.value for band in panel.bands]
    if len(picture.over) == 1:
        heights += [x for band in panel.bands for x in (band.low, band.high)]
    upright = _span(np.concatenate([[0.0], *(x.ravel() for x in heights)]))

    def placed(x: Array, y: Array) -> list[Array]:
        """Lines in the plane, of shape (N, 2) each, one for each stretch without gaps."""
        points = np.column_stack([WIDTH * _share(x, across), HEIGHT * (1.0 - _share(y, upright))])
        return [points[part] for part in np.ma.clump_unmasked(np.ma.masked_invalid(y))]

    words = f"{over.name} [{over.unit}]", f"{panel.channel} [{panel.unit}]"
    _send_frame(stream, f"{picture.path}/frame", (across, upright), words)
    for band in panel.bands:
        path = f"{picture.path}/{band.carrier or 'curve'}"
        colour = _rgb(COLOURS.get(band.carrier, palette.AFTER_ON_DARK))
        if len(picture.over) == 1:
            for name, values, radius in (
                ("value", band.value, CURVE),
                ("low", band.low, EDGE),
                ("high", band.high, EDGE),
            ):
                strips = placed(band.knots, values)
                stream.log(
                    f"{path}/{name}", rr.LineStrips2D(strips, colors=[colour], radii=[radius]), static=True
                )
        else:
            _send_family(stream, f"{path}/value", picture.over[0], band, lambda y: placed(over.knots, y))
        over_all = [v.knots for v in picture.over] if len(picture.over) > 1 else [band.knots]
        held: dict[str, Any] = {f"knots{k}": knots for k, knots in enumerate(over_all, 1)}
        held |= {"value": band.value.ravel(), "low": band.low.ravel(), "high": band.high.ravel()}
        stream.log(path, rr.AnyValues(**held, unit=panel.unit), static=True)


def _send_family(
    stream: rr.RecordingStream,
    path: str,
    first: Variable,
    band: Band,
    placed: Callable[[Array], list[Array]],
) -> None:
    """A line for each knot of the first variable, from blue at its least to vermilion at its greatest."""
    ends = np.array([_rgb(palette.AFTER_ON_DARK), _rgb(palette.BEFORE)], dtype=float)
    strips, labels, colours = [], [], []
    for knot, row in zip(first.knots, band.value):
        share = float(_share(knot, (first.knots[0], first.knots[-1])))
        for order, strip in enumerate(placed(row)):
            strips.append(strip)
            labels.append("" if order else f"{number(float(knot))} {first.unit}")
            colours.append(np.round(ends[0] + share * (ends[1] - ends[0])).astype(np.uint8))
    stream.log(
        path,
        rr.LineStrips2D(strips, colors=colours, labels=labels, radii=[CURVE], show_labels=True),
        static=True,
    )


def _send_frame(
    stream: rr.RecordingStream, path: str, spans: tuple[Span, Span], words: tuple[str, str]
) -> None:
    """Frame, zero line, ticks with their numbers, and titles of the axes."""
    across, upright = (_ticks(*span) for span in spans)
    x, y = WIDTH * _share(across, spans[0]), HEIGHT * (1.0 - _share(upright, spans[1]))
    corners = np.array([[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT], [0, 0]])
    rest = HEIGHT * (1.0 - _share(np.zeros(1), spans[1])[0])
    lines = [corners, np.array([[0, rest], [WIDTH, rest]])]
    lines += [np.array([[at, HEIGHT], [at, HEIGHT + TICK]]) for at in x]
    lines += [np.array([[0, at], [-TICK, at]]) for at in y]
    stream.log(path, rr.LineStrips2D(lines, colors=[GREY], radii=[EDGE]), static=True)
    points = [*((at, HEIGHT + NEAR) for at in x), *((-2 * NEAR, at - RAISED) for at in y)]
    points += [(WIDTH / 2, HEIGHT + FAR), (WIDTH / 2, -FAR)]
    stream.log(
        f"{path}/words",
        rr.Points2D(
            points,
            labels=[*(number(v) for v in across), *(number(v) for v in upright), *words],
            radii=[0.0],
            colors=[GREY],
            show_labels=True,
        ),
        static=True,
    )


def _span(values: Array) -> Span:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    room = MARGIN * (high - low) or 1.0
    return low - room, high + room


def _share(values: Array | float, span: Span) -> Array:
    return np.asarray((values - span[0]) / (span[1] - span[0]))


def _ticks(low: float, high: float) -> Array:
    """Round numbers between `low` and `high`."""
    rough = (high - low) / TICKS
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * min((1, 2, 5, 10), key=lambda m: abs(np.log(m * power / rough)))
    return np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step


def _rgb(colour: str) -> tuple[int, int, int]:
    red, green, blue = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    return red, green, blue

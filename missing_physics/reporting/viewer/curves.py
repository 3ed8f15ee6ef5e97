"""Curves of unnamed forces in the rerun viewer.

A rerun plot is over time. A curve over anything else is drawn with its axes as lines in a plane, scaled to a
frame, and its numbers are stored separately, unscaled.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.curves import Drawn, drawn
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
#: The viewer draws text below its point: about half its height.
RAISED = 0.05
#: Approximate number of ticks on an axis, and margin around a curve as a fraction of its range.
TICKS, MARGIN = 5, 0.06
GREY = (150, 150, 150)
#: Radii of lines in points of the screen, which rerun writes as negative numbers.
CURVE, EDGE = -1.8, -0.8


def curve_views(unnamed: tuple[Unnamed, ...], robot: Robot) -> list[rrb.View]:
    """A view for each force."""
    return [
        rrb.Spatial2DView(origin=f"/{path}", name=curve.title, visual_bounds=BOUNDS)
        for path, curve in _curves(unnamed, robot)
    ]


def send_curves(stream: rr.RecordingStream, unnamed: tuple[Unnamed, ...], robot: Robot) -> None:
    """Every measured curve, static, with its interval."""
    for path, curve in _curves(unnamed, robot):
        _send(stream, path, curve)


def _curves(unnamed: tuple[Unnamed, ...], robot: Robot) -> Iterator[tuple[str, Drawn]]:
    """Entity path and curve of each force; a channel may have several."""
    for order, item in enumerate(unnamed, 1):
        yield str(rr.new_entity_path(["unnamed", item.channel, f"curve{order}"])), drawn(item, robot)


def _send(stream: rr.RecordingStream, path: str, curve: Drawn) -> None:
    lines = {"value": curve.value, "low": curve.low, "high": curve.high}
    across, upright = _span(curve.knots), _span(np.concatenate([[0.0], *lines.values()]))
    _send_frame(stream, f"{path}/frame", (across, upright), (curve.across, curve.upright))
    colour = _rgb(palette.AFTER_ON_DARK)
    for name, values in lines.items():
        points = [WIDTH * _share(curve.knots, across), HEIGHT * (1.0 - _share(values, upright))]
        radius = CURVE if name == "value" else EDGE
        strip = rr.LineStrips2D([np.column_stack(points)], colors=[colour], radii=[radius])
        stream.log(f"{path}/{name}", strip, static=True)
    held: dict[str, Any] = {"knots": curve.knots, **lines, "across": curve.across, "upright": curve.upright}
    stream.log(path, rr.AnyValues(**held), static=True)


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
    low, high = float(np.min(values)), float(np.max(values))
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

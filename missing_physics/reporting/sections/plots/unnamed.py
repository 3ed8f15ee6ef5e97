"""Unnamed forces: their measured curves with confidence intervals."""

from __future__ import annotations

import numpy as np

from missing_physics.reporting.elements import palette
from missing_physics.reporting.elements.curves import drawn
from missing_physics.reporting.elements.figures import Figure, axis, layout, line, packed
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Result, Unnamed
from robot_model import Robot

__all__ = ["section"]

#: Height of a figure [px].
HEIGHT = 340
CAPTION = (
    "Line: torque of the actuator beyond what the model needs. Band: 95 % confidence interval. "
    "Between its knots the curve is interpolated linearly."
)


def section(result: Result, robot: Robot) -> Section | None:
    """Sentence and figure of each unnamed force; None if there are none."""
    items = result.diagnosis.unnamed
    if not items:
        return None
    figures = [_figure(item, robot, order) for order, item in enumerate(items)]
    return Section(
        anchor="unnamed",
        heading="Forces without a name",
        values={"items": [{"words": item.words, "figure": figure} for item, figure in zip(items, figures)]},
        figures=figures,
    )


def _figure(item: Unnamed, robot: Robot, order: int) -> Figure:
    """The curve with its knots, and its interval as an area."""
    curve = drawn(item, robot)
    area = {
        "type": "scatter",
        "mode": "lines",
        "x": packed(np.concatenate([curve.knots, curve.knots[::-1]]), "f8"),
        "y": packed(np.concatenate([curve.high, curve.low[::-1]])),
        "fill": "toself",
        "fillcolor": palette.rgba(palette.AFTER, 0.25),
        "line": {"width": 0},
        "hoverinfo": "skip",
        "showlegend": False,
    }
    look = {"mode": "lines+markers", "width": 2.0, "showlegend": False}
    return Figure(
        name=f"unnamed-{order}",
        data=[area, line(curve.knots, curve.value, name=item.channel, colour=palette.AFTER, **look)],
        layout=layout(xaxis=axis(curve.across), yaxis=axis(curve.upright)),
        title=curve.title,
        caption=CAPTION,
        height=HEIGHT,
    )

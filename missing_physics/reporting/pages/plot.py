"""One figure of the report, for a notebook."""

from __future__ import annotations

from plotly.graph_objects import Figure

from missing_physics.reporting.elements.selection import drawn_series
from missing_physics.reporting.sections.plots import overlay
from missing_physics.results.result import Result
from robot_model import InputError, Robot

__all__ = ["Figure", "figure_of"]


def figure_of(result: Result, robot: Robot, channel: str | None = None) -> Figure:
    """Measured series and both models over time, and their residuals.

    Args:
        result: a diagnosis.
        robot: nominal.
        channel: such as ``joint1.torque``; None for the most informative one.

    Raises:
        InputError: nothing was compared, or not that channel.
    """
    drawn = drawn_series(result)
    names = [series.channel for series in drawn]
    if not drawn:
        raise InputError("nothing was compared over time, so there is nothing to plot.")
    if channel is not None and channel not in names:
        raise InputError(f"'{channel}' was not compared; compared were {', '.join(dict.fromkeys(names))}.")
    found = overlay.section(result, robot).figures[0 if channel is None else names.index(channel)]
    figure = Figure(data=list(found.data), layout=found.layout)
    return figure.update_layout(title=found.title.replace("<", "&lt;"), height=found.height)

"""Initial layout of the viewer: the worst channels next to both robots in 3-D, then a tab for each place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from missing_physics.reporting.crosscheck.comparison import Comparison, Difference
from missing_physics.reporting.crosscheck.lanes import REST, rubbing_joints
from missing_physics.reporting.crosscheck.paths import TIMELINE, difference_path, value_path
from missing_physics.reporting.crosscheck.scene import Scene
from robot_model import Robot

__all__ = ["blueprint", "robot_bends", "scene_title"]

#: Places beyond this many are not laid out; their data are still in the file.
MOST_TABS = 12
#: Channels of the first tab.
MOST_WORST = 3
#: Rows of a joint's tabs.
MOTION = ("position", "velocity", "torque", "friction_torque", "attitude", "angular_velocity")
LOADS = ("radial_force", "axial_force", "bending_moment", "load_moment")
LINK = ("tip_deflection", "tip_acceleration", "strain")
BASE = ("attitude", "position", "angular_velocity", "linear_velocity")
#: Margin above and below the lines, as a share of their range; and of a plot that contains only zero.
MARGIN, TINY = 0.06, 1e-12
WHOLE = ("energy", "linear_momentum", "angular_momentum")


def blueprint(robot: Robot, comparison: Comparison, scene: Scene) -> rrb.Blueprint:
    """Plots and lanes to the left, robots and words to the right."""
    left: list[rrb.Container | rrb.View] = [rrb.Tabs(*_tabs(robot, comparison), active_tab=0)]
    shares = [6.0]
    if rubbing_joints(robot):
        name = f"Friction: sticks below {REST:g} rad/s or m/s"
        left.append(rrb.StateTimelineView(origin="/friction", name=name))
        shares.append(min(0.8 + 0.7 * len(rubbing_joints(robot)), 3.0))
    words = rrb.TextDocumentView(origin="/summary", name="Summary")
    content = rrb.Horizontal(
        rrb.Vertical(*left, row_shares=shares),
        rrb.Vertical(_robots(scene), words, row_shares=[3, 2]),
        column_shares=[3, 2],
    )
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="paused"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def robot_bends(scene: Scene) -> bool:
    """Whether a flexible link is drawn."""
    return any(drawing.deflections for drawing in scene.drawings.values())


def scene_title(scene: Scene) -> str:
    """Name of the 3-D view, with the factor on deflections."""
    title = "Reference solid, Exudyn wires"
    if robot_bends(scene):
        scale = f"Deflections x {scene.factor:,.0f}" if scene.factor > 1 else "Deflections to scale"
        title = f"{scale}. {title}"
    return title


def _tabs(robot: Robot, comparison: Comparison) -> list[rrb.Container]:
    ranked = sorted(comparison.differences, key=lambda item: item.severity, reverse=True)
    joints = [joint.name for joint in robot.joints]
    links = [link.name for link in robot.flexible_links]
    tabs = [
        _pairs(comparison, "Worst", [[item] for item in ranked[:MOST_WORST]]),
        _places(comparison, "Joints", joints, MOTION),
        _places(comparison, "Bearings", joints, LOADS),
        _places(comparison, "Links", links, LINK),
        _places(comparison, "Base", ["base"], BASE),
        _places(comparison, "Energy, momenta", ["robot"], WHOLE),
    ]
    return [tab for tab in tabs if tab is not None]


def _places(
    comparison: Comparison, name: str, places: Sequence[str], quantities: Sequence[str]
) -> rrb.Container | None:
    """One tab for each place that has data."""
    found = [_pairs(comparison, place, _rows(comparison, place, quantities)) for place in places]
    tabs = [tab for tab in found if tab is not None][:MOST_TABS]
    return rrb.Tabs(*tabs, name=name, active_tab=0) if tabs else None


def _rows(comparison: Comparison, place: str, quantities: Sequence[str]) -> list[list[Difference]]:
    """The channels of each quantity at a place; quantities without information are left out."""
    rows = []
    for quantity in quantities:
        own = [item for item in comparison.differences if item.channel.split(".")[:2] == [place, quantity]]
        if any(item.extent > 0 or item.largest > (item.bound or 0.0) for item in own):
            rows.append(own)
    return rows


def _pairs(comparison: Comparison, name: str, rows: Sequence[Sequence[Difference]]) -> rrb.Container | None:
    """Both engines to the left, the difference in its band to the right, a row for each quantity."""
    views: list[rrb.View] = []
    for items in rows:
        channels = [item.channel for item in items]
        title = channels[0] if len(items) == 1 else ".".join(channels[0].split(".")[:2])
        both = (comparison.reference, comparison.exudyn)
        values = [recording[channel] for recording in both for channel in channels]
        views.append(_view(f"{title} [{items[0].unit}]", [f"{value_path(c)}/**" for c in channels], values))
        # The bands of several axes would hide each other: they are given in the title only.
        gaps = [f"{difference_path(c)}{'/**' if len(items) == 1 else ''}" for c in channels]
        apart = [comparison.difference(channel) for channel in channels]
        if len(items) == 1 and channels[0] in comparison.bands:
            apart += [comparison.bands[channels[0]], -comparison.bands[channels[0]]]
        views.append(_view(_title(items), gaps, apart))
    return rrb.Grid(*views, grid_columns=2, name=name) if views else None


def _title(items: Sequence[Difference]) -> str:
    """Title of a view of differences: the largest one, and the engines' own error."""
    bounds = [item.bound for item in items if item.bound is not None]
    step = f"; step error {max(bounds):.1e}" if bounds else ""
    return f"Difference {max(item.largest for item in items):.1e}{step}"


def _view(name: str, contents: Sequence[str], values: Sequence[NDArray[np.float64]]) -> rrb.TimeSeriesView:
    low, high = min(float(y.min()) for y in values), max(float(y.max()) for y in values)
    margin = MARGIN * (high - low) or MARGIN * max(abs(high), TINY)
    return rrb.TimeSeriesView(
        origin="/",
        contents=list(contents),
        name=name,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=rrb.ScalarAxis(range=(low - margin, high + margin)),
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _robots(scene: Scene) -> rrb.Spatial3DView:
    """Seen from in front and above; the whole motion fits in."""
    return rrb.Spatial3DView(origin="/robot", name=scene_title(scene), eye_controls=scene.eye.controls)

"""What the rerun viewer opens on: the worst channel first, its residual, the lanes, the robot, the words."""

from __future__ import annotations

from collections.abc import Mapping

import rerun.blueprint as rrb

from missing_physics.diagnosis.result import ChannelSeries, Result
from missing_physics.reporting.runs import TIMELINE, Run
from missing_physics.reporting.skeleton import reach
from robot_model import Robot

__all__ = ["blueprint"]

#: Tabs beyond this many are not laid out; the data are in the file all the same.
MOST_TABS = 12


def blueprint(result: Result, runs: tuple[Run, ...], robot: Robot, *, moving: Mapping[str, bool]) -> rrb.Blueprint:
    """One tab per recording; `moving` says for each run's name whether the robot's motion is drawn."""
    tabs = [_run(run, robot, moving=moving[run.name]) for run in runs[:MOST_TABS]]
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    content = rrb.Tabs(*tabs, name="Recordings") if tabs else summary
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _run(run: Run, robot: Robot, *, moving: bool) -> rrb.Container:
    plots = [_channel(run, series) for series in run.series[:MOST_TABS]]
    lanes = rrb.StateTimelineView(origin=f"/{run.name}/lanes", name="Located windows, held-out stretches")
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    side = [summary, _robot(run, robot)] if moving else [summary]
    left = rrb.Vertical(rrb.Tabs(*plots), lanes, row_shares=[5, 1])
    return rrb.Horizontal(left, rrb.Vertical(*side), column_shares=[2, 1], name=f"{run.source} ({run.role})")


def _channel(run: Run, series: ChannelSeries) -> rrb.Container:
    linked = rrb.TimeAxis(link="LinkToGlobal")
    return rrb.Vertical(
        rrb.TimeSeriesView(
            origin=f"/{run.path('channels', series.channel)}",
            name=f"{series.channel} [{series.unit}]: recorded, nominal, augmented",
            axis_x=linked,
            plot_legend=rrb.Corner2D.RightTop,
        ),
        rrb.TimeSeriesView(
            origin=f"/{run.path('residuals', series.channel)}",
            name=f"{series.channel} [{series.unit}]: residual before and after",
            axis_x=linked,
            plot_legend=rrb.Corner2D.RightTop,
        ),
        name=series.channel,
    )


def _robot(run: Run, robot: Robot) -> rrb.Spatial3DView:
    size = reach(robot)
    centre = robot.base.position
    return rrb.Spatial3DView(
        origin=f"/{run.name}/robot",
        name="Recorded motion",
        eye_controls=rrb.EyeControls3D(
            position=[centre[0] + 1.2 * size, centre[1] - 2.0 * size, centre[2] + 1.0 * size],
            look_target=list(centre),
            eye_up=[0.0, 0.0, 1.0],
        ),
    )

"""Initial layout of the rerun viewer: the worst channel, its residual, the lanes, the robot and the text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rerun.blueprint as rrb

from missing_physics.reporting.elements.runs import TIMELINE, Run
from missing_physics.reporting.scene.motion import Motion
from missing_physics.results.result import ChannelSeries

__all__ = ["blueprint"]

#: Tabs beyond this many are not laid out; their data are still in the file.
MOST_TABS = 12


def blueprint(
    runs: tuple[Run, ...], motions: Mapping[str, Motion | None], curves: Sequence[rrb.View] = ()
) -> rrb.Blueprint:
    """One tab per recording, and one for `curves` that do not run over time.

    `motions` holds for each run's name the motion that is drawn, or None.
    """
    tabs = [_run(run, motions[run.name]) for run in runs[:MOST_TABS]]
    if curves:
        tabs.append(rrb.Grid(*curves[:MOST_TABS], name="Without a name"))
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    content = rrb.Tabs(*tabs, name="Recordings") if tabs else summary
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="paused"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _run(run: Run, motion: Motion | None) -> rrb.Container:
    plots = [_channel(run, series) for series in run.series[:MOST_TABS]]
    lanes = rrb.StateTimelineView(origin=f"/{run.name}/lanes", name="Located windows, held-out stretches")
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    side = [summary, _robot(run, motion)] if motion else [summary]
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


def _robot(run: Run, motion: Motion) -> rrb.Spatial3DView:
    """Seen from in front and above; the whole motion fits in."""
    return rrb.Spatial3DView(
        origin=f"/{run.path('robot')}",
        name=motion.title,
        eye_controls=motion.eye.controls,
    )

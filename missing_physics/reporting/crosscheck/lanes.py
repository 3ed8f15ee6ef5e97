"""Stick and slip of every joint with dry friction, as lanes of states."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from missing_physics.reporting.crosscheck.paths import TIMELINE, lane_path
from missing_physics.reporting.elements import palette
from robot_model import Recording, Robot

__all__ = ["REST", "friction_states", "rubbing_joints", "send_friction"]

#: Slower than this a joint sticks [rad/s or m/s]: ten times the speed over which both engines pass dry
#: friction through zero, so that the remaining motion is the creep of that transition or of a bristle.
REST = 1e-3
STICKS, FORWARDS, BACKWARDS = "sticks", "slips forwards", "slips backwards"
#: Colours other than those of the engines.
COLOURS = {STICKS: palette.HELD_OUT, FORWARDS: palette.FORWARDS, BACKWARDS: palette.BACKWARDS}
#: Effects with a friction level at rest.
DRY = ("coulomb_friction", "stribeck_friction", "lugre_friction", "asymmetric_friction")
#: Most states per lane; only the first ones of a chattering joint are shown.
MOST_STATES = 20_000


def rubbing_joints(robot: Robot) -> tuple[str, ...]:
    """Names of the joints with dry friction, in the order of the file."""
    dry = {use.at for use in robot.effects if use.effect in DRY}
    return tuple(joint.name for joint in robot.moving_joints if joint.name in dry)


def friction_states(velocity: NDArray[np.float64]) -> NDArray[np.str_]:
    """State at every instant from the joint's velocity [rad/s or m/s], shape (N,)."""
    return np.where(np.abs(velocity) < REST, STICKS, np.where(velocity > 0, FORWARDS, BACKWARDS))


def send_friction(stream: rr.RecordingStream, robot: Robot, recording: Recording, engine: str) -> None:
    """One lane for each joint with dry friction: the state that begins at each change."""
    for joint in rubbing_joints(robot):
        states = friction_states(recording[f"{joint}.velocity"])
        starts = np.flatnonzero(np.concatenate(([True], states[1:] != states[:-1])))[:MOST_STATES]
        path = lane_path(joint, engine)
        values = list(COLOURS)
        stream.log(
            path,
            rr.StateConfiguration(
                values=values,
                labels=values,
                colors=np.array([int(COLOURS[v][1:] + "FF", 16) for v in values], dtype=np.uint32),
            ),
            static=True,
        )
        stream.send_columns(
            path,
            indexes=[rr.TimeColumn(TIMELINE, duration=recording.time[starts])],
            columns=rr.StateChange.columns(state=[str(state) for state in states[starts]]),
        )

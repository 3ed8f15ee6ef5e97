"""The recorded motion of the robot as boxes and lines in the 3-D view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from missing_physics.reporting.runs import TIMELINE, Run
from missing_physics.reporting.skeleton import Poses, body_shapes, poses, reach
from robot_model import Robot

__all__ = ["MOST_POSES", "Motion", "motion", "send_motion"]

MOST_POSES = 6000
#: Poses per second: what a screen shows.
POSE_RATE = 60.0
BASE_COLOUR = (150, 150, 150)
LINK_COLOURS = ((86, 180, 233), (230, 159, 0), (0, 158, 115), (240, 228, 66), (204, 121, 167), (0, 114, 178))

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """The poses of all bodies at some instants [s], and a ball around them: `centre` (3,), `radius` [m]."""

    time: Array
    poses: Mapping[str, Poses]
    centre: Array
    radius: float


def motion(run: Run, robot: Robot) -> Motion | None:
    """The recorded motion; None when no joint's position is known in this run."""
    time, positions = _positions(run, robot)
    if not positions:
        return None
    found = poses(robot, positions)
    corners = [pose.translation for pose in found.values()]
    for body, shape in body_shapes(robot).items():
        corners += [found[body].translation + found[body].rotation @ (2 * shape.centre)]
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    radius = max(float(np.linalg.norm(high - low)) / 2, 0.5 * reach(robot))
    return Motion(time, found, (low + high) / 2, radius)


def send_motion(stream: rr.RecordingStream, run: Run, robot: Robot, motion: Motion | None) -> None:
    """Shapes once and a moving frame per body; nothing without a motion."""
    if motion is None:
        return
    width = 0.006 * reach(robot)
    for count, (body, shape) in enumerate(body_shapes(robot).items()):
        path = run.path("robot", body)
        colour = BASE_COLOUR if body == "base" else LINK_COLOURS[(count - 1) % len(LINK_COLOURS)]
        box = rr.Boxes3D(
            centers=[shape.centre],
            half_sizes=[shape.half_size],
            quaternions=[rr.Quaternion(xyzw=shape.quaternion)],
            colors=[(*colour, 110)],
            fill_mode="solid",
        )
        stream.log(f"{path}/box", box, static=True)
        if shape.lines:
            stream.log(
                f"{path}/lines",
                rr.LineStrips3D(list(shape.lines), colors=[colour], radii=[width]),
                static=True,
            )
        pose = motion.poses[body]
        stream.send_columns(
            path,
            indexes=[rr.TimeColumn(TIMELINE, duration=motion.time)],
            columns=rr.Transform3D.columns(translation=pose.translation, quaternion=pose.quaternion),
        )


def _positions(run: Run, robot: Robot) -> tuple[Array, dict[str, Array]]:
    """Instants [s] at which the robot is drawn, and the positions of the recorded joints there."""
    joints = {joint.name for joint in robot.moving_joints}
    known = [s for s in run.series if s.location in joints and s.position is not None and s.time.size > 1]
    if not known:
        return np.zeros(0), {}
    start, stop = known[0].time[0], known[0].time[-1]
    count = int(min(MOST_POSES, known[0].time.size, max((stop - start) * POSE_RATE, 2)))
    time = np.linspace(start, stop, count)
    positions = {}
    for series in known:
        assert series.position is not None
        finite = np.isfinite(series.position)
        if finite.any():
            positions[series.location] = np.interp(time, series.time[finite], series.position[finite])
    return time, positions

"""The recorded motion of a diagnosed robot for the 3-D view.

Joint positions come from the result. A recorded free base (attitude, position) and recorded flexible links
(deflection of the tip) are drawn too; otherwise the base stays at its initial pose and links are straight, as
stated in the view's title.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from missing_physics.reporting.elements.runs import Run
from missing_physics.reporting.scene.deflection import magnification
from missing_physics.reporting.scene.drawing import Colour, Drawing, Look, eye_for, send_robot
from missing_physics.reporting.scene.eye import Eye
from missing_physics.reporting.scene.skeleton import Poses, poses
from missing_physics.results.result import ChannelSeries
from robot_model import Recording, Robot

__all__ = ["MOST_POSES", "Motion", "motion", "send_motion"]

MOST_POSES = 6000
#: Poses per second: what a screen shows.
POSE_RATE = 60.0
BASE_COLOUR = (150, 150, 150)
LINK_COLOURS = ((86, 180, 233), (230, 159, 0), (0, 158, 115), (240, 228, 66), (204, 121, 167), (0, 114, 178))

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """The drawing of one recording.

    Attributes:
        time: instants of the poses [s], shape (N,).
        recorded: the robot as recorded.
        title: of the view: what moves, what does not, and the magnification of deflections.
        eye: that sees the complete motion.
    """

    time: Array
    recorded: Drawing
    title: str
    eye: Eye


def motion(run: Run, robot: Robot, recording: Recording | None = None) -> Motion | None:
    """The motion of a run; None when no joint's position is known in it.

    Args:
        run: of the result.
        robot: the nominal robot.
        recording: the recording of the run, if available.
    """
    time = _instants(run, robot)
    if time.size == 0:
        return None
    base = _base(robot, recording, time)
    deflections, factor = _deflections(robot, recording, time)
    positions = _positions(run, robot, time)
    recorded = Drawing(poses(robot, positions, base=base, deflections=deflections), deflections)
    title = _title(robot, factor, base=base is not None)
    return Motion(time, recorded, title, eye_for(robot, (recorded,)))


def send_motion(stream: rr.RecordingStream, run: Run, robot: Robot, motion: Motion | None) -> None:
    """The recorded robot; nothing without a motion."""
    if motion is None:
        return
    look = Look(partial(_colour, tuple(motion.recorded.poses)))
    send_robot(stream, robot, motion.recorded, motion.time, path=partial(run.path, "robot"), look=look)


def _colour(bodies: tuple[str, ...], body: str) -> Colour:
    return BASE_COLOUR if body == "base" else LINK_COLOURS[(bodies.index(body) - 1) % len(LINK_COLOURS)]


def _title(robot: Robot, factor: float | None, *, base: bool) -> str:
    words = ["Recorded motion"]
    if robot.base.kind == "free" and not base:
        words.append("base held still")
    if robot.flexible_links:
        scale = "links straight: no deflection recorded"
        if factor is not None:
            scale = f"deflections x {factor:,.0f}" if factor > 1 else "deflections to scale"
        words.append(scale)
    return "; ".join(words)


def _known(run: Run, robot: Robot) -> list[ChannelSeries]:
    """Series from which a joint's position is known."""
    joints = {joint.name for joint in robot.moving_joints}
    return [s for s in run.series if s.location in joints and s.time.size > 1 and s.position is not None]


def _instants(run: Run, robot: Robot) -> Array:
    known = _known(run, robot)
    if not known:
        return np.zeros(0)
    start, stop = min(s.time[0] for s in known), max(s.time[-1] for s in known)
    count = int(min(MOST_POSES, max(s.time.size for s in known), max((stop - start) * POSE_RATE, 2)))
    return np.linspace(start, stop, count)


def _positions(run: Run, robot: Robot, time: Array) -> dict[str, Array]:
    """Joint to its recorded positions at `time`."""
    found: dict[str, Array] = {}
    for series in _known(run, robot):
        values = np.asarray(series.position)
        finite = np.isfinite(values)
        if finite.any():
            found[series.location] = np.interp(time, series.time[finite], values[finite])
    return found


def _columns(
    recording: Recording | None, names: list[str], time: Array, *, quaternion: bool = False
) -> Array | None:
    """Channels at `time`, shape (N, len(names)); None if one is missing or empty.

    Both signs of a quaternion are the same attitude; the one nearer to the previous sample is taken.
    """
    if recording is None or any(name not in recording for name in names):
        return None
    values = np.column_stack([recording[name] for name in names])
    finite = np.isfinite(values).all(axis=1)
    if not finite.any():
        return None
    known = values[finite]
    if quaternion:
        towards = np.sign(np.einsum("ni,ni->n", known[1:], known[:-1]))
        known = known * np.cumprod(np.concatenate(([1.0], np.where(towards < 0, -1.0, 1.0))))[:, None]
    return np.column_stack([np.interp(time, recording.time[finite], column) for column in known.T])


def _base(robot: Robot, recording: Recording | None, time: Array) -> Poses | None:
    """Recorded poses of a free base; None without its attitude."""
    if robot.base.kind != "free":
        return None
    names = [f"base.attitude.{axis}" for axis in "xyzw"]
    attitude = _columns(recording, names, time, quaternion=True)
    if attitude is None or not np.linalg.norm(attitude, axis=1).all():
        return None
    place = _columns(recording, [f"base.position.{axis}" for axis in "xyz"], time)
    if place is None:
        place = np.tile(np.asarray(robot.base.position, dtype=float), (time.size, 1))
    return Poses(place, np.asarray(Rotation.from_quat(attitude).as_matrix()))


def _deflections(
    robot: Robot, recording: Recording | None, time: Array
) -> tuple[dict[str, Array], float | None]:
    """Flexible link to the deflection of its tip as drawn, and the factor; None if none was recorded."""
    found = {}
    for link in robot.flexible_links:
        moved = _columns(recording, [f"{link.name}.tip_deflection.{axis}" for axis in "xyz"], time)
        if moved is not None:
            found[link.name] = moved
    factor = magnification(tuple(robot.link(name) for name in found), tuple(found.values()))
    straight = np.zeros((time.size, 3))
    drawn = {link.name: factor * found.get(link.name, straight) for link in robot.flexible_links}
    return drawn, factor if found else None

"""Both robots in one 3-D view, moving: the reference solid, Exudyn as wires around it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from missing_physics.reporting.crosscheck.paths import colour, robot_path
from missing_physics.reporting.scene.deflection import magnification
from missing_physics.reporting.scene.drawing import Drawing, Look, eye_for, send_robot
from missing_physics.reporting.scene.eye import Eye
from missing_physics.reporting.scene.skeleton import Poses, poses
from robot_model import Recording, Robot

__all__ = ["MOST_POSES", "Scene", "scene", "send_scene"]

Array = NDArray[np.float64]

#: Poses per second, what a screen shows, and at most so many.
POSE_RATE = 50.0
MOST_POSES = 4000


@dataclass(frozen=True)
class Scene:
    """What is drawn.

    Attributes:
        time: instants of the poses [s], shape (N,).
        drawings: of each engine.
        factor: by which deflections are magnified.
        eye: that sees all of the motion.
    """

    time: Array
    drawings: Mapping[str, Drawing]
    factor: float
    eye: Eye


def scene(robot: Robot, recordings: Mapping[str, Recording]) -> Scene:
    """The motion of `robot` in the recordings of both engines, by engine, of the same instants."""
    first = next(iter(recordings.values()))
    rows = _rows(first)
    true = {engine: _deflections(robot, recording, rows) for engine, recording in recordings.items()}
    every = [(robot.link(name), moved) for own in true.values() for name, moved in own.items()]
    factor = magnification(tuple(link for link, _ in every), tuple(moved for _, moved in every))
    drawn = {engine: {name: factor * moved for name, moved in own.items()} for engine, own in true.items()}
    drawings = {
        engine: Drawing(_poses(robot, recording, rows, drawn[engine]), drawn[engine])
        for engine, recording in recordings.items()
    }
    return Scene(first.time[rows], drawings, factor, eye_for(robot, tuple(drawings.values())))


def send_scene(stream: rr.RecordingStream, robot: Robot, drawn: Scene) -> None:
    """The reference as a solid, Exudyn as wires around it."""
    for engine, drawing in drawn.drawings.items():
        own = colour("", engine)
        look = Look(lambda body, own=own: own, solid=engine == "reference")  # type: ignore[misc]
        send_robot(stream, robot, drawing, drawn.time, path=partial(robot_path, engine), look=look)


def _rows(recording: Recording) -> NDArray[np.intp]:
    """Rows at which the robot is drawn."""
    count = int(min(MOST_POSES, len(recording), max(recording.duration * POSE_RATE + 1, 2)))
    return np.unique(np.linspace(0, len(recording) - 1, count).round().astype(np.intp))


def _deflections(robot: Robot, recording: Recording, rows: NDArray[np.intp]) -> dict[str, Array]:
    found = {}
    for link in robot.flexible_links:
        names = [f"{link.name}.tip_deflection.{axis}" for axis in "xyz"]
        if all(name in recording for name in names):
            found[link.name] = np.column_stack([recording[name][rows] for name in names])
    return found


def _poses(
    robot: Robot, recording: Recording, rows: NDArray[np.intp], deflections: Mapping[str, Array]
) -> Mapping[str, Poses]:
    positions = {joint.name: recording[f"{joint.name}.position"][rows] for joint in robot.moving_joints}
    base = None
    if robot.base.kind == "free":
        place = np.column_stack([recording[f"base.position.{axis}"][rows] for axis in "xyz"])
        base = Poses(place, _rotations(recording, "base", rows))
    attitudes = {
        joint.name: _rotations(recording, joint.name, rows)
        for joint in robot.spherical_joints
        if f"{joint.name}.attitude.w" in recording
    }
    return poses(robot, positions, base=base, attitudes=attitudes, deflections=deflections)


def _rotations(recording: Recording, place: str, rows: NDArray[np.intp]) -> Array:
    quaternion = np.column_stack([recording[f"{place}.attitude.{axis}"][rows] for axis in "xyzw"])
    return np.asarray(Rotation.from_quat(quaternion).as_matrix())

"""Both robots in one 3-D view, moving: the reference solid, Exudyn as wires around it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from missing_physics.reporting.crosscheck.paths import TIMELINE, colour, robot_path
from missing_physics.reporting.deflection import bent_line, magnification
from missing_physics.reporting.skeleton import BodyShape, Poses, body_shapes, poses, reach
from robot_model import Recording, Robot

__all__ = ["MOST_POSES", "Scene", "scene", "send_scene"]

Array = NDArray[np.float64]

#: Poses per second, what a screen shows, and at most so many.
POSE_RATE = 50.0
MOST_POSES = 4000
#: Radii of lines as a share of the robot's reach: the reference as a rod, Exudyn as a wire in another colour.
RADII = {"reference": 0.006, "exudyn": 0.0025}
OPACITY = 90
#: The undeformed line of a flexible link.
REST_COLOUR = (110, 110, 110)
TIP_RADIUS = 0.012
#: Signs of the corners of a box.
BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


@dataclass(frozen=True)
class Scene:
    """What is drawn.

    Attributes:
        time: instants of the poses [s], shape (N,).
        poses: engine to body to poses.
        deflections: engine to flexible link to the deflection of its tip as drawn, shape (N, 3) [m].
        factor: by which deflections are magnified.
        centre, radius: of a ball around the motion [m].
    """

    time: Array
    poses: Mapping[str, Mapping[str, Poses]]
    deflections: Mapping[str, Mapping[str, Array]]
    factor: float
    centre: Array
    radius: float


def scene(robot: Robot, recordings: Mapping[str, Recording]) -> Scene:
    """The motion of `robot` in the recordings of both engines, by engine, of the same instants."""
    first = next(iter(recordings.values()))
    rows = _rows(first)
    true = {engine: _deflections(robot, recording, rows) for engine, recording in recordings.items()}
    every = [(robot.link(name), moved) for own in true.values() for name, moved in own.items()]
    factor = magnification(tuple(link for link, _ in every), tuple(moved for _, moved in every))
    drawn = {engine: {name: factor * moved for name, moved in own.items()} for engine, own in true.items()}
    placed = {
        engine: _poses(robot, recording, rows, drawn[engine]) for engine, recording in recordings.items()
    }
    centre, radius = _ball(robot, placed, drawn)
    return Scene(first.time[rows], placed, drawn, factor, centre, radius)


def send_scene(stream: rr.RecordingStream, robot: Robot, drawn: Scene) -> None:
    """Shapes once, a moving frame for each body, and the bent line of each flexible link."""
    shapes = body_shapes(robot)
    for engine, placed in drawn.poses.items():
        for body, shape in shapes.items():
            path = robot_path(engine, body)
            _send_shape(stream, robot, path, shape, engine, flexible=body in drawn.deflections[engine])
            pose = placed[body]
            stream.send_columns(
                path,
                indexes=[rr.TimeColumn(TIMELINE, duration=drawn.time)],
                columns=rr.Transform3D.columns(translation=pose.translation, quaternion=pose.quaternion),
            )
        for link, moved in drawn.deflections[engine].items():
            _send_bent(stream, robot, link, moved, drawn.time, engine)


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


def _ball(
    robot: Robot,
    placed: Mapping[str, Mapping[str, Poses]],
    deflections: Mapping[str, Mapping[str, Array]],
) -> tuple[Array, float]:
    """Centre and radius around everything that is drawn at any time."""
    corners = []
    shapes = body_shapes(robot)
    for engine, own in placed.items():
        for body, pose in own.items():
            corners.append(pose.translation)
            if body in deflections[engine]:
                ends = [bent_line(robot.link(body), deflections[engine][body])[:, -1]]
            else:
                turn = Rotation.from_quat(shapes[body].quaternion)
                box = shapes[body].centre + turn.apply(BOX_CORNERS * shapes[body].half_size)
                ends = [np.broadcast_to(corner, pose.translation.shape) for corner in box]
            corners += [pose.translation + np.einsum("nij,nj->ni", pose.rotation, end) for end in ends]
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 0.3 * reach(robot))


def _send_shape(
    stream: rr.RecordingStream, robot: Robot, path: str, shape: BodyShape, engine: str, *, flexible: bool
) -> None:
    own = colour("", engine)
    solid = engine == "reference"
    if not flexible:
        box = rr.Boxes3D(
            centers=[shape.centre],
            # Wires lie a little outside of the solid, where they can be seen.
            half_sizes=[shape.half_size * (1.0 if solid else 1.02)],
            quaternions=[rr.Quaternion(xyzw=shape.quaternion)],
            colors=[(*own, OPACITY)] if solid else [own],
            fill_mode="solid" if solid else "majorwireframe",
        )
        stream.log(f"{path}/box", box, static=True)
    if shape.lines:
        lines = rr.LineStrips3D(list(shape.lines), colors=[own], radii=[RADII[engine] * reach(robot)])
        stream.log(f"{path}/lines", lines, static=True)


def _send_bent(
    stream: rr.RecordingStream, robot: Robot, link: str, moved: Array, time: Array, engine: str
) -> None:
    path, own, size = robot_path(engine, link), colour("", engine), reach(robot)
    strips = bent_line(robot.link(link), moved)
    index = [rr.TimeColumn(TIMELINE, duration=time)]
    stream.log(
        f"{path}/bent", rr.LineStrips3D.from_fields(colors=[own], radii=[RADII[engine] * size]), static=True
    )
    stream.send_columns(f"{path}/bent", indexes=index, columns=rr.LineStrips3D.columns(strips=list(strips)))
    stream.log(
        f"{path}/tip",
        rr.Points3D.from_fields(
            colors=[own], radii=[TIP_RADIUS * size * (1.0 if engine == "reference" else 0.6)]
        ),
        static=True,
    )
    stream.send_columns(f"{path}/tip", indexes=index, columns=rr.Points3D.columns(positions=strips[:, -1]))
    if engine == "reference":
        straight = np.array(
            [strips[0, 0], strips[0, 0] + (bent_line(robot.link(link), np.zeros((1, 3)))[0, -1])]
        )
        stream.log(
            f"{path}/undeformed",
            rr.LineStrips3D([straight], colors=[REST_COLOUR], radii=[0.3 * RADII["exudyn"] * size]),
            static=True,
        )

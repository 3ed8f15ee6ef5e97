"""A robot in the rerun viewer: moving frames with boxes and lines, and bent lines for flexible links."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from missing_physics.reporting.elements.runs import TIMELINE
from missing_physics.reporting.scene.deflection import bent_line
from missing_physics.reporting.scene.eye import Eye, eye_on
from missing_physics.reporting.scene.skeleton import BodyShape, Poses, body_shapes, reach
from robot_model import Robot

__all__ = ["Colour", "Drawing", "Look", "eye_for", "outline", "send_robot"]

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

#: Opacity of boxes, of 255.
OPACITY = 100
#: Wires lie slightly outside a solid of the same size, so that they are visible.
OUTSIDE = 1.02
#: Radii of lines and of a tip as fractions of the robot's reach: a rod, or a wire visible on it.
ROD, WIRE, TIP, WIRE_TIP = 0.006, 0.0025, 0.012, 0.007
#: The undeformed line of a flexible link.
REST_COLOUR = (110, 110, 110)
REST_RADIUS = 0.0008
#: Least extent of a view, as a fraction of the robot's reach.
SMALLEST_VIEW = 0.6
#: Signs of the corners of a box.
BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


@dataclass(frozen=True)
class Look:
    """How a robot is drawn: the colour of each body, as a solid or as wires around one."""

    colour: Callable[[str], Colour]
    solid: bool = True


@dataclass(frozen=True)
class Drawing:
    """A robot at N instants.

    Attributes:
        poses: by body.
        deflections: of the tip of each flexible link as drawn, shape (N, 3) [m].
    """

    poses: Mapping[str, Poses]
    deflections: Mapping[str, Array]


def eye_for(robot: Robot, drawings: tuple[Drawing, ...]) -> Eye:
    """An eye that sees all of the drawings at all times."""
    return eye_on(outline(robot, drawings), least=SMALLEST_VIEW * reach(robot))


def outline(robot: Robot, drawings: tuple[Drawing, ...]) -> Array:
    """Origins and corners of everything that is drawn at any time, shape (M, 3) [m]."""
    shapes, corners = body_shapes(robot), []
    for drawing in drawings:
        for body, pose in drawing.poses.items():
            if body in drawing.deflections:
                ends = [bent_line(robot.link(body), drawing.deflections[body])[:, -1]]
            else:
                turn = Rotation.from_quat(shapes[body].quaternion)
                box = shapes[body].centre + turn.apply(BOX_CORNERS * shapes[body].half_size)
                ends = [np.broadcast_to(corner, pose.translation.shape) for corner in box]
            corners.append(pose.translation)
            corners += [pose.translation + np.einsum("nij,nj->ni", pose.rotation, end) for end in ends]
    return np.concatenate(corners)


def send_robot(
    stream: rr.RecordingStream,
    robot: Robot,
    drawing: Drawing,
    time: Array,
    *,
    path: Callable[..., str],
    look: Look,
) -> None:
    """Shapes once, a moving frame for each body, and the bent line of each flexible link.

    Args:
        path: entity path of parts below the robot, the body's name first.
        time: instants of the drawing [s], shape (N,).
    """
    size = reach(robot)
    index = [rr.TimeColumn(TIMELINE, duration=time)]
    for body, shape in body_shapes(robot).items():
        flexible = body in drawing.deflections
        _send_shape(stream, path(body), shape, look.colour(body), size, solid=look.solid, box=not flexible)
        pose = drawing.poses[body]
        stream.send_columns(
            path(body),
            indexes=index,
            columns=rr.Transform3D.columns(translation=pose.translation, quaternion=pose.quaternion),
        )
        if flexible:
            strips = bent_line(robot.link(body), drawing.deflections[body])
            _send_bent(stream, path(body), strips, time, look.colour(body), size, solid=look.solid)
            if look.solid:
                straight = bent_line(robot.link(body), np.zeros((1, 3)))
                lines = rr.LineStrips3D(list(straight), colors=[REST_COLOUR], radii=[REST_RADIUS * size])
                stream.log(f"{path(body)}/undeformed", lines, static=True)


def _send_shape(
    stream: rr.RecordingStream,
    path: str,
    shape: BodyShape,
    colour: Colour,
    size: float,
    *,
    solid: bool,
    box: bool,
) -> None:
    if box:
        stream.log(
            f"{path}/box",
            rr.Boxes3D(
                centers=[shape.centre],
                half_sizes=[shape.half_size * (1.0 if solid else OUTSIDE)],
                quaternions=[rr.Quaternion(xyzw=shape.quaternion)],
                colors=[(*colour, OPACITY)] if solid else [colour],
                fill_mode="solid" if solid else "majorwireframe",
            ),
            static=True,
        )
    if shape.lines:
        radius = (ROD if solid else WIRE) * size
        lines = rr.LineStrips3D(list(shape.lines), colors=[colour], radii=[radius])
        stream.log(f"{path}/lines", lines, static=True)


def _send_bent(
    stream: rr.RecordingStream,
    path: str,
    strips: Array,
    time: Array,
    colour: Colour,
    size: float,
    *,
    solid: bool,
) -> None:
    index = [rr.TimeColumn(TIMELINE, duration=time)]
    line = rr.LineStrips3D.from_fields(colors=[colour], radii=[(ROD if solid else WIRE) * size])
    stream.log(f"{path}/bent", line, static=True)
    stream.send_columns(f"{path}/bent", indexes=index, columns=rr.LineStrips3D.columns(strips=list(strips)))
    tip = rr.Points3D.from_fields(colors=[colour], radii=[(TIP if solid else WIRE_TIP) * size])
    stream.log(f"{path}/tip", tip, static=True)
    stream.send_columns(f"{path}/tip", indexes=index, columns=rr.Points3D.columns(positions=strips[:, -1]))

"""A flexible robot in Exudyn as bodies and constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from benchmarks.native.engine import exu, items, watched
from benchmarks.work_precision.manoeuvres import Course
from exudyn_model.bodies.rotation import from_quaternion
from exudyn_model.redundant.bodies.modal_body import ModalBody
from exudyn_model.redundant.bodies.parts import Connection, initial_poses, parts_of
from exudyn_model.redundant.bodies.rigid import Body
from exudyn_model.redundant.system import LOCKED, made
from robot_model import Robot

__all__ = ["Bodies", "BodyLaws", "Joined"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Joined:
    """Two bodies at a joint.

    Attributes:
        link: the connection.
        markers: on the carrying and on the carried body, with the joint's axes.
        nodes: of both bodies' frames.
        joint: Exudyn's constraint.
    """

    link: Connection
    markers: Sequence[int]
    nodes: Sequence[int]
    joint: Any


class BodyLaws(Protocol):
    """Forces on the joints."""

    def on_bodies(self, mbs: Any, joined: Sequence[Joined]) -> Any: ...


class Bodies:
    """One assembled system."""

    def __init__(self, robot: Robot, laws: BodyLaws) -> None:
        self._parts, self._connections = parts_of(robot, {}, {})
        poses = initial_poses(robot, self._parts, self._connections)
        self._container = exu.SystemContainer()
        self.mbs = self._container.AddSystem()
        gravity = np.asarray(robot.gravity, dtype=float)
        still = robot.base.kind == "fixed"
        self._bodies: list[Body] = [
            made(self.mbs, part, pose, gravity=gravity, flexible="modal", fixed=still and k == 0)
            for k, (part, pose) in enumerate(zip(self._parts, poses))
        ]
        self.called = laws.on_bodies(self.mbs, [self._joined(link) for link in self._connections])
        self._frames = [watched(self.mbs, body.frames[0]) for body in self._bodies]
        self._modes = {
            k: watched(self.mbs, body.modal)
            for k, body in enumerate(self._bodies)
            if isinstance(body, ModalBody)
        }
        self.mbs.Assemble()

    def _joined(self, link: Connection) -> Joined:
        """Put the joint's constraint into the system."""
        pair = self._bodies[link.parent], self._bodies[link.child]
        outer = pair[0].place(self.mbs, link.origin, link.rotation @ link.align)
        inner = pair[1].place(self.mbs, np.zeros(3), link.align)
        markers = [outer.marker, inner.marker]
        joint = self.mbs.AddObject(
            items.ObjectJointGeneric(markerNumbers=markers, constrainedAxes=LOCKED[link.joint.kind])
        )
        return Joined(link, markers, [body.frames[0] for body in pair], joint)

    def course(self) -> Course:
        """The run as it is compared."""
        data = [self.mbs.GetSensorStoredData(sensor) for sensor in self._frames]
        time = data[0][:, 0]
        frames = [self._whole(rows[:, 1:], body) for rows, body in zip(data, self._bodies)]
        turns = [np.array([from_quaternion(row[3:7]) for row in frame]) for frame in frames]
        joints = np.array([self._angle(link, turns) for link in self._connections]).T
        tips = [
            self.mbs.GetSensorStoredData(sensor)[:, 1:] @ self._bodies[k].link.shapes.translations[-1].T  # type: ignore[attr-defined]
            for k, sensor in self._modes.items()
        ]
        attitude = frames[0][:, 3:7] / np.linalg.norm(frames[0][:, 3:7], axis=1, keepdims=True)
        return Course(time, np.hstack([joints, frames[0][:, :3], attitude, *tips]))

    def _whole(self, rows: Array, body: Body) -> Array:
        """Coordinates with their reference values."""
        return rows + np.asarray(self.mbs.GetNode(body.frames[0])["referenceCoordinates"])

    def _angle(self, link: Connection, turns: Sequence[Array]) -> Array:
        outer, inner = turns[link.parent] @ (link.rotation @ link.align), turns[link.child] @ link.align
        relative = np.einsum("nji,nj->ni", outer, inner[:, :, 0])
        return np.arctan2(relative[:, 1], relative[:, 0])

"""A rigid robot in Exudyn's minimal coordinates."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from benchmarks.native.engine import watched
from benchmarks.work_precision.manoeuvres import Course
from exudyn_model.bodies.mechanism import Mechanism, mechanism_of
from exudyn_model.bodies.rotation import to_quaternion
from exudyn_model.simulation import initial_state
from exudyn_model.solve.system import build
from robot_model import Robot

__all__ = ["Tree", "TreeLaws"]


class TreeLaws(Protocol):
    """Forces on the joints."""

    def on_tree(self, mbs: Any, mechanism: Mechanism, first: int) -> Any: ...


class Tree:
    """One assembled system."""

    def __init__(self, robot: Robot, laws: TreeLaws) -> None:
        self._mechanism = mechanism_of(robot)
        state = initial_state(robot, self._mechanism)
        first = 6 if self._mechanism.free else 0
        system = build(self._mechanism, state, lambda t, x, v: [0.0] * (first + len(robot.moving_joints)))
        self.mbs, self._placement, self._container = system.mbs, system.placement, system.container
        # The tree's own force comes from Python; other items replace it.
        self.mbs.SetObjectParameter(0, "forceUserFunction", 0)
        self.called = laws.on_tree(self.mbs, self._mechanism, first)
        self._sensor = watched(self.mbs, 0)
        self.mbs.Assemble()

    def course(self) -> Course:
        """The run as it is compared."""
        rows = self.mbs.GetSensorStoredData(self._sensor)
        time, x = rows[:, 0], rows[:, 1:]
        first = self._placement.base_coordinates
        joints = np.empty((len(time), len(self._mechanism.coordinate)))
        joints[:, list(self._mechanism.coordinate)] = x[:, first:]
        if not first:
            return Course(time, joints)
        turns = [to_quaternion(self._placement.base(row, np.zeros_like(row)).rotation) for row in x]
        return Course(time, np.hstack([joints, x[:, :3], turns]))

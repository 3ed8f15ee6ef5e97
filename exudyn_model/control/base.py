"""The interface of control laws, and their inputs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from exudyn_model.bodies.rotation import from_rpy
from exudyn_model.control.motion import Motion, motions
from exudyn_model.control.rigid_dynamics import BaseState, Inner
from robot_model import Robot

__all__ = ["ControlLaw", "Goal", "JointState", "initial_joints"]

#: Reference position, velocity and acceleration.
Goal = tuple[float, float, float]


@dataclass(slots=True)
class JointState:
    """Measurements of a controller.

    Attributes:
        time: [s].
        position, velocity: of the moving joints in the order of the file [rad or m, per s].
        base: of a free base; None on a fixed one.
        loads: friction moments W of the bearings [N m], where needed.
        motor_position, motor_velocity: of motors with their own coordinate, at the joint side of the gear,
            in the order of their joints [rad or m, per s].
        inner: state of spherical joints and flexible links, for controllers whose model has them.
    """

    time: float
    position: Sequence[float]
    velocity: Sequence[float]
    base: BaseState | None = None
    loads: Sequence[float] = ()
    motor_position: Sequence[float] = ()
    motor_velocity: Sequence[float] = ()
    inner: Inner | None = None


def initial_joints(robot: Robot) -> JointState:
    """The initial state of the description, without separate motor coordinates."""
    base = None
    if robot.base.kind == "free":
        place, still = np.asarray(robot.base.position, dtype=float), np.zeros(3)
        base = BaseState(from_rpy(robot.base.rpy), still, place, still)
    joints = robot.moving_joints
    return JointState(
        0.0, [joint.initial_position for joint in joints], [joint.initial_velocity for joint in joints], base
    )


class ControlLaw(ABC):
    """A controller of all moving joints; vectors are in the order of the robot file."""

    #: The integral of the position errors is used.
    integrates = False
    #: The controller outputs a wrench on the base besides the torques.
    holds_base = False
    #: Its torques change strongly with positions and velocities within a step of the solver, whose iterations
    #: then need their derivatives.
    stiff = True
    #: Its model has spherical joints or flexible links, whose state it needs; the names of the latter.
    needs_inner = False
    bent_links: tuple[str, ...] = ()
    #: Its torques are of the drives behind their gears, not of the joints.
    at_drives = False
    #: It has its own states; `begin` and `accept` advance them.
    remembers = False

    def __init__(self, robot: Robot, *, sample_time: float = 0.0) -> None:
        self.sample_time = sample_time
        self._motions: list[Motion] = motions(robot)
        self._goals: tuple[float, list[Goal]] = (nan, [])

    def goals(self, time: float) -> list[Goal]:
        """Reference position, velocity and acceleration per joint; the last instant's are kept."""
        if time != self._goals[0]:
            self._goals = (time, [motion(time) for motion in self._motions])
        return self._goals[1]

    @abstractmethod
    def output(self, state: JointState, integral: Sequence[float]) -> list[float]:
        """What is held between ticks; `integral` is that of reference minus position [rad s or m s]."""

    def torque(self, output: Sequence[float], state: JointState) -> list[float]:
        """Present actuator torque at the joint [N m or N] for a held output."""
        return list(output)

    def voltage(self, output: Sequence[float]) -> list[float] | None:
        """Winding voltages [V] of a voltage drive; None for any other."""
        return None

    def wrench(self, output: Sequence[float]) -> list[float]:
        """On a held base: force and moment about its origin in base axes [N, N m]; else empty."""
        return []

    def begin(self, state: JointState, output: Sequence[float]) -> None:
        """The first instant, and the output there."""
        return None

    def accept(self, state: JointState, output: Sequence[float]) -> None:
        """An accepted instant, and the output that was in force up to it."""
        return None

    def errors(self, state: JointState) -> list[float]:
        """Reference minus position [rad or m]."""
        return [goal[0] - q for goal, q in zip(self.goals(state.time), state.position)]

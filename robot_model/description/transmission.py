"""Transmissions by which several motors move several joints, and the drives of a robot.

With the coordinates q of the joints and m of the motors, both behind the motors' own gears,

    q = T m,    C = T^-1,    m = C q.

Both sides have the same power, tau_q . qd = tau_m . md for every motion, so that torques transform as:

    tau_q = C^T tau_m,    tau_m = T^T tau_q.

A motor's inertia, friction and gear are functions of its own motion C q, and their forces act on the joints
by C^T: rotors of reflected inertia B as the mass matrix C^T B C.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from robot_model.input.errors import nearest
from robot_model.input.fields import Description, Name, Number
from robot_model.joint.actuator import Actuator

if TYPE_CHECKING:
    from robot_model.description.types import Bearing, Joint, Robot

__all__ = [
    "Drive",
    "Motor",
    "Transmission",
    "check_transmissions",
    "coupling_of",
    "drives_of",
    "transmitting_of",
]

#: Condition number above which a matrix whose rows and columns are scaled to one counts as singular: the
#: joint torques would be lost in rounding.
SINGULAR = 1e9


class Motor(Actuator):
    """A motor of a transmission, with its own gear; the keys of an actuator.

    Values that an actuator states at the joint are stated behind this gear, at the input of the transmission.
    """

    name: Name = Field(description="unique name of the motor, at which effects may sit and channels be named")
    kind: Literal["revolute", "prismatic"] = Field(
        default="revolute", description="whether its gear turns or slides"
    )


class Transmission(Description):
    """Motors that move several joints together: coupled wrists, differentials, parallelograms, linkages.

    `matrix` is T in q = T m, the joints' motion from the motors': one row for each joint, one column for each
    motor, behind its own gear; all zero positions coincide. Both sides have the same power for every motion,
    tau_q . qd = tau_m . md, so that torques are tau_q = T^-T tau_m and tau_m = T^T tau_q. A wrist whose
    motor 5 also turns axis 6 back by half has `joints = ["joint5", "joint6"]` and
    `matrix = [[1.0, 0.0], [-0.5, 1.0]]`; a differential has `[[0.5, 0.5], [0.5, -0.5]]`.

    Its joints have no `actuator` of their own. A controller commands torques at the joints, and the motors
    give T^T of them within their limits. Effects of joints and of actuators sit at a joint or, as with
    `at = "motor5"`, at a motor, where they depend on the motor's motion and torque and act on the joints by
    T^-T; gears (elasticity, backlash, hysteresis) sit at motors, in front of the transmission.
    """

    name: Name = Field(description="unique name of the transmission")
    joints: tuple[Name, ...] = Field(min_length=1, description="the joints that it moves")
    motors: tuple[Motor, ...] = Field(min_length=1, description="the motors that move it, as many as joints")
    matrix: tuple[tuple[Number, ...], ...] = Field(
        description="joints' motion per motors' motion, row by row [rad/rad, m/rad and so on]"
    )

    @model_validator(mode="after")
    def _fits(self) -> Transmission:
        joints, motors = len(self.joints), [motor.name for motor in self.motors]
        for what, names in (("joint", self.joints), ("motor", motors)):
            if twice := _repeated(names):
                raise ValueError(f"the {what} '{twice}' is listed twice; a transmission has each {what} once")
        if len(motors) != joints:
            raise ValueError(
                f"it has {len(motors)} motors for {joints} joints; give one motor for each joint"
            )
        for joint, row in zip(self.joints, self.matrix):
            if len(row) != joints:
                raise ValueError(
                    f"matrix: the row of '{joint}' has {len(row)} entries but needs {joints}, "
                    "one for each motor"
                )
        if len(self.matrix) != joints:
            raise ValueError(f"matrix: it has {len(self.matrix)} rows but needs {joints}, one for each joint")
        if not _regular(self.joints_from_motors):
            raise ValueError(
                "matrix: it is singular, so that its motors could turn against each other without moving the "
                "joints; correct its rows"
            )
        return self

    @property
    def joints_from_motors(self) -> NDArray[np.float64]:
        """T, shape (k, k)."""
        return np.array(self.matrix, dtype=float)

    @property
    def motors_from_joints(self) -> NDArray[np.float64]:
        """C = T^-1, shape (k, k)."""
        return np.asarray(np.linalg.inv(self.joints_from_motors))


@dataclass(frozen=True)
class Drive:
    """The motor of one coordinate: that of one joint, or one of a transmission.

    Attributes:
        name: of the joint that only it moves, else of the motor: the name for effects and channels.
        kind: whether its coordinate is an angle or a length.
        actuator: motor and gear; None where nothing drives the joint.
        joint: the joint that only it moves; None in a transmission.
    """

    name: str
    kind: str
    actuator: Actuator | None
    joint: Joint | None

    @property
    def gear_ratio(self) -> float:
        """Motor turns per turn behind the gear."""
        return self.actuator.gear_ratio if self.actuator else 1.0

    @property
    def reflected_inertia(self) -> float:
        """Rotor inertia behind the gear [kg m^2 or kg]."""
        return self.actuator.reflected_inertia if self.actuator else 0.0

    @property
    def position_limits(self) -> tuple[float, float] | None:
        """Initial position of its joint [rad or m]."""
        return self.joint.position_limits if self.joint else None

    @property
    def bearing(self) -> Bearing | None:
        """Of the joint that it moves alone."""
        return self.joint.bearing if self.joint else None


def drives_of(robot: Robot) -> tuple[Drive, ...]:
    """One drive per moving joint; motors of a transmission take the indices of its joints, in order."""
    moving = robot.moving_joints
    found = [Drive(joint.name, joint.kind, joint.actuator, joint) for joint in moving]
    names = [joint.name for joint in moving]
    for transmission in robot.transmissions:
        for joint, motor in zip(transmission.joints, transmission.motors):
            found[names.index(joint)] = Drive(motor.name, motor.kind, motor, None)
    return tuple(found)


def coupling_of(robot: Robot) -> NDArray[np.float64]:
    """C of the entire robot: drive coordinates from joint coordinates, (n, n); identity by default."""
    names = [joint.name for joint in robot.moving_joints]
    matrix = np.eye(len(names))
    for transmission in robot.transmissions:
        places = [names.index(joint) for joint in transmission.joints]
        matrix[np.ix_(places, places)] = transmission.motors_from_joints
    return matrix


def transmitting_of(robot: Robot) -> NDArray[np.float64]:
    """T of the entire robot: joint coordinates from drive coordinates, (n, n); identity by default."""
    names = [joint.name for joint in robot.moving_joints]
    matrix = np.eye(len(names))
    for transmission in robot.transmissions:
        places = [names.index(joint) for joint in transmission.joints]
        matrix[np.ix_(places, places)] = transmission.joints_from_motors
    return matrix


def check_transmissions(robot: Robot) -> None:
    """Raises `ValueError` where transmissions and the rest of the robot are inconsistent."""
    moving = {joint.name: joint for joint in robot.moving_joints}
    taken = ["base", *(link.name for link in robot.links), *(joint.name for joint in robot.joints)]
    owner: dict[str, str] = {}
    motors: dict[str, str] = {}
    if twice := _repeated(one.name for one in robot.transmissions):
        raise ValueError(f"transmissions: the name '{twice}' is used twice; names must be unique")
    for one in robot.transmissions:
        where = f"transmissions[{one.name}]"
        for name in one.joints:
            if name not in moving:
                raise ValueError(f"{where}.joints: '{name}' is no moving joint{nearest(name, moving)}")
            if name in owner:
                raise ValueError(
                    f"{where}.joints: '{name}' is moved by transmission '{owner[name]}' already; "
                    "put both into one, or remove the joint from one"
                )
            if moving[name].actuator is not None:
                raise ValueError(
                    f"{where}.joints: '{name}' has an actuator of its own; its figures belong to the motors, "
                    "so remove joints.actuator"
                )
            owner[name] = one.name
        for motor in one.motors:
            if motor.name in motors:
                raise ValueError(
                    f"{where}.motors: '{motor.name}' is a motor of '{motors[motor.name]}' already; "
                    "give each motor a name of its own"
                )
            if motor.name in taken:
                raise ValueError(
                    f"{where}.motors: '{motor.name}' is the name of a joint or body already; "
                    "names must be unique"
                )
            motors[motor.name] = one.name


def _repeated(words: Iterable[str]) -> str | None:
    return next((word for word, count in Counter(words).items() if count > 1), None)


def _regular(matrix: NDArray[np.float64]) -> bool:
    """Whether a square matrix can be inverted without losing most digits, whatever its units."""
    for axis in (1, 0):
        largest = np.abs(matrix).max(axis=axis, keepdims=True)
        if not largest.all():
            return False
        matrix = matrix / largest
    return bool(np.linalg.cond(matrix) < SINGULAR)

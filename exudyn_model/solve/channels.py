"""Named channels from states at the sampling instants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.rotation import to_quaternion
from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.control.laws import JointState
from exudyn_model.control.motion import motions
from exudyn_model.effects.gear import GEAR_PARTS
from exudyn_model.effects.losses import LOSSES, has_winding
from exudyn_model.forces.joints import Forces, JointForces
from exudyn_model.solve.system import RobotState
from robot_model import Recording, Robot, VoltageServo

__all__ = ["Samples", "channel_names", "exact_recording"]

Array = NDArray[np.float64]

#: Channels of a joint that are sampled, in the order of a row of `Samples`.
SAMPLED = ("position", "velocity", "acceleration", "torque", "friction_torque")
#: Channels of a motor with its own coordinate, in the order of a row of its samples.
MOTOR = ("motor_position", "motor_velocity", "gear_torque")
#: Channels of every motor of a transmission.
COUPLED: tuple[str, ...] = ("position", "velocity", "torque")
#: Corresponding joint channels where motor and joint move as one, for robots that measure them.
RIGID = {"motor_position": "position", "motor_velocity": "velocity"}
#: Channels of a free base: position in the inertial frame, attitude, and the rest in base axes.
BASE = (
    *(f"base.position.{axis}" for axis in "xyz"),
    *(f"base.attitude.{axis}" for axis in "wxyz"),
    *(f"base.{quantity}.{axis}" for quantity in ("linear_velocity", "angular_velocity") for axis in "xyz"),
    *(f"base.linear_acceleration.{axis}" for axis in "xyz"),
)


@dataclass
class Samples:
    """Rows at the instants of the recording, filled while a simulation runs."""

    joints: list[list[list[float]]] = field(default_factory=list)
    voltage: list[list[float]] = field(default_factory=list)
    base: list[Array] = field(default_factory=list)
    extra: list[list[float]] = field(default_factory=list)
    motors: list[list[Sequence[float]]] = field(default_factory=list)
    temperature: list[list[float]] = field(default_factory=list)
    contact: list[list[float]] = field(default_factory=list)
    losses: list[list[float]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.joints)

    def add_joints(self, state: JointState, acceleration: list[float], forces: JointForces) -> None:
        """One row of all moving joints, in the order of the file."""
        row = [list(state.position), list(state.velocity), acceleration, forces.command, forces.friction]
        self.joints.append(row)
        self.motors.append([state.motor_position, state.motor_velocity, forces.gears])

    def add_forces(self, state: JointState, forces: Forces) -> None:
        """Further values at an accepted state besides `add_joints`: winding voltages of a voltage drive
        [V], temperatures [K], contact forces in bearings with clearance [N], losses [W, J]."""
        voltage = forces.voltage(state)
        if voltage is not None:
            self.voltage.append(voltage)
        self.temperature.append(forces.temperatures(state.time))
        self.contact.append(forces.contact_forces(state))
        self.losses.append(forces.lost)

    def add_base(self, state: RobotState, acceleration: Sequence[float]) -> None:
        """One row of a free base; `acceleration` of its origin in the inertial frame [m/s^2]."""
        near = self.base[-1][3:7] if self.base else None
        rotation = state.base_rotation
        row = (
            state.base_position,
            to_quaternion(rotation, near=near),
            rotation.T @ state.base_velocity,
            state.base_angular_velocity,
            rotation.T @ np.asarray(acceleration),
        )
        self.base.append(np.concatenate(row))


def channel_names(robot: Robot, extra: Sequence[str] = ()) -> tuple[str, ...]:
    """Every channel of a simulation of `robot`; `extra` ones come last."""
    names: list[str] = []
    moved = {name for transmission in robot.transmissions for name in transmission.joints}
    for joint in robot.moving_joints:
        quantities: tuple[str, ...] = (*SAMPLED, "reference_position", "reference_velocity")
        coupled = joint.name in moved
        if joint.actuator and joint.actuator.torque_constant:
            quantities += ("current",)
        if isinstance(robot.controller, VoltageServo) and not coupled:
            quantities += ("voltage",)
        if joint.thermal is not None:
            quantities += ("temperature",)
        if joint.clearance is not None:
            quantities += ("contact_force",)
        quantities += () if coupled else _of_motor(robot, joint.name)
        names += [f"{joint.name}.{quantity}" for quantity in quantities]
    geared = geared_drives(robot)
    for motor in robot.motors:
        quantities = COUPLED
        if motor.torque_constant:
            quantities += ("current",)
        if isinstance(robot.controller, VoltageServo):
            quantities += ("voltage",)
        quantities += ("gear_torque",) if motor.name in geared else ()
        names += [f"{motor.name}.{quantity}" for quantity in quantities]
    return (*names, *(BASE if robot.base.kind == "free" else ()), *extra)


def _of_motor(robot: Robot, joint: str) -> tuple[str, ...]:
    """Channels of a joint's motor: all if it has its own coordinate, else its motion if measured."""
    if joint in geared_drives(robot):
        return MOTOR
    wanted = {sensor.channel for sensor in robot.sensors}
    return tuple(quantity for quantity in RIGID if f"{joint}.{quantity}" in wanted)


def geared_drives(robot: Robot) -> tuple[str, ...]:
    """Drives with a separate motor coordinate, in their order."""
    geared = {use.at for use in robot.effects if use.effect in GEAR_PARTS}
    return tuple(drive.name for drive in robot.drives if drive.name in geared)


def exact_recording(
    robot: Robot, time: Array, samples: Samples, extra: Sequence[str] = (), *, losses: bool = False
) -> Recording:
    """Every channel without noise, in the order of `channel_names`; `extra` names the samples' own.

    With `losses`, power and energy dissipated in the joints are included.
    """
    joints = robot.moving_joints
    table = np.array(samples.joints).reshape(len(time), len(SAMPLED), len(joints))
    goals_of = motions(robot)
    goals = np.array([[motion(t) for motion in goals_of] for t in time.tolist()])
    goals = goals.reshape(len(time), len(joints), 3)
    channels: dict[str, Array] = {}
    commands = table[:, SAMPLED.index("torque")].copy()
    coupling, place = Transmissions(robot), SAMPLED.index("torque")
    for row, command in zip(table, commands.tolist()):
        row[place] = coupling.forces_on_joints(command)
    for k, (joint, drive) in enumerate(zip(joints, robot.drives)):
        channels |= {f"{joint.name}.{name}": table[:, row, k] for row, name in enumerate(SAMPLED)}
        channels[f"{joint.name}.reference_position"] = goals[:, k, 0]
        channels[f"{joint.name}.reference_velocity"] = goals[:, k, 1]
        if drive.actuator and drive.actuator.torque_constant:
            per_ampere = drive.gear_ratio * drive.actuator.torque_constant
            channels[f"{drive.name}.current"] = commands[:, k] / per_ampere
        for quantity, same in RIGID.items():
            channels[f"{joint.name}.{quantity}"] = channels[f"{joint.name}.{same}"]
        if samples.temperature:
            channels[f"{joint.name}.temperature"] = np.array(samples.temperature)[:, k]
        if samples.voltage:
            channels[f"{drive.name}.voltage"] = np.array(samples.voltage)[:, k]
    for name, k in coupling.motors.items():
        turned = [[coupling.to_motors(values)[k] for values in row[:2]] for row in table.tolist()]
        motion = np.array(turned).reshape(len(time), 2)
        channels |= dict(zip((f"{name}.{quantity}" for quantity in COUPLED), (*motion.T, commands[:, k])))
    for k, joint in enumerate(joint for joint in joints if joint.clearance is not None):
        channels[f"{joint.name}.contact_force"] = np.array(samples.contact)[:, k]
    for k, name in enumerate(geared_drives(robot)):
        rows = np.array([[values[k] for values in row] for row in samples.motors])
        known = (*COUPLED[:2], MOTOR[2]) if name in coupling.motors else MOTOR
        channels |= {f"{name}.{quantity}": rows[:, i] for i, quantity in enumerate(known)}
    if samples.base:
        channels |= dict(zip(BASE, np.array(samples.base).T))
    if extra:
        channels |= dict(zip(extra, np.array(samples.extra).T))
    if losses:
        table = np.array(samples.losses).T
        places = _places_of_losses(robot)
        channels |= dict(zip(places, table))
        extra = (*extra, *_loss_names(robot))
    ordered = {name: channels[name] for name in channel_names(robot, extra)}
    return Recording(time, ordered, source=f"Exudyn, robot '{robot.name}'")


def _loss_names(robot: Robot) -> list[str]:
    """Channels of losses; of windings where their resistance is known."""
    wound = {drive.name for drive in robot.drives if has_winding(drive.actuator)}
    return [
        place for place in _places_of_losses(robot) if ".friction" in place or place.split(".")[0] in wound
    ]


def _places_of_losses(robot: Robot) -> list[str]:
    """`LOSSES` of each joint by friction and of its drive's winding, in the order of a row."""
    return [
        f"{joint.name if name.startswith('friction') else drive.name}.{name}"
        for joint, drive in zip(robot.moving_joints, robot.drives)
        for name in LOSSES
    ]

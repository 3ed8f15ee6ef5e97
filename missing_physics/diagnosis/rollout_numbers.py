"""The numbers of a robot that a free run depends on: one vector with a name for each entry.

Effect parameters are called ``effect@place.parameter``; motor constants ``joint.torque_constant`` and
``joint.resistance``; mass properties as in `reference_model.inertial.inertial_names`; of a voltage servo
``controller.supply`` and ``controller.gain.joint``; and ``reference_delay``, by how much the controller sees
its reference late.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from missing_physics.diagnosis.augment import with_inertial
from reference_model.effects.catalogue import used_effects
from reference_model.effects.units import unit_at
from reference_model.inertial import inertial_names, nominal_inertial
from robot_model import InputError, Robot, VoltageServo, unit_of
from robot_model.errors import nearest

__all__ = ["REFERENCE_DELAY", "Adjustable", "adjustables", "with_numbers"]

REFERENCE_DELAY = "reference_delay"

#: A motor constant, a supply or a gain may be wrong by this factor both ways before it is another motor.
MOTOR_FACTOR = 3.0
#: A mass property may be wrong by this many times its own size or the robot's typical one.
INERTIAL_RANGE = 3.0
#: Credible delays of a reference: from a clock that runs ahead to a slow field bus [s].
DELAYS = (-0.02, 0.05)
#: What a delay is measured in [s].
TYPICAL_DELAY = 5e-3


@dataclass(frozen=True)
class Adjustable:
    """One number: where it stands, how far it may go, and its scale.

    Attributes:
        value: in the robot.
        lower, upper: bounds of what is credible.
        typical: scale for optimisation, positive.
        unit: of all of them.
    """

    value: float
    lower: float
    upper: float
    typical: float
    unit: str


def adjustables(robot: Robot) -> dict[str, Adjustable]:
    """All numbers of `robot` by name, in the order in which free runs take them."""
    return {
        **_effects(robot),
        **_motors(robot),
        **_inertial(robot),
        **_servo(robot),
        REFERENCE_DELAY: Adjustable(0.0, *DELAYS, TYPICAL_DELAY, "s"),
    }


def _effects(robot: Robot) -> dict[str, Adjustable]:
    found = {}
    for used in used_effects(robot):
        place = used.at.split(".")[0]
        prismatic = any(joint.name == place and joint.kind == "prismatic" for joint in robot.joints)
        channel = unit_of(used.at, prismatic=prismatic) if "." in used.at else None
        for p in used.effect.parameters:
            unit = unit_at(p.unit, prismatic=prismatic, channel_unit=channel)
            value = float(used.parameters[p.name])
            scale = max(abs(value), p.typical * 1e-3) if p.linear else max(abs(value), 1e-12)
            found[f"{used.effect.id}@{used.at}.{p.name}"] = Adjustable(value, p.lower, p.upper, scale, unit)
    return found


def _motors(robot: Robot) -> dict[str, Adjustable]:
    found = {}
    for joint in robot.moving_joints:
        motor = joint.actuator
        unit = "N/A" if joint.kind == "prismatic" and motor and motor.gear_ratio == 1 else "N m/A"
        if motor and motor.torque_constant:
            found[f"{joint.name}.torque_constant"] = _by_factor(motor.torque_constant, unit)
        if motor and motor.resistance:
            found[f"{joint.name}.resistance"] = _by_factor(motor.resistance, "ohm")
    return found


def _servo(robot: Robot) -> dict[str, Adjustable]:
    servo = robot.controller
    if not isinstance(servo, VoltageServo):
        return {}
    joints = robot.moving_joints
    gains = np.broadcast_to(np.asarray(servo.gain, dtype=float), len(joints))
    named = {
        f"controller.gain.{joint.name}": _by_factor(float(gain), "1/rad")
        for joint, gain in zip(joints, gains)
    }
    return {"controller.supply": _by_factor(servo.supply, "V"), **named}


def _by_factor(value: float, unit: str) -> Adjustable:
    near, far = sorted((value / MOTOR_FACTOR, value * MOTOR_FACTOR))
    return Adjustable(value, near, far, max(abs(value), 1e-12), unit)


def _inertial(robot: Robot) -> dict[str, Adjustable]:
    names, values = inertial_names(robot), nominal_inertial(robot)
    numbers = dict(zip(names, values))
    found = {}
    for name, value in numbers.items():
        body, _, number = name.partition(".")
        scale = max(abs(value), _typical_size(robot, numbers, body, number))
        positive = number in ("mass", "reflected_inertia", "inertia.xx", "inertia.yy", "inertia.zz")
        lower = 0.0 if positive else value - INERTIAL_RANGE * scale
        upper = value + INERTIAL_RANGE * scale
        found[name] = Adjustable(float(value), float(lower), float(upper), float(scale), _unit(number))
    return found


def _typical_size(robot: Robot, numbers: Mapping[str, float], body: str, number: str) -> float:
    """A size for a number that may be zero in the description: made of the body's mass and reach."""
    if body == "gravity":
        return 1.0
    if number == "reflected_inertia":
        child = robot.joint(body).child
        return max(0.1 * numbers[f"{child}.inertia.xx"], 1e-9)
    mass = max(numbers[f"{body}.mass"], 1e-6)
    moments = [numbers[f"{body}.inertia.{pair}"] for pair in ("xx", "yy", "zz")]
    reach = max(float(np.sqrt(max(moments) / mass)), 1e-3)
    return {"mass": mass, "first_moment": mass * reach}.get(number.split(".")[0], mass * reach**2)


def _unit(number: str) -> str:
    units = {"mass": "kg", "first_moment": "kg m", "inertia": "kg m^2", "reflected_inertia": "kg m^2"}
    return units.get(number.split(".")[0], "m/s^2")


def with_numbers(robot: Robot, values: Mapping[str, float]) -> Robot:
    """`robot` with some of its numbers changed; the reference's delay is not part of a robot.

    Raises:
        InputError: a name that the robot does not have, or mass properties that no body has.
    """
    known = adjustables(robot)
    for name in values:
        if name not in known:
            raise InputError(f"robot '{robot.name}' has no number '{name}'{nearest(name, known)}.")
    changed = _with_effects(robot, values)
    changed = _with_inertial(changed, known, values)
    return _with_servo(_with_motors(changed, values), values)


def _with_effects(robot: Robot, values: Mapping[str, float]) -> Robot:
    uses = []
    for use in robot.effects:
        start = f"{use.effect}@{use.at}."
        own = {name.removeprefix(start): v for name, v in values.items() if name.startswith(start)}
        uses.append(use.model_copy(update=own) if own else use)
    return robot.model_copy(update={"effects": tuple(uses)})


def _with_inertial(robot: Robot, known: Mapping[str, Adjustable], values: Mapping[str, float]) -> Robot:
    names = [name for name in values if name in inertial_names(robot) and not name.startswith("gravity")]
    gravity = tuple(values.get(f"gravity.{a}", g) for a, g in zip("xyz", robot.gravity))
    robot = robot.model_copy(update={"gravity": gravity})
    if not names:
        return robot
    change = np.array([values[name] - known[name].value for name in names])
    changed, complaint = with_inertial(robot, names, change)
    if complaint:
        raise InputError(f"robot '{robot.name}': mass properties like these belong to no body.")
    return changed


def _with_motors(robot: Robot, values: Mapping[str, float]) -> Robot:
    joints = []
    for joint in robot.joints:
        own = {
            key: values[f"{joint.name}.{key}"]
            for key in ("torque_constant", "resistance")
            if f"{joint.name}.{key}" in values
        }
        if own and joint.actuator:
            joint = joint.model_copy(update={"actuator": joint.actuator.model_copy(update=own)})
        joints.append(joint)
    return robot.model_copy(update={"joints": tuple(joints)})


def _with_servo(robot: Robot, values: Mapping[str, float]) -> Robot:
    servo = robot.controller
    if not isinstance(servo, VoltageServo):
        return robot
    known = adjustables(robot)
    gains = tuple(
        values.get(name, known[name].value)
        for name in (f"controller.gain.{joint.name}" for joint in robot.moving_joints)
    )
    supply = values.get("controller.supply", servo.supply)
    return robot.model_copy(update={"controller": servo.model_copy(update={"gain": gains, "supply": supply})})

"""The numbers of a robot that a free run depends on: one vector with a name for each entry.

Effect parameters are called ``effect@place.parameter``; motor constants ``joint.torque_constant`` and
``joint.resistance`` and ``joint.rotor_inertia``; mass properties as in the robot file ``link.mass``,
``link.center_of_mass.x`` and ``link.inertia.xx`` (about the centre of mass), with ``gravity.x``; of a voltage
servo ``controller.supply`` and ``controller.gain.joint``; and ``reference_delay``, by how much the controller
sees its reference late.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from reference_model.effects.catalogue import get_effect, used_effects
from reference_model.effects.units import unit_at
from robot_model import InputError, Link, Robot, VoltageServo, nearest, unit_of

__all__ = ["PAIRS", "REFERENCE_DELAY", "Adjustable", "adjustables", "pairs_in_order", "with_numbers"]

REFERENCE_DELAY = "reference_delay"

#: Entries of an inertia matrix, in the order of the robot file.
PAIRS = ("xx", "yy", "zz", "xy", "xz", "yz")

#: A motor constant, a supply or a gain may be wrong by this factor both ways. Wide on purpose: a free run
#: knows only products of them, and a bound that is hit would pass for a result.
MOTOR_FACTOR = 5.0
#: A mass property may be wrong by this many times its own size or that of the body.
BODY_RANGE = 3.0
#: A rotor's reflected inertia may be looked for as this part of the link's.
ROTOR_PART = 0.1
#: Sizes that stand for zero [kg], [m], [kg m^2].
SMALLEST_MASS, SHORTEST, SMALLEST_INERTIA = 1e-6, 1e-3, 1e-9
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
        **_bodies(robot),
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
        if motor is None:
            continue
        inertia = robot.link(joint.child).inertia_matrix if joint.kind == "revolute" else np.zeros((3, 3))
        scale = max(ROTOR_PART * float(np.max(inertia)) / motor.gear_ratio**2, SMALLEST_INERTIA)
        rotor = _around(motor.rotor_inertia, scale, "kg m^2", positive=True)
        found[f"{joint.name}.rotor_inertia"] = rotor
        if motor.torque_constant:
            found[f"{joint.name}.torque_constant"] = _by_factor(motor.torque_constant, "N m/A")
        if motor.resistance:
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


def _bodies(robot: Robot) -> dict[str, Adjustable]:
    found = {}
    for link in robot.links:
        reach = _reach(robot, link)
        mass, spread = max(link.mass, SMALLEST_MASS), max(link.mass, SMALLEST_MASS) * reach**2
        found[f"{link.name}.mass"] = _around(link.mass, mass, "kg", positive=True)
        for axis, place in zip("xyz", link.center_of_mass):
            found[f"{link.name}.center_of_mass.{axis}"] = _around(place, reach, "m")
        matrix = link.inertia_matrix
        for pair in PAIRS:
            number = float(matrix[tuple("xyz".index(axis) for axis in pair)])
            same = pair[0] == pair[1]
            found[f"{link.name}.inertia.{pair}"] = _around(number, spread, "kg m^2", positive=same)
    for axis, pull in zip("xyz", robot.gravity):
        found[f"gravity.{axis}"] = _around(pull, 1.0, "m/s^2")
    return found


def _reach(robot: Robot, link: Link) -> float:
    """A length of the link: to its centre of mass, its radius of gyration or to the next joint [m]."""
    gyration = float(np.sqrt(max(np.diagonal(link.inertia_matrix)) / max(link.mass, SMALLEST_MASS)))
    onward = [float(np.linalg.norm(joint.origin)) for joint in robot.joints if joint.parent == link.name]
    return max(float(np.linalg.norm(link.center_of_mass)), gyration, *onward, SHORTEST)


def _around(value: float, scale: float, unit: str, *, positive: bool = False) -> Adjustable:
    size = max(abs(value), scale)
    lower = 0.0 if positive else value - BODY_RANGE * size
    return Adjustable(float(value), lower, value + BODY_RANGE * size, size, unit)


def with_numbers(robot: Robot, values: Mapping[str, float]) -> Robot:
    """`robot` with some of its numbers changed; the reference's delay is not part of a robot.

    Raises:
        InputError: a name that the robot does not have, or mass properties that no body has.
    """
    known = adjustables(robot)
    for name in values:
        if name not in known:
            raise InputError(f"robot '{robot.name}' has no number '{name}'{nearest(name, known)}.")
    return _with_servo(_with_motors(_with_bodies(_with_effects(robot, values), values), values), values)


def pairs_in_order(names: Sequence[str]) -> list[tuple[str, str]]:
    """Pairs of these numbers of which the first must be no smaller than the second."""
    heads = dict.fromkeys(name.rpartition(".")[0] for name in names if "@" in name)
    pairs = [
        (f"{head}.{greater}", f"{head}.{smaller}")
        for head in heads
        for greater, smaller in get_effect(head.partition("@")[0]).ordered
    ]
    return [pair for pair in pairs if set(pair) <= set(names)]


def _with_effects(robot: Robot, values: Mapping[str, float]) -> Robot:
    uses = []
    for use in robot.effects:
        start = f"{use.effect}@{use.at}."
        own = {name.removeprefix(start): v for name, v in values.items() if name.startswith(start)}
        for greater, smaller in get_effect(use.effect).ordered if own else ():
            now = {**use.parameters, **own}
            if now[greater] < now[smaller]:  # one of the two was not free
                own[greater] = now[smaller]
        uses.append(use.model_copy(update=own) if own else use)
    return robot.model_copy(update={"effects": tuple(uses)})


def _with_bodies(robot: Robot, values: Mapping[str, float]) -> Robot:
    links = []
    for link in robot.links:
        centre = tuple(
            values.get(f"{link.name}.center_of_mass.{axis}", place)
            for axis, place in zip("xyz", link.center_of_mass)
        )
        matrix = link.inertia_matrix
        moments = tuple(
            values.get(f"{link.name}.inertia.{pair}", float(matrix[tuple("xyz".index(a) for a in pair)]))
            for pair in PAIRS
        )
        mass = values.get(f"{link.name}.mass", link.mass)
        links.append(_link(robot, link, {"mass": mass, "center_of_mass": centre, "inertia": moments}))
    gravity = tuple(values.get(f"gravity.{axis}", pull) for axis, pull in zip("xyz", robot.gravity))
    return robot.model_copy(update={"links": tuple(links), "gravity": gravity})


def _link(robot: Robot, link: Link, numbers: Mapping[str, object]) -> Link:
    try:
        return Link.model_validate({"name": link.name, **numbers})
    except ValidationError as error:
        reason = str(error.errors()[0]["msg"]).removeprefix("Value error, ")
        raise InputError(f"robot '{robot.name}', link '{link.name}': {reason}.") from None


def _with_motors(robot: Robot, values: Mapping[str, float]) -> Robot:
    joints = []
    for joint in robot.joints:
        own = {
            key: values[f"{joint.name}.{key}"]
            for key in ("rotor_inertia", "torque_constant", "resistance")
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

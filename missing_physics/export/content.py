"""The part of a robot that simulators can hold: bodies, and a few parameters for each joint."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import BodyEffect
from reference_model.effects.catalogue import get_effect
from robot_model import Actuator, EffectUse, Inertial, InputError, Robot
from robot_model.input.fields import inertia_fault

__all__ = ["BodyNumbers", "Content", "JointNumbers", "content_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BodyNumbers:
    """Mass properties of a body, in its link's frame.

    Attributes:
        mass: [kg].
        centre: centre of mass [m], shape (3,).
        inertia: about it [kg m^2], shape (3, 3).
    """

    mass: float
    centre: Array
    inertia: Array


@dataclass
class JointNumbers:
    """Parameters of one joint, all on the joint side: N m and rad, for a prismatic joint N and m.

    Attributes:
        armature: reflected rotor inertia [kg m^2 or kg].
        damping: torque per speed.
        frictionloss: dry friction at any speed.
        stiffness: of a spring.
        offset: torque at position 0 that is independent of the command.
        gain: delivered torque per commanded torque.
        limit: largest commanded torque.
        driven: whether a motor acts on it.
    """

    armature: float = 0.0
    damping: float = 0.0
    frictionloss: float = 0.0
    stiffness: float = 0.0
    offset: float = 0.0
    gain: float = 1.0
    limit: float = math.inf
    driven: bool = False


@dataclass(frozen=True)
class Content:
    """A robot in the terms of other simulators.

    Attributes:
        robot: with its effects.
        gravity: [m/s^2], shape (3,).
        bodies: of links, and of a free base, by name, with payloads and corrections in them.
        joints: of moving joints, by name.
        motors: of motors of transmissions behind their gears, by name, in the same terms.
        left: effects that these parameters do not cover.
    """

    robot: Robot
    gravity: Array
    bodies: Mapping[str, BodyNumbers]
    joints: Mapping[str, JointNumbers]
    left: tuple[EffectUse, ...] = field(default=())
    motors: Mapping[str, JointNumbers] = field(default_factory=dict)


def content_of(robot: Robot) -> Content:
    """A robot's bodies and joints with those of its effects that simulators know.

    Raises:
        InputError: a link bends, a joint is spherical, or a body with what was found is no real one.
    """
    for link in robot.flexible_links:
        raise InputError(
            f"robot '{robot.name}': link '{link.name}' bends, which neither MJCF nor URDF can hold; describe "
            "it as rigid to export the rest."
        )
    for joint in robot.spherical_joints:
        raise InputError(
            f"robot '{robot.name}': joint '{joint.name}' is spherical, which is not exported; describe it by "
            "three revolute joints."
        )
    joints = {joint.name: _numbers(joint.actuator) for joint in robot.moving_joints}
    motors = {motor.name: _numbers(motor) for motor in robot.motors}
    places = {**joints, **motors}
    added: dict[str, list[EffectUse]] = {}
    gravity = np.array(robot.gravity, dtype=float)
    left = []
    for use in robot.effects:
        values = {**get_effect(use.effect).defaults(), **use.parameters}
        if use.effect == "gravity":
            gravity += [values[axis] for axis in "xyz"]
        elif use.effect in ("payload", "inertia"):
            added.setdefault(use.at, []).append(use)
        elif not (use.at in places and _taken(use.effect, values, places[use.at])):
            left.append(use)
    bodies: dict[str, Inertial] = {link.name: link for link in robot.links}
    if robot.base.kind == "free":
        bodies["base"] = robot.base
    found = {name: _body(robot, name, body, added.pop(name, [])) for name, body in bodies.items()}
    return Content(robot, gravity, found, joints, tuple(left), motors)


def _numbers(motor: Actuator | None) -> JointNumbers:
    """Parameters of a joint, or of a motor of a transmission, without effects."""
    if motor is None:
        return JointNumbers()
    return JointNumbers(armature=motor.reflected_inertia, limit=motor.torque_limit or math.inf, driven=True)


def _taken(effect: str, values: Mapping[str, float], joint: JointNumbers) -> bool:
    """Add an effect to a joint's parameters; whether they can hold it."""
    if effect == "viscous_friction":
        joint.damping += values["coefficient"]
    elif effect == "coulomb_friction":
        joint.frictionloss += values["torque"]
    elif effect == "cable_spring" and (joint.driven or values["stiffness"] > 0.0):
        joint.stiffness += values["stiffness"]
        joint.offset += values["torque_at_zero"]
    elif effect == "torque_offset" and joint.driven:
        joint.offset += values["torque"]
    elif effect == "torque_gain":
        joint.gain += values["gain_error"]
    else:
        return False
    return True


def _body(robot: Robot, name: str, body: Inertial, uses: list[EffectUse]) -> BodyNumbers:
    """Mass properties including the contributions of effects."""
    centre = np.array(body.center_of_mass, dtype=float)
    mass, moment = body.mass, body.mass * centre
    about = body.inertia_matrix + body.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    for use in uses:
        effect = get_effect(use.effect)
        assert isinstance(effect, BodyEffect)
        terms = effect.terms({**effect.defaults(), **use.parameters})
        mass += float(ca.DM(terms.mass))
        moment = moment + np.array(ca.DM(terms.first_moment)).ravel()
        about = about + np.array(ca.DM(terms.inertia))
    if mass <= 0.0:
        if mass == 0.0 and not uses:
            return BodyNumbers(0.0, centre, body.inertia_matrix)
        raise InputError(
            f"robot '{robot.name}': '{name}' has a mass of {mass:.4g} kg with what was found, which no "
            "simulator takes; correct the robot file and diagnose again."
        )
    centre = moment / mass
    inertia = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    if uses and (fault := inertia_fault(inertia)):
        raise InputError(f"robot '{robot.name}': '{name}' with what was found is no real body: {fault}.")
    return BodyNumbers(mass, centre, inertia)

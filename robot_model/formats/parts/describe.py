"""A draft as the tables of a robot file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robot_model.formats.parts.draft import Draft, DraftJoint, DraftLink, DraftMotor, DraftTransmission
from robot_model.formats.parts.mass import Mass
from robot_model.formats.parts.names import Names
from robot_model.formats.parts.notes import listed

__all__ = ["STANDARD_GRAVITY", "described", "inertia_list"]

HELD = "the motors {} are left out with the joints they move, of which one is held"
#: Gravity where a file gives none: downwards in the inertial frame [m/s^2].
STANDARD_GRAVITY = (0.0, 0.0, -9.81)


def described(draft: Draft, names: Names) -> dict[str, Any]:
    """The tables of a robot file, without keys that the format cannot hold."""
    base: dict[str, Any] = {"kind": draft.base}
    if any(draft.base_pose.place) or any(draft.base_pose.angles):
        base |= {"position": _list(draft.base_pose.place), "rpy": _list(draft.base_pose.angles)}
    root = next(link for link in draft.links if link.name == draft.root)
    if draft.base == "free" and root.mass is not None:
        base |= _masses(root.mass)
    moving = {joint.name for joint in draft.joints if joint.kind != "fixed"}
    coupled: list[DraftTransmission] = []
    for one in draft.transmissions:
        if moving >= set(one.joints):
            coupled.append(one)
        else:
            draft.notes.add(HELD, listed(f"'{motor.name}'" for motor in one.motors))
    motors = [motor for one in coupled for motor in one.motors]
    return {
        "gravity": _list(draft.gravity or STANDARD_GRAVITY),
        "base": base,
        "links": [_link(link, names) for link in draft.links if link is not root],
        "joints": [_joint(joint, names) for joint in draft.joints],
        "transmissions": [_transmission(one, k, draft, names) for k, one in enumerate(coupled, start=1)],
        "effects": [
            *(use for joint in draft.joints for use in _effects(joint, names.joints[joint.name])),
            *(use for motor in motors for use in _effects(motor, names.motors[motor.name])),
        ],
    }


def _transmission(one: DraftTransmission, number: int, draft: Draft, names: Names) -> dict[str, Any]:
    slides = all(joint.kind == "prismatic" for joint in draft.joints if joint.name in one.joints)
    tables = []
    for motor in one.motors:
        table: dict[str, Any] = {"name": names.motors[motor.name]}
        if slides:
            table["kind"] = "prismatic"
        if motor.gear_ratio != 1.0:
            table["gear_ratio"] = motor.gear_ratio
        if motor.armature:
            table["rotor_inertia"] = motor.armature / motor.gear_ratio**2
        if motor.top_force:
            table["torque_limit"] = motor.top_force
        tables.append(table)
    return {
        "name": f"transmission{number}",
        "joints": [names.joints[name] for name in one.joints],
        "motors": tables,
        "matrix": [_list(row) for row in np.linalg.inv(one.matrix)],
    }


def _link(link: DraftLink, names: Names) -> dict[str, Any]:
    return {"name": names.links[link.name], **(_masses(link.mass) if link.mass else {})}


def _masses(mass: Mass) -> dict[str, Any]:
    """The keys of a body's mass properties."""
    return {
        "mass": mass.mass,
        "center_of_mass": _list(mass.centre),
        "inertia": inertia_list(mass.inertia),
    }


def inertia_list(inertia: np.ndarray) -> list[float]:
    """Ixx Iyy Izz Ixy Ixz Iyz of a matrix."""
    return _list([inertia[pair] for pair in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])


def _joint(joint: DraftJoint, names: Names) -> dict[str, Any]:
    table: dict[str, Any] = {
        "name": names.joints[joint.name],
        "kind": joint.kind,
        "parent": names.links[joint.parent],
        "child": names.links[joint.child],
        "origin": _list(joint.pose.place),
        "rpy": _list(joint.pose.angles),
        "axis": _list(joint.axis),
    }
    if joint.initial:
        table["initial_position"] = joint.initial
    if joint.limits:
        table["position_limits"] = _list(joint.limits)
    if joint.top_speed:
        table["velocity_limit"] = joint.top_speed
    if not joint.passive:
        table["actuator"] = _actuator(joint)
    return table


def _actuator(joint: DraftJoint) -> dict[str, Any]:
    table: dict[str, Any] = {}
    if joint.gear_ratio != 1.0:
        table["gear_ratio"] = joint.gear_ratio
    if joint.armature:
        table["rotor_inertia"] = joint.armature / joint.gear_ratio**2
    if joint.top_force:
        table["torque_limit"] = joint.top_force
    return table


def _effects(joint: DraftJoint | DraftMotor, name: str) -> list[dict[str, Any]]:
    """Friction and springs of a joint or a motor as effects of the catalogue."""
    uses: list[dict[str, Any]] = []
    if joint.damping:
        uses.append({"effect": "viscous_friction", "at": name, "coefficient": joint.damping})
    if joint.friction:
        uses.append({"effect": "coulomb_friction", "at": name, "torque": joint.friction})
    if joint.stiffness:
        at_zero = joint.stiffness * joint.rest  # -k (q - rest) at q = 0
        spring = {"stiffness": joint.stiffness, "torque_at_zero": at_zero}
        uses.append({"effect": "cable_spring", "at": name, **spring})
    return uses


def _list(values: ArrayLike) -> list[float]:
    return [float(value) for value in np.asarray(values, dtype=float)]

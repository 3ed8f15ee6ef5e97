"""The same rigid robot in MuJoCo and in Pinocchio, built from the description, and states to evaluate.

Generalised vectors of the reference model hold the base's [linear; angular] in base axes first, with the
inertial acceleration of its origin. MuJoCo keeps the linear part in inertial axes; Pinocchio's acceleration
is the derivative of the velocity in base axes, so omega x v is added to it. Joints and rotors need no
conversion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio
from numpy.typing import NDArray

from reference_model.kinematics.spatial import quaternion_from_rpy, rotation_from_rpy
from robot_model import Inertial, Joint, Link, Robot

__all__ = [
    "MujocoPeer",
    "PinocchioPeer",
    "States",
    "body_columns",
    "mjcf",
    "random_states",
    "reflected",
    "rotations",
]

Array = NDArray[np.float64]

#: Parts of mj_forward that are disabled: contacts, limits, springs, actuators and sensors.
DISABLED = (
    *("constraint", "equality", "frictionloss", "limit", "contact", "spring", "damper"),
    *("clampctrl", "warmstart", "filterparent", "actuation", "refsafe", "sensor", "midphase"),
)


@dataclass(frozen=True)
class States:
    """States and joint torques: quaternion (N, 4), base velocity in base axes (N, 6), joints (N, n) each.

    A robot on a fixed base also has the base's rows, unused.
    """

    attitude: Array
    base_velocity: Array
    position: Array
    velocity: Array
    torque: Array

    def __len__(self) -> int:
        return len(self.position)


def random_states(robot: Robot, *, samples: int = 64, seed: int = 5) -> States:
    """States of moderate speed, spread over all positions."""
    rng, count = np.random.default_rng(seed), len(robot.moving_joints)
    attitude = rng.normal(size=(samples, 4))
    attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
    base = rng.normal(size=(samples, 6)) * (robot.base.kind == "free")
    joints = rng.normal(size=(3, samples, count))
    return States(attitude, base, joints[0], joints[1], 10 * joints[2])


def rotations(attitude: Array) -> Array:
    """Base to inertial axes, shape (N, 3, 3)."""
    w, x, y, z = attitude.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def reflected(joint: Joint) -> float:
    """Rotor inertia at the joint [kg m^2 or kg]."""
    return joint.actuator.gear_ratio**2 * joint.actuator.rotor_inertia if joint.actuator else 0.0


def body_columns(robot: Robot) -> list[tuple[Joint, Link]]:
    """Joints with their outboard bodies, each after its inboard body.

    Raises:
        ValueError: a joint or body that the peers are not built for.
    """
    links = {link.name: link for link in robot.links}
    if robot.flexible_links or any(joint.kind not in ("revolute", "prismatic") for joint in robot.tree):
        raise ValueError(f"robot '{robot.name}' is not made of rigid links, revolute and prismatic joints")
    return [(joint, links[joint.child]) for joint in robot.tree]


def mjcf(robot: Robot) -> str:
    """The robot as MuJoCo's XML, with all unneeded features disabled."""
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="false", balanceinertia="false")
    option = ElementTree.SubElement(root, "option", gravity=_words(robot.gravity))
    ElementTree.SubElement(option, "flag", dict.fromkeys(DISABLED, "disable"))
    world = ElementTree.SubElement(root, "worldbody")
    places = {"base": world}
    if robot.base.kind == "free":
        places["base"] = ElementTree.SubElement(world, "body", name="base")
        ElementTree.SubElement(places["base"], "freejoint", name="base")
        _mjcf_mass(places["base"], robot.base)
    for joint, link in body_columns(robot):
        quaternion = quaternion_from_rpy(joint.rpy)
        parent = places[joint.parent]
        body = ElementTree.SubElement(
            parent, "body", name=link.name, pos=_words(joint.origin), quat=_words(quaternion)
        )
        kind = "slide" if joint.kind == "prismatic" else "hinge"
        axis, rotor = _words(joint.unit_axis), repr(reflected(joint))
        ElementTree.SubElement(body, "joint", name=joint.name, type=kind, axis=axis, armature=rotor)
        _mjcf_mass(body, link)
        places[joint.child] = body
    return ElementTree.tostring(root, encoding="unicode")


def _mjcf_mass(body: Any, mass: Inertial) -> None:
    matrix = mass.inertia_matrix
    six = [matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[0, 1], matrix[0, 2], matrix[1, 2]]
    numbers = {"mass": repr(mass.mass), "pos": _words(mass.center_of_mass), "fullinertia": _words(six)}
    ElementTree.SubElement(body, "inertial", numbers)


def _words(numbers: Sequence[float] | Array) -> str:
    return " ".join(repr(float(x)) for x in numbers)


class MujocoPeer:
    """MuJoCo's model, and the states in its order.

    Attributes:
        model, data: of MuJoCo.
        qpos, qvel, force: shapes (N, nq), (N, nv), (N, nv).
    """

    def __init__(self, robot: Robot, states: States) -> None:
        self.xml = mjcf(robot)
        self.model = mujoco.MjModel.from_xml_string(self.xml)
        self.data = mujoco.MjData(self.model)
        self._turn = rotations(states.attitude)
        self._free = robot.base.kind == "free"
        places = [self.model.joint(joint.name) for joint in robot.moving_joints]
        self._columns = [int(place.dofadr[0]) for place in places]
        self.qpos = np.zeros((len(states), self.model.nq))
        self.qvel, self.force = np.zeros((2, len(states), self.model.nv))
        if self._free:
            self.qpos[:, 3:7] = states.attitude
            self.qvel[:, :3] = np.einsum("nij,nj->ni", self._turn, states.base_velocity[:, :3])
            self.qvel[:, 3:6] = states.base_velocity[:, 3:]
        self.qpos[:, [int(place.qposadr[0]) for place in places]] = states.position
        self.qvel[:, self._columns] = states.velocity
        self.force[:, self._columns] = states.torque

    def evaluate(self, k: int) -> Array:
        """qacc in state k, MuJoCo's own."""
        self.data.qpos[:], self.data.qvel[:] = self.qpos[k], self.qvel[k]
        self.data.qfrc_applied[:] = self.force[k]
        mujoco.mj_forward(self.model, self.data)
        return np.asarray(self.data.qacc)

    def accelerations(self) -> Array:
        """Rows as of the reference model, shape (N, rows)."""
        found = np.array([self.evaluate(k).copy() for k in range(len(self.qpos))])
        joints = found[:, self._columns]
        if not self._free:
            return joints
        linear = np.einsum("nji,nj->ni", self._turn, found[:, :3])
        return np.hstack([linear, found[:, 3:6], joints])


class PinocchioPeer:
    """Pinocchio's model, and the states in its order: q (N, nq), v and force (N, nv)."""

    def __init__(self, robot: Robot, states: States) -> None:
        self.model = pinocchio.Model()
        self.model.gravity.linear = np.array(robot.gravity, dtype=float)
        self._free, self._states = robot.base.kind == "free", states
        indices = {"base": 0}
        still = pinocchio.SE3.Identity()
        if self._free:
            free = pinocchio.JointModelFreeFlyer()
            indices["base"] = self.model.addJoint(0, free, still, "base")
            self.model.appendBodyToJoint(indices["base"], _pin_mass(robot.base), still)
        for joint, link in body_columns(robot):
            place = pinocchio.SE3(rotation_from_rpy(joint.rpy), np.array(joint.origin, dtype=float))
            index = self.model.addJoint(indices[joint.parent], _pin_joint(joint), place, joint.name)
            self.model.appendBodyToJoint(index, _pin_mass(link), still)
            indices[joint.child] = index
        own = [self.model.getJointId(joint.name) for joint in robot.moving_joints]
        self._columns = [self.model.idx_vs[index] for index in own]
        rotors = np.zeros(self.model.nv)
        rotors[self._columns] = [reflected(joint) for joint in robot.moving_joints]
        self.model.armature = rotors
        self.data = self.model.createData()
        self.q = np.zeros((len(states), self.model.nq))
        self.v, self.force = np.zeros((2, len(states), self.model.nv))
        if self._free:
            self.q[:, 3:7] = states.attitude[:, [1, 2, 3, 0]]
            self.v[:, :6] = states.base_velocity
        self.q[:, [self.model.idx_qs[index] for index in own]] = states.position
        self.v[:, self._columns] = states.velocity
        self.force[:, self._columns] = states.torque

    def evaluate(self, k: int) -> Array:
        """Pinocchio's acceleration in state k."""
        return np.asarray(pinocchio.aba(self.model, self.data, self.q[k], self.v[k], self.force[k]))

    def accelerations(self) -> Array:
        """Rows as of the reference model, shape (N, rows)."""
        found = np.array([self.evaluate(k).copy() for k in range(len(self.q))])
        joints = found[:, self._columns]
        if not self._free:
            return joints
        velocity = self._states.base_velocity
        linear = found[:, :3] + np.cross(velocity[:, 3:], velocity[:, :3])
        return np.hstack([linear, found[:, 3:6], joints])


def _pin_mass(mass: Inertial) -> Any:
    return pinocchio.Inertia(mass.mass, np.array(mass.center_of_mass, dtype=float), mass.inertia_matrix)


def _pin_joint(joint: Joint) -> Any:
    """The specialised joint where the axis is one of the frame's, which is faster."""
    axis = joint.unit_axis
    letter = next((name for name, unit in zip("XYZ", np.eye(3)) if np.array_equal(axis, unit)), "")
    family = "JointModelR" if joint.kind == "revolute" else "JointModelP"
    if letter:
        return getattr(pinocchio, family + letter)()
    name = "JointModelRevoluteUnaligned" if joint.kind == "revolute" else "JointModelPrismaticUnaligned"
    return getattr(pinocchio, name)(axis)

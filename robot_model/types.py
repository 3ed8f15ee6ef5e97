"""What a robot is: an immutable, validated description of a tree of bodies.

Every length is in m, mass in kg, angle in rad, time in s unless its field says otherwise. Each body
carries one frame, fixed in it; a link's frame sits at its inboard joint, so that the joint's transform is
``parent frame -> (origin, rpy) -> motion of the joint -> link frame``, as in URDF.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from robot_model.control import Controller, NoController, Reference
from robot_model.errors import nearest
from robot_model.recording import QUANTITIES

__all__ = [
    "Actuator",
    "Base",
    "Bearing",
    "Description",
    "EffectUse",
    "Inertial",
    "Joint",
    "Link",
    "Robot",
    "Sensor",
]

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", max_length=64)]

#: How far principal moments may break the triangle inequality before it is called an error: rounded
#: figures of thin rods sit exactly on it.
TRIANGLE_TOLERANCE = 1e-6


class Description(BaseModel):
    """Base of every part of the description: frozen, and no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Inertial(Description):
    """Mass properties of a rigid body."""

    mass: NonNegative = Field(0.0, description="mass [kg]")
    center_of_mass: Vector = Field((0.0, 0.0, 0.0), description="centre of mass in the body's frame [m]")
    inertia: tuple[float, float, float] | tuple[float, float, float, float, float, float] = Field(
        (0.0, 0.0, 0.0),
        description="inertia about the centre of mass in the body's axes, Ixx Iyy Izz [Ixy Ixz Iyz] [kg m^2]",
    )

    @model_validator(mode="after")
    def _physical(self) -> Inertial:
        moments = np.linalg.eigvalsh(self.inertia_matrix)
        scale = max(float(np.max(np.abs(moments))), 1e-300)
        if moments[0] < -TRIANGLE_TOLERANCE * scale:
            raise ValueError(f"inertia has a negative principal moment ({moments[0]:.6g} kg m^2)")
        if moments[0] + moments[1] < moments[2] - TRIANGLE_TOLERANCE * scale:
            raise ValueError(
                "inertia breaks the triangle inequality: the two smaller principal moments "
                f"{moments[0]:.6g} + {moments[1]:.6g} are less than the largest, {moments[2]:.6g} kg m^2"
            )
        return self

    @property
    def inertia_matrix(self) -> np.ndarray:
        """Inertia about the centre of mass in the body's axes [kg m^2], shape (3, 3)."""
        xx, yy, zz = self.inertia[:3]
        xy, xz, yz = self.inertia[3:] if len(self.inertia) == 6 else (0.0, 0.0, 0.0)
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class Base(Inertial):
    """The root body: bolted to the ground, or floating."""

    kind: Literal["fixed", "free"] = Field("fixed", description="`fixed` to the ground or `free` to move")
    position: Vector = Field((0.0, 0.0, 0.0), description="initial position in the inertial frame [m]")
    rpy: Vector = Field((0.0, 0.0, 0.0), description="initial roll, pitch, yaw in the inertial frame [rad]")

    @model_validator(mode="after")
    def _has_mass_when_free(self) -> Base:
        if self.kind == "free" and self.mass <= 0:
            raise ValueError("mass of a free base must be positive")
        return self


class Link(Inertial):
    """A rigid body moved by a joint."""

    name: Name = Field(description="unique name of the link")


class Bearing(Description):
    """Geometry that turns a joint's reaction wrench into friction-producing load (model.md 5.3)."""

    radial_arm: NonNegative = Field(0.0, description="arm of the friction caused by radial force, R_p [m]")
    axial_arm: NonNegative = Field(0.0, description="arm of the friction caused by axial force, R_n [m]")
    bending_arm: Positive = Field(1.0, description="half span that carries a bending moment, R_b [m]")


class Actuator(Description):
    """Motor and gear of a joint. Motor-side figures are named so; all others are at the joint."""

    gear_ratio: Positive = Field(1.0, description="motor turns per joint turn (or rad per m) [-]")
    rotor_inertia: NonNegative = Field(0.0, description="rotor inertia, motor side [kg m^2]")
    torque_constant: Positive | None = Field(None, description="motor torque per current [N m/A]")
    resistance: Positive | None = Field(None, description="winding resistance [ohm]")
    torque_limit: Positive | None = Field(None, description="largest torque at the joint [N m or N]")


class Joint(Description):
    """What connects a link to its parent."""

    name: Name = Field(description="unique name of the joint")
    kind: Literal["revolute", "prismatic", "fixed"] = Field("revolute", description="kind of joint")
    parent: Name = Field(description="the inboard body, `base` or a link")
    child: Name = Field(description="the outboard link")
    origin: Vector = Field((0.0, 0.0, 0.0), description="joint frame's origin in the parent's frame [m]")
    rpy: Vector = Field((0.0, 0.0, 0.0), description="roll, pitch, yaw of the joint frame [rad]")
    axis: Vector = Field((0.0, 0.0, 1.0), description="axis in the joint frame; made a unit vector [-]")
    initial_position: float = Field(0.0, description="joint position at time 0 [rad or m]")
    initial_velocity: float = Field(0.0, description="joint velocity at time 0 [rad/s or m/s]")
    position_limits: tuple[float, float] | None = Field(None, description="lower and upper [rad or m]")
    velocity_limit: Positive | None = Field(None, description="largest speed [rad/s or m/s]")
    actuator: Actuator | None = Field(None, description="motor and gear; a passive joint has none")
    bearing: Bearing | None = Field(None, description="bearing geometry for load-dependent friction")

    @model_validator(mode="after")
    def _sound(self) -> Joint:
        if float(np.linalg.norm(self.axis)) < 1e-9:
            raise ValueError("axis has zero length")
        if self.position_limits and self.position_limits[0] >= self.position_limits[1]:
            raise ValueError("position_limits must be lower, upper")
        return self

    @property
    def unit_axis(self) -> np.ndarray:
        """Unit axis in the joint frame, shape (3,)."""
        axis = np.asarray(self.axis, dtype=float)
        return axis / np.linalg.norm(axis)


class Sensor(Description):
    """How one channel is measured."""

    channel: str = Field(description="native channel name, such as `joint1.position`")
    noise: NonNegative = Field(0.0, description="standard deviation of white noise, in the channel's unit")
    resolution: NonNegative = Field(0.0, description="smallest step, in the channel's unit")

    @model_validator(mode="after")
    def _known_quantity(self) -> Sensor:
        parts = self.channel.split(".")
        if len(parts) < 2:
            raise ValueError(f"channel '{self.channel}' is not PLACE.QUANTITY")
        if parts[1] not in QUANTITIES:
            raise ValueError(f"channel '{self.channel}' has an unknown quantity{nearest(parts[1], QUANTITIES)}")
        return self


class EffectUse(BaseModel):
    """A catalogue effect that this robot has. Keys besides the two below are its parameters."""

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)
    __pydantic_extra__: dict[str, float]

    effect: str = Field(description="effect id, see `missing-physics effects`")
    at: str = Field(description="where it sits: a joint, a link, `base`, or a channel for a sensor")

    @property
    def parameters(self) -> dict[str, float]:
        """Parameter name to value, in the units of the catalogue page."""
        return dict(self.__pydantic_extra__ or {})


class Robot(Description):
    """A robot: tree of bodies, joints, actuators, sensors, controller, reference motion, effects."""

    name: Name = Field(description="name of the robot")
    description: str = Field("", description="what it is, for people")
    gravity: Vector = Field((0.0, 0.0, 0.0), description="gravitational acceleration, inertial frame [m/s^2]")
    base: Base = Field(default_factory=Base, description="the root body")
    links: tuple[Link, ...] = Field(description="the moving bodies")
    joints: tuple[Joint, ...] = Field(description="one joint for each link")
    sensors: tuple[Sensor, ...] = Field((), description="noise and resolution of measured channels")
    controller: Controller = Field(default_factory=NoController, description="what drives the actuators")
    reference: Reference | None = Field(None, description="the reference motion")
    effects: tuple[EffectUse, ...] = Field((), description="catalogue effects this robot already has")
    known: tuple[str, ...] = Field(
        (), description="nominal figures a diagnosis must keep, such as `link1.mass` or `link1` [-]"
    )

    @model_validator(mode="after")
    def _is_a_tree(self) -> Robot:
        names = ["base", *(link.name for link in self.links)]
        for kind, given in (("body", names), ("joint", [joint.name for joint in self.joints])):
            twice = {name for name in given if given.count(name) > 1}
            if twice:
                raise ValueError(f"two {kind}s are named '{sorted(twice)[0]}'")
        clash = {joint.name for joint in self.joints} & set(names)
        if clash:
            raise ValueError(f"'{sorted(clash)[0]}' names both a body and a joint")
        for joint in self.joints:
            for role, body in (("parent", joint.parent), ("child", joint.child)):
                if body not in names:
                    raise ValueError(f"joint '{joint.name}': {role} '{body}' is no body{nearest(body, names)}")
            if joint.child == "base":
                raise ValueError(f"joint '{joint.name}': the base cannot be a child")
        children = [joint.child for joint in self.joints]
        for link in self.links:
            if children.count(link.name) != 1:
                raise ValueError(
                    f"link '{link.name}' is the child of {children.count(link.name)} joints; it must be of one"
                )
        if len(self._ordered()) != len(self.joints):
            raise ValueError("the joints form a cycle that does not hang on the base")
        movable = {joint.name for joint in self.joints if joint.kind != "fixed"}
        for item in self.reference.joints if self.reference else ():
            if item.joint not in movable:
                raise ValueError(f"reference.joints: '{item.joint}' is no moving joint{nearest(item.joint, movable)}")
        return self

    def _ordered(self) -> list[Joint]:
        reached, order = {"base"}, []
        waiting = list(self.joints)
        while waiting:
            ready = [joint for joint in waiting if joint.parent in reached]
            if not ready:
                break
            order += ready
            reached |= {joint.child for joint in ready}
            waiting = [joint for joint in waiting if joint not in ready]
        return order

    @property
    def tree(self) -> tuple[Joint, ...]:
        """All joints, each after the joint that carries its parent."""
        return tuple(self._ordered())

    @property
    def moving_joints(self) -> tuple[Joint, ...]:
        """Joints with a coordinate, in the order of the file: the order of every joint-space vector."""
        return tuple(joint for joint in self.joints if joint.kind != "fixed")

    def joint(self, name: str) -> Joint:
        """The joint of that name; raises KeyError."""
        return next(iter([j for j in self.joints if j.name == name]), None) or _missing(name)

    def link(self, name: str) -> Link:
        """The link of that name; raises KeyError."""
        return next(iter([b for b in self.links if b.name == name]), None) or _missing(name)

    def sensor(self, channel: str) -> Sensor | None:
        """The sensor of a channel, where the description has one."""
        return next((sensor for sensor in self.sensors if sensor.channel == channel), None)

    def with_effects(self, *effects: EffectUse) -> Robot:
        """A copy with these effects added."""
        return self.model_copy(update={"effects": (*self.effects, *effects)})


def _missing(name: str) -> None:
    raise KeyError(name)

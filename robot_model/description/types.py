"""`Robot`: an immutable, validated description of a tree of bodies.

Every length is in m, mass in kg, angle in rad, time in s unless its field says otherwise. Each body
carries one frame, fixed in it; a link's frame sits at its inboard joint, so that the joint's transform is
``parent frame -> (origin, rpy) -> motion of the joint -> link frame``, as in URDF.
"""

from __future__ import annotations

from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from robot_model.description.checks import check_robot, in_tree_order
from robot_model.description.control import Controller, NoController, Reference
from robot_model.description.flexible import Beam, ModalBody, SprungMass
from robot_model.description.recording import QUANTITIES
from robot_model.description.transmission import (
    Drive,
    Motor,
    Transmission,
    coupling_of,
    drives_of,
    transmitting_of,
)
from robot_model.input.errors import nearest
from robot_model.input.fields import Description, Name, NonNegative, Number, Positive, Vector, inertia_fault
from robot_model.joint.actuator import Actuator
from robot_model.joint.clearance import Clearance
from robot_model.joint.thermal import Thermal

__all__ = [
    "Actuator",
    "Base",
    "Bearing",
    "EffectUse",
    "Inertial",
    "Joint",
    "Link",
    "Robot",
    "Sensor",
    "Transmission",
]

#: An axis whose largest component is below this counts as missing [-].
SHORTEST_AXIS = 1e-9

#: Keys that only a joint with one coordinate may have.
ONE_COORDINATE = (
    "actuator",
    "bearing",
    "clearance",
    "initial_position",
    "initial_velocity",
    "position_limits",
    "thermal",
    "velocity_limit",
)

#: Far more than any robot has; keeps a damaged file from occupying the machine.
MOST_BODIES = 256


class Inertial(Description):
    """Mass properties of a rigid body."""

    mass: NonNegative = Field(default=0.0, description="mass [kg]")
    center_of_mass: Vector = Field(
        default=(0.0, 0.0, 0.0), description="centre of mass in the body's frame [m]"
    )
    inertia: tuple[Number, ...] = Field(
        default=(0.0, 0.0, 0.0),
        description="inertia about the centre of mass in the body's axes, Ixx Iyy Izz [Ixy Ixz Iyz] [kg m^2]",
    )

    @model_validator(mode="after")
    def _physical(self) -> Inertial:
        if len(self.inertia) not in (3, 6):
            raise ValueError(f"inertia has {len(self.inertia)} numbers; it needs Ixx Iyy Izz [Ixy Ixz Iyz]")
        if fault := inertia_fault(self.inertia_matrix):
            raise ValueError(fault)
        return self

    @property
    def inertia_matrix(self) -> NDArray[np.float64]:
        """Inertia about the centre of mass in the body's axes [kg m^2], shape (3, 3)."""
        xx, yy, zz = self.inertia[:3]
        xy, xz, yz = self.inertia[3:] if len(self.inertia) == 6 else (0.0, 0.0, 0.0)
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class Base(Inertial):
    """The root body: bolted to the ground, or floating."""

    kind: Literal["fixed", "free"] = Field(
        default="fixed", description="`fixed` to the ground or `free` to move"
    )
    position: Vector = Field(
        default=(0.0, 0.0, 0.0), description="initial position in the inertial frame [m]"
    )
    rpy: Vector = Field(
        default=(0.0, 0.0, 0.0), description="initial roll, pitch, yaw in the inertial frame [rad]"
    )

    @model_validator(mode="after")
    def _has_mass_when_free(self) -> Base:
        if self.kind == "free" and self.mass <= 0:
            raise ValueError("mass of a free base must be positive")
        return self


class Link(Inertial):
    """A body moved by a joint: rigid, or flexible with a `beam`, a `modal` or a `sprung` table."""

    name: Name = Field(description="unique name of the link")
    beam: Beam | None = Field(default=None, description="makes the link a flexible beam")
    modal: ModalBody | None = Field(
        default=None, description="makes the link a flexible body from an external finite element model"
    )

    sprung: SprungMass | None = Field(default=None, description="a point mass on springs at the link's frame")

    @model_validator(mode="after")
    def _one_kind(self) -> Link:
        kinds = [key for key in ("beam", "modal", "sprung") if getattr(self, key)]
        if len(kinds) > 1:
            raise ValueError(f"give either {kinds[0]} or {kinds[1]}, not both")
        flexible = self.beam or self.modal
        if flexible and flexible.boundary == "free" and (self.mass or any(self.inertia)):
            raise ValueError(
                f"a body with free modes cannot carry a rigid hub (mass = {self.mass:g} kg, inertia = "
                f"{list(self.inertia)}); set both to zero, or use clamped modes"
            )
        return self

    @property
    def flexible(self) -> bool:
        """Whether it is flexible."""
        return self.beam is not None or self.modal is not None or self.sprung is not None


class Bearing(Description):
    """Geometry that turns a joint's reaction wrench into the load that causes friction.

    W = R_n F_axial + R_p F_radial + (R_p / R_b) N_bending, in N m. With a `span` the joint runs in two
    bearings that share radial force and bending moment as vectors,
    R_1,2 = F_radial/2 +- (H x N_bending)/span, and W = R_n F_axial + R_p (|R_1| + |R_2|). Moments are about
    the joint frame's origin, which is midway between them. In a guide with a span the moment about its axis
    enters with R_b.
    """

    radial_arm: NonNegative = Field(
        default=0.0, description="arm of the friction caused by radial force, R_p [m]"
    )
    axial_arm: NonNegative = Field(
        default=0.0, description="arm of the friction caused by axial force, R_n [m]"
    )
    bending_arm: Positive = Field(default=1.0, description="half span that carries a bending moment, R_b [m]")
    span: Positive | None = Field(
        default=None, description="distance of two bearings, instead of `bending_arm` [m]"
    )


class Joint(Description):
    """The connection of a link to its parent."""

    name: Name = Field(description="unique name of the joint")
    kind: Literal["revolute", "prismatic", "spherical", "fixed"] = Field(
        default="revolute", description="kind of joint; a spherical one is passive"
    )
    parent: Name = Field(description="the inboard body, `base` or a link")
    child: Name = Field(description="the outboard link")
    origin: Vector = Field(
        default=(0.0, 0.0, 0.0), description="joint frame's origin in the parent's frame [m]"
    )
    rpy: Vector = Field(default=(0.0, 0.0, 0.0), description="roll, pitch, yaw of the joint frame [rad]")
    axis: Vector = Field(
        default=(0.0, 0.0, 1.0), description="axis in the joint frame; made a unit vector [-]"
    )
    initial_position: Number = Field(default=0.0, description="joint position at time 0 [rad or m]")
    initial_velocity: Number = Field(default=0.0, description="joint velocity at time 0 [rad/s or m/s]")
    initial_angular_velocity: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="of a spherical joint at time 0, child against parent in the child's axes [rad/s]",
    )
    position_limits: tuple[Number, Number] | None = Field(
        default=None, description="lower and upper [rad or m]"
    )
    velocity_limit: Positive | None = Field(default=None, description="largest speed [rad/s or m/s]")
    actuator: Actuator | None = Field(default=None, description="motor and gear; a passive joint has none")
    bearing: Bearing | None = Field(default=None, description="bearing geometry for load-dependent friction")
    clearance: Clearance | None = Field(default=None, description="clearance of the journal in its bearing")
    thermal: Thermal | None = Field(
        default=None, description="its temperature, and the temperature dependence of friction"
    )

    @model_validator(mode="after")
    def _sound(self) -> Joint:
        if max(map(abs, self.axis)) < SHORTEST_AXIS:
            raise ValueError(f"axis has zero length (it is {list(self.axis)})")
        if self.position_limits and self.position_limits[0] >= self.position_limits[1]:
            raise ValueError(f"position_limits must be lower, upper (they are {list(self.position_limits)})")
        if self.kind == "spherical" and (key := self._key_of_one_coordinate()):
            raise ValueError(f"a spherical joint has no {key}; remove it, or use three revolute joints")
        if self.clearance and self.kind != "revolute":
            raise ValueError(f"clearance is of revolute joints, and kind is {self.kind}; remove one of them")
        if self.kind != "spherical" and any(self.initial_angular_velocity):
            raise ValueError("initial_angular_velocity is of spherical joints; use initial_velocity")
        return self

    def _key_of_one_coordinate(self) -> str | None:
        """A given key that refers to the joint's single coordinate."""
        return next((key for key in ONE_COORDINATE if getattr(self, key)), None)

    @property
    def unit_axis(self) -> NDArray[np.float64]:
        """Unit axis in the joint frame, shape (3,)."""
        axis = np.asarray(self.axis, dtype=float)
        axis = axis / np.max(np.abs(axis))  # so that squares of huge components do not overflow
        return axis / np.linalg.norm(axis)


class Sensor(Description):
    """Measurement of one channel."""

    channel: str = Field(description="native channel name, such as `joint1.position`")
    noise: NonNegative = Field(
        default=0.0, description="standard deviation of white noise [unit of the channel]"
    )
    resolution: NonNegative = Field(default=0.0, description="smallest step [unit of the channel]")

    @model_validator(mode="after")
    def _known_quantity(self) -> Sensor:
        parts = self.channel.split(".")
        if not 2 <= len(parts) <= 3 or not all(parts):
            raise ValueError(f"channel '{self.channel}' is not PLACE.QUANTITY or PLACE.QUANTITY.AXIS")
        if parts[1] not in QUANTITIES:
            hint = nearest(parts[1], QUANTITIES)
            raise ValueError(f"channel '{self.channel}' has an unknown quantity '{parts[1]}'{hint}")
        return self


class EffectUse(BaseModel):
    """A catalogue effect that this robot has. Keys besides the two below are its parameters."""

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)
    __pydantic_extra__: dict[str, Number] = Field(init=False)

    effect: str = Field(description="effect id, see `missing-physics effects`")
    at: str = Field(
        description="its place: a joint, a motor of a transmission, a link, `base`, or a sensor's channel"
    )

    @model_validator(mode="before")
    @classmethod
    def _no_misspelt_key(cls, data: Any) -> Any:
        """If `effect` or `at` is missing, a key that holds text is its misspelling, not a parameter."""
        absent = [key for key in cls.model_fields if key not in data] if isinstance(data, dict) else []
        for key, value in data.items() if absent else ():
            if key not in cls.model_fields and isinstance(value, str):
                raise ValueError(f"unknown key '{key}'; did you mean '{absent[0]}'?")
        return data

    @property
    def parameters(self) -> dict[str, float]:
        """Parameter name to value, in the units of the catalogue page."""
        return dict(self.__pydantic_extra__ or {})


class Robot(Description):
    """A robot: tree of bodies, joints, actuators, sensors, controller, reference motion, effects."""

    name: Name = Field(description="name of the robot")
    description: str = Field(default="", description="what it is, for people")
    gravity: Vector = Field(
        default=(0.0, 0.0, 0.0), description="gravitational acceleration, inertial frame [m/s^2]"
    )
    base: Base = Field(default=Base(), description="the root body")
    links: tuple[Link, ...] = Field(max_length=MOST_BODIES, description="the moving bodies")
    joints: tuple[Joint, ...] = Field(max_length=MOST_BODIES, description="one joint for each link")
    transmissions: tuple[Transmission, ...] = Field(
        default=(), description="motors that move several joints together"
    )
    sensors: tuple[Sensor, ...] = Field(default=(), description="noise and resolution of measured channels")
    controller: Controller = Field(default_factory=NoController, description="what drives the actuators")
    reference: Reference | None = Field(default=None, description="the reference motion")
    effects: tuple[EffectUse, ...] = Field(
        default=(), description="effects of the catalogue that this robot has"
    )
    known: tuple[str, ...] = Field(
        default=(), description="nominal values that a diagnosis must keep, such as `link1.mass` or `link1`"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Robot:
        check_robot(self)
        return self

    @property
    def tree(self) -> tuple[Joint, ...]:
        """All joints, each after the joint that carries its parent."""
        return in_tree_order(self.joints)

    @property
    def moving_joints(self) -> tuple[Joint, ...]:
        """Joints with one coordinate, in the order of the file: the order of every joint-space vector."""
        return tuple(joint for joint in self.joints if joint.kind in ("revolute", "prismatic"))

    @property
    def spherical_joints(self) -> tuple[Joint, ...]:
        """Spherical joints, in the order of the file."""
        return tuple(joint for joint in self.joints if joint.kind == "spherical")

    @property
    def flexible_links(self) -> tuple[Link, ...]:
        """Flexible links, in the order of the file: the order of all modal coordinates."""
        return tuple(link for link in self.links if link.flexible)

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drives of the moving joints, one for each: its own motor, or a motor of a transmission."""
        return drives_of(self)

    @property
    def motors(self) -> tuple[Motor, ...]:
        """Motors of all transmissions."""
        return tuple(motor for transmission in self.transmissions for motor in transmission.motors)

    @property
    def coupling(self) -> NDArray[np.float64]:
        """C: coordinates of the drives from those of the moving joints, shape (n, n)."""
        return coupling_of(self)

    @property
    def transmitting(self) -> NDArray[np.float64]:
        """T = C^-1: coordinates of the moving joints from those of the drives, shape (n, n)."""
        return transmitting_of(self)

    def drive(self, name: str) -> Drive:
        """The drive of that name; raises KeyError."""
        return next((drive for drive in self.drives if drive.name == name), None) or _missing(name)

    def joint(self, name: str) -> Joint:
        """The joint of that name; raises KeyError."""
        return next((joint for joint in self.joints if joint.name == name), None) or _missing(name)

    def link(self, name: str) -> Link:
        """The link of that name; raises KeyError."""
        return next((link for link in self.links if link.name == name), None) or _missing(name)

    def sensor(self, channel: str) -> Sensor | None:
        """The sensor of a channel, where the description has one."""
        return next((sensor for sensor in self.sensors if sensor.channel == channel), None)

    def with_effects(self, *effects: EffectUse) -> Robot:
        """A copy with these effects added."""
        return self.model_copy(update={"effects": (*self.effects, *effects)})


def _missing(name: str) -> NoReturn:
    raise KeyError(name)

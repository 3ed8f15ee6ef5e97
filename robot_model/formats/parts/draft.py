"""A robot as read from a file of another format, before its fixed joints are merged and its gaps are filled.

Frames are those of `robot_model`: a link's frame sits at the joint that moves it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot_model.formats.parts.mass import Mass
from robot_model.formats.parts.notes import Notes
from robot_model.formats.parts.poses import IDENTITY, Pose, about, shifted

__all__ = ["Draft", "DraftJoint", "DraftLink", "DraftMotor", "DraftTransmission"]


@dataclass(frozen=True)
class DraftLink:
    """A body.

    Attributes:
        name: as in the file.
        where: file and line, for people.
        mass: in the link's frame; None where the file gives none.
        gap: a clause that states where and why its mass is not known; empty where it is known.
        marker: the gap does not matter where the link is fixed to one that has mass: it is only a frame.
        fault: a clause that states where and why its moments of inertia are impossible; empty if possible.
        corrected: the mass with the nearest possible moments of inertia; None where `mass` is.
        frame: of the file's body in the link's frame.
    """

    name: str
    where: str
    mass: Mass | None = None
    gap: str = ""
    marker: bool = False
    fault: str = ""
    corrected: Mass | None = None
    frame: Pose = IDENTITY

    @property
    def best(self) -> Mass | None:
        """Mass properties that a body can have."""
        return self.corrected or self.mass


@dataclass(frozen=True, eq=False)
class DraftJoint:
    """A joint; forces and inertias are at the joint, in SI units.

    Attributes:
        name: as in the file.
        where: file and line, for people.
        kind: ``revolute``, ``prismatic`` or ``fixed``.
        parent, child: names of links.
        pose: joint frame in the parent link's frame.
        axis: in the joint frame, shape (3,).
        limits: lower and upper position.
        top_speed, top_force: largest speed and actuator force.
        initial: position at time 0.
        damping, friction: viscous coefficient and Coulomb force.
        stiffness, rest: spring rate and the position in which the spring is slack.
        armature: rotor inertia at the joint side.
        gear_ratio: motor turns per joint turn.
        passive: nothing drives it.
    """

    name: str
    where: str
    kind: str
    parent: str
    child: str
    pose: Pose = IDENTITY
    axis: NDArray[np.float64] = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    limits: tuple[float, float] | None = None
    top_speed: float | None = None
    top_force: float | None = None
    initial: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    armature: float = 0.0
    gear_ratio: float = 1.0
    passive: bool = False

    def locked(self, position: float) -> DraftJoint:
        """The joint held at a position [rad or m]."""
        if self.kind == "fixed":
            return self
        axis = self.axis / np.linalg.norm(self.axis)
        if self.kind == "revolute":
            moved = Pose(np.zeros(3), about(axis, position)) if position else IDENTITY
        else:
            moved = shifted(axis * position)
        return replace(self, kind="fixed", pose=self.pose @ moved)


@dataclass(frozen=True)
class DraftMotor:
    """A motor of a transmission, behind its gear.

    Attributes:
        name: as in the file.
        tendon: by which it pulls, in an MJCF file.
        armature: rotor inertia.
        damping, friction: viscous coefficient and Coulomb force.
        stiffness, rest: spring rate and the position in which the spring is slack.
        top_force: largest force.
        gear_ratio: motor turns per turn behind the gear.
    """

    name: str
    tendon: str = ""
    armature: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    top_force: float | None = None
    gear_ratio: float = 1.0


@dataclass(frozen=True)
class DraftTransmission:
    """Motors that move several joints together.

    Attributes:
        joints: names, as in the file.
        motors: as many.
        matrix: motion of the motors from that of the joints, shape (k, k).
    """

    joints: tuple[str, ...]
    motors: tuple[DraftMotor, ...]
    matrix: NDArray[np.float64]


@dataclass(frozen=True)
class Draft:
    """A tree of links.

    Attributes:
        name: of the robot.
        root: the link that becomes the base.
        links: in the order of the file.
        joints: in the order of the file.
        base: ``fixed`` or ``free``.
        base_pose: of a base in the inertial frame.
        gravity: [m/s^2]; None where the file gives none.
        transmissions: motors that move several joints.
        notes: assumptions and omissions so far.
    """

    name: str
    root: str
    links: tuple[DraftLink, ...]
    joints: tuple[DraftJoint, ...]
    base: str = "fixed"
    base_pose: Pose = IDENTITY
    gravity: tuple[float, float, float] | None = None
    transmissions: tuple[DraftTransmission, ...] = ()
    notes: Notes = field(default_factory=Notes)

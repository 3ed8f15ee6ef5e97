"""Base motion: a base described as fixed is compliant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import casadi as ca
import numpy as np
from pydantic import ValidationError

from reference_model.effects.base import Parameter, Values
from reference_model.effects.body_force import BodySignals, ForceEffect
from reference_model.effects.structure import StructureEffect
from reference_model.kinematics.spatial import constant
from robot_model import Base, InputError, Robot

__all__ = ["BaseMotion"]

#: Starting compliances [m/N], from a bolted pedestal to a soft mount: resonances differ by a tenth.
COMPLIANCES = tuple(np.geomspace(1e-7, 1e-2, 58).tolist())
#: Starting arms relative to the robot's reach [-]: the turning stiffness relative to that of a displacement.
ARMS = (0.25, 0.5, 1.0)
#: Starting masses of what moves with the base, relative to the links [-].
LOADS = (0.1, 1.0)
#: Least and greatest mass of it, relative to the links [-]: a bare flange, and a load that the robot hardly
#: moves; and the least and greatest radius of gyration relative to the robot's reach [-].
LIGHTEST, HEAVIEST, NARROWEST, WIDEST = 0.01, 10.0, 0.03, 1.0
#: Least reach [m], of a robot with a single joint.
LEAST_REACH = 0.1


class BaseMotion(StructureEffect, ForceEffect):
    """The base moves on springs to the ground, equal in all directions, with damping.

    It starts at the described pose, where the mount is in static equilibrium. With a large compliance it
    floats. `mass` and `inertia`, about the base frame's origin, are the mount's load in addition to the
    described base. If the described base floats already, errors of its mass properties are an `inertia`
    effect at `base`.
    """

    id = "base_motion"
    title = "Compliant base"
    place = "base"
    parameters = (
        Parameter("compliance", "m/N", "displacement of the base per unit force", 0.0, 1e9, 1e-5, absent=0.0),
        Parameter("arm", "m", "turning stiffness is arm^2 / compliance", 1e-3, 100.0, 0.5, default=0.5),
        Parameter("damping", "s", "relaxation time of an unloaded spring", 0.0, 10.0, 1e-3, default=1e-3),
        Parameter("mass", "kg", "moving mass in addition to the described base", 0.0, 1e7, 50.0, default=0.0),
        Parameter(
            "inertia",
            "kg m^2",
            "its moment of inertia about each axis of the base's frame",
            0.0,
            1e8,
            10.0,
            default=0.0,
        ),
    )
    equation = (
        "F = -(r - r_0 + damping rd) / compliance and N = -arm^2 (sin(angle) axis + damping omega) / "
        "compliance about the base frame's origin"
    )
    source = "Dubowsky and Papadopoulos, IEEE Trans. Robotics and Automation 9 (1993) 531-543"
    signature = (
        "inertia at the joints that appears too small, more so at fast accelerations, and an oscillation "
        "in rate sensors on the base with the same frequency in all poses"
    )
    confused_with = ("inertia", "link_flexibility", "joint_elasticity", "slosh", "reaction_wheel")
    experiment = "put a rate sensor on the base; bolt it to something stiffer, or tap it with joints braked"
    carries_start = True
    adds_coordinates = True
    #: Feet are some decimetres apart; a mount that resonates at 10 Hz has a few percent of critical damping.
    priors: ClassVar[Mapping[str, tuple[float, float]]] = {"arm": (0.5, 0.5), "damping": (0.0, 3e-3)}
    weighs = ("mass", "inertia")
    essential = ("compliance",)

    def changed(self, robot: Robot, at: str, p: Mapping[str, float]) -> Robot:
        if not self.acts(p):
            return robot
        if robot.base.kind == "free":
            raise InputError(
                "the base is free already; its mass properties are changed by the effect 'inertia' at 'base'."
            )
        given = {**robot.base.model_dump(), "kind": "free", **_joined(robot.base, p["mass"], p["inertia"])}
        try:
            base = Base.model_validate(given)
        except ValidationError:
            raise InputError("the base that moves has no mass; give mass and inertia.") from None
        if not np.linalg.eigvalsh(base.inertia_matrix)[0] > 0:
            raise InputError("the base that moves has no moments of inertia; give inertia.")
        return robot.model_copy(update={"base": base})

    def acts(self, p: Mapping[str, float]) -> bool:
        return p["compliance"] != 0

    def wrench(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        moved, turned = _displacement(s)
        stiffness = 1 / p["compliance"]
        force = -stiffness * (moved + p["damping"] * s.velocity[:3])
        return ca.vertcat(force, -stiffness * p["arm"] ** 2 * (turned + p["damping"] * s.velocity[3:]))

    def stored(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        moved, _ = _displacement(s)
        cosine = (ca.trace(_relative(s)) - 1) / 2
        return (ca.sumsqr(moved) / 2 + p["arm"] ** 2 * (1 - cosine)) / p["compliance"]

    def power(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        speed = ca.sumsqr(s.velocity[:3]) + p["arm"] ** 2 * ca.sumsqr(s.velocity[3:])
        return -p["damping"] / p["compliance"] * speed

    def fastest(self, p: Mapping[str, float], mass: float) -> float:
        stiffness = 1 / p["compliance"]
        inertia = p["inertia"] or mass * p["arm"] ** 2
        return float(max(stiffness / mass, stiffness * p["arm"] ** 2 / inertia) ** 0.5)

    def limits(self, robot: Robot, at: str) -> Mapping[str, tuple[float, float]]:
        mass, reach = _size(robot)
        lightest = 0.0 if robot.base.mass > 0.0 else LIGHTEST * mass
        return {
            "mass": (lightest, HEAVIEST * mass),
            "inertia": (lightest * (NARROWEST * reach) ** 2, HEAVIEST * mass * (WIDEST * reach) ** 2),
        }

    def grid(self, robot: Robot) -> Sequence[Mapping[str, float]]:
        mass, reach = _size(robot)
        damping = self.parameter("damping").typical
        return tuple(
            {
                "compliance": compliance,
                "arm": arm * reach,
                "damping": damping,
                "mass": load * mass,
                "inertia": load * mass * reach**2 / 2,
            }
            for load in LOADS
            for arm in ARMS
            for compliance in COMPLIANCES
        )


def _size(robot: Robot) -> tuple[float, float]:
    """Mass of the links [kg], and a length that the stretched robot does not exceed [m]."""
    joints = sum(float(np.linalg.norm(joint.origin)) for joint in robot.joints)
    furthest = max((2.0 * float(np.linalg.norm(link.center_of_mass)) for link in robot.links), default=0.0)
    return sum(link.mass for link in robot.links), max(joints + furthest, LEAST_REACH)


def _relative(s: BodySignals) -> ca.SX:
    """Rotation of the present axes relative to the initial ones."""
    return constant(s.home_rotation).T @ s.rotation


def _displacement(s: BodySignals) -> tuple[ca.SX, ca.SX]:
    """Displacement, and sin(angle) times the rotation axis, since the start, both in present axes."""
    relative = _relative(s)
    odd = (relative - relative.T) / 2
    return s.rotation.T @ (s.position - constant(s.home)), ca.vertcat(odd[2, 1], odd[0, 2], odd[1, 0])


def _joined(base: Base, mass: float, inertia: float) -> dict[str, object]:
    """Mass properties of the base and of the mass that moves with it."""
    whole = base.mass + mass
    if not whole:
        return {}
    centre = np.asarray(base.center_of_mass, dtype=float)
    common = base.mass * centre / whole
    arms = [(base.mass, centre), (-whole, common)]
    central = base.inertia_matrix + inertia * np.eye(3)
    central = central + sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in arms)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return {
        "mass": whole,
        "center_of_mass": tuple(common.tolist()),
        "inertia": tuple(float(central[pair]) for pair in pairs),
    }

"""Contact: a point of a link runs against a wall."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from reference_model.effects.base import Extent, Parameter, Values
from reference_model.effects.body_force import BodySight, BodySignals, ForceEffect
from reference_model.effects.touching import walls

__all__ = ["Contact"]

AXES = ("x", "y", "z")

#: Exponent of the penetration in Hertz's force.
POWER = 1.5

#: Penetration up to which the contact's frequency is bounded [m].
DEEPEST = 0.01

#: Shortest normal that is accepted as a direction [-].
SHORTEST = 1e-9


class Contact(ForceEffect):
    """A frictionless plane, fixed in the inertial frame, that stops a point of the link.

    Hertz's force with the damping of Hunt and Crossley, which never pulls. Without damping no energy is
    lost; with it the coefficient of restitution is 1 - 2/3 damping v for small speeds v of approach. On a
    flexible link the node nearest to the point makes contact.
    """

    id = "contact"
    title = "Contact with a wall"
    place = "link"
    along_link = True
    is_beyond = True
    located = ("normal_x", "normal_y", "normal_z", "x", "y", "z")
    parameters = (
        Parameter(
            "stiffness", "N/m^1.5", "force per penetration^1.5", 0.0, 1e13, 1e6, absent=0.0, linear=True
        ),
        Parameter("offset", "m", "of the plane along its normal, from the inertial origin", -1e4, 1e4, 0.5),
        Parameter(
            "damping", "s/m", "fraction of the force per unit penetration speed", 0.0, 100.0, 0.2, default=0.0
        ),
        *(
            Parameter(
                f"normal_{axis}",
                "-",
                f"{axis} of the plane's normal, out of the wall, in the inertial frame",
                -1.0,
                1.0,
                1.0,
                estimated=False,
                default=1.0 if axis == "z" else 0.0,
            )
            for axis in AXES
        ),
        *(
            Parameter(
                axis,
                "m",
                f"{axis} of the point in the link's frame",
                -50.0,
                50.0,
                1.0,
                estimated=False,
                default=0.0,
            )
            for axis in AXES
        ),
    )
    equation = (
        "F = stiffness d^1.5 max(1 + damping dd/dt, 0) along n, d = max(offset - n.r, 0), r of the point"
    )
    source = "Hunt and Crossley, J. Applied Mechanics 42 (1975) 440-445"
    signature = (
        "a short burst in all torques, always at the same position of the point, and a step of the total "
        "momentum of base and arm, which nothing on board can cause"
    )
    confused_with = ("external_torque", "end_stop", "backlash", "coulomb_friction")
    experiment = "remove the object, or approach the place along another path; look at the base's momentum"
    essential = ("offset",)

    def contradiction(self, values: Mapping[str, float]) -> str:
        if max(abs(values[f"normal_{axis}"]) for axis in AXES) < SHORTEST:
            return "the normal has zero length"
        return ""

    def acts(self, p: Mapping[str, float]) -> bool:
        return p["stiffness"] != 0

    def point(self, p: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        return (p["x"], p["y"], p["z"])

    def wrench(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        depth, rate, normal = self._depth(s, p)
        push = self._hertz(p, depth) * ca.fmax(1 + p["damping"] * rate, 0)
        return ca.vertcat(s.rotation.T @ normal * push, ca.SX(3, 1))

    def stored(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        return p["stiffness"] * self._depth(s, p)[0] ** (POWER + 1.0) / (POWER + 1.0)

    def power(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        depth, rate, _ = self._depth(s, p)
        return -self._hertz(p, depth) * ca.fmax(p["damping"] * rate, -1) * rate

    def fastest(self, p: Mapping[str, float], mass: float) -> float:
        return float((1.5 * p["stiffness"] * DEEPEST**0.5 / mass) ** 0.5)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        typical = {name: self.parameter(name).typical for name in ("stiffness", "damping", "offset")}
        return (typical,)

    def starts_along(self, sight: BodySight) -> Sequence[tuple[float, Mapping[str, float]]]:
        return walls(sight, POWER)

    def _hertz(self, p: Values, depth: ca.SX) -> ca.SX:
        return p["stiffness"] * depth**POWER

    def _depth(self, s: BodySignals, p: Values) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Penetration d [m], its rate [m/s] and the unit normal."""
        normal = ca.SX(ca.vertcat(*(p[f"normal_{axis}"] for axis in AXES)))
        normal = normal / ca.norm_2(normal)
        rate = -ca.dot(normal, s.rotation @ s.velocity[:3])
        return ca.fmax(p["offset"] - ca.dot(normal, s.position), 0), rate, normal

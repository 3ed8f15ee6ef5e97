"""Backlash: play between the flanks of a gear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, GearEffect, GearSignals, Parameter, Values
from reference_model.effects.gear_spring import SPRING_STATED, damper, shared_stiffness

__all__ = ["Backlash"]

#: Depth of contact over which its damping sets in, relative to the half width, to avoid a jump.
SETTLING = 0.01
#: Keeps that depth above zero when there is no play [rad or m].
SHALLOWEST = 1e-12
#: Starting values of the half width [rad or m].
HALF_WIDTHS = (1e-4, 1e-3)


class Backlash(GearEffect):
    """T = K e + D dd in contact, e = d - sgn(d) w beyond the play and 0 within it; flanks never pull.

    e is continuous, so that T needs no events. The damping sets in over a hundredth of the half width; T is
    zero where damping would make separating flanks pull.
    """

    id = "backlash"
    title = "Backlash"
    parameters = (
        Parameter("half_width", "rad", "w, half of the play", 0.0, 1.0, 5e-4, absent=0.0),
        shared_stiffness("K, of the flanks in contact"),
        Parameter(
            "damping",
            "N m s/rad",
            f"D, of the flanks in contact; {SPRING_STATED}",
            0.0,
            1e7,
            10.0,
            absent=0.0,
            estimated=False,
            default=0.0,
        ),
    )
    equation = (
        "T = stiffness * e + damping * dd in contact, else 0, e = d - sgn(d) * min(|d|, half_width), "
        "d = th - q and the motor as in joint_elasticity, whose spring it uses where that is present"
    )
    source = (
        "Nordin and Gutman, Automatica 38 (2002) 1633-1649 (dead zone); "
        "no pulling flanks: Hunt and Crossley, ASME J. Appl. Mech. 42 (1975) 440-445"
    )
    signature = (
        "motor and joint encoders differ by a constant that changes its sign with the transmitted torque; "
        "impacts after reversals, a frequency that falls with the amplitude"
    )
    confused_with = ("gear_hysteresis", "lugre_friction", "coulomb_friction", "end_stop", "sensor_delay")
    experiment = "preload the joint to one side: backlash vanishes, friction and hysteresis do not"
    essential = ("half_width",)
    needs = ("motor_position",)

    def behind(self, s: GearSignals, p: Values) -> GearSignals:
        free = p["half_width"]
        depth = ca.fmax(s.twist - free, 0) - ca.fmax(-s.twist - free, 0)
        contact = ca.fmin(ca.fabs(depth) / (SETTLING * free + SHALLOWEST), 1)
        return GearSignals(depth, s.rate, contact)

    def elastic(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        return p["stiffness"] * s.twist

    def viscous(self, s: GearSignals, p: Values) -> ca.SX:
        return damper(s, p)

    def stored(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        return p["stiffness"] * s.twist**2 / 2

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return tuple({"half_width": width} for width in HALF_WIDTHS)

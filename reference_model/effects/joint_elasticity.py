"""Joint elasticity: wind-up of gear and shaft under the transmitted torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, GearSignals, Parameter, Values, YieldingGear
from reference_model.effects.gear_spring import DAMPING, STIFFNESS_RANGE, damper

__all__ = ["JointElasticity"]

#: Starting values: wind-up under the rms torque [rad or m]; gears are built for arc minutes.
WIND_UPS = (1e-4, 1e-3)
#: Newton steps to the twist; each reduces it to two thirds where the cubic part dominates, and squares the
#: error near the solution.
NEWTON = 6


class JointElasticity(YieldingGear):
    """T = K d + K3 d^3 + D dd, d the twist: motor position at the joint side minus joint position.

    The rotor has its own equation, B thdd = u - T with B = gear_ratio^2 rotor_inertia, and the joint gets T
    instead of u (Spong 1987: a rotor's kinetic energy is only that of its own spin).
    """

    id = "joint_elasticity"
    title = "Joint elasticity"
    parameters = (
        Parameter("stiffness", "N m/rad", "K, torque per unit twist", *STIFFNESS_RANGE, 2e4),
        Parameter(
            "cubic_stiffness",
            "N m/rad^3",
            "K3, hardening",
            0.0,
            1e15,
            1e8,
            absent=0.0,
            linear=True,
            default=0.0,
        ),
        DAMPING,
    )
    equation = (
        "T = stiffness * d + cubic_stiffness * d^3 + damping * dd, d = th - q, "
        "gear_ratio^2 * rotor_inertia * thdd = u - T, th = motor position at the joint side of the gear; "
        "T drives the joint instead of u"
    )
    source = (
        "Spong, ASME J. Dyn. Syst. Meas. Control 109 (1987) 310-319; De Luca and Book, in Springer Handbook "
        "of Robotics (2016), ch. 11; cubic part: Tuttle and Seering, IEEE Trans. Robot. Autom. 12 (1996) 368"
    )
    signature = (
        "motor and joint encoders differ in proportion to the transmitted torque; a resonance of the joint "
        "and an anti-resonance of the motor; with the motor's encoder alone, torque in proportion to the "
        "second derivative of the torque that the links require"
    )
    confused_with = ("sensor_delay", "sensor_gain", "link_flexibility", "gear_hysteresis", "actuator_lag")
    experiment = (
        "hold the output and ramp the torque: twist in proportion to torque; strain on the link follows a "
        "link's mode and not the joint's"
    )
    essential = ("stiffness",)
    needs = ("motor_position",)

    def twist(self, torque: ca.SX, rate: ca.SX, p: Values) -> ca.SX:
        found = (
            torque / p["stiffness"]
        )  # of a spring that does not harden; from there Newton's method descends
        for _ in range(NEWTON):
            held = self._spring(found, p)
            slope = p["stiffness"] + 3 * p["cubic_stiffness"] * found**2
            found = found - (held - torque) / slope
        slope = p["stiffness"] + 3 * p["cubic_stiffness"] * found**2
        return found - p["damping"] * rate / slope**2

    def _spring(self, twist: ca.SX, p: Values) -> ca.SX:
        return p["stiffness"] * twist + p["cubic_stiffness"] * twist**3

    def elastic(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        return self._spring(s.twist, p)

    def viscous(self, s: GearSignals, p: Values) -> ca.SX:
        return damper(s, p)

    def stored(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        return p["stiffness"] * s.twist**2 / 2 + p["cubic_stiffness"] * s.twist**4 / 4

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        stiffness = self.parameter("stiffness")
        found = (max(extent.torque, 1e-3) / wind_up for wind_up in WIND_UPS)
        return tuple({"stiffness": min(max(k, stiffness.lower), stiffness.upper)} for k in found)

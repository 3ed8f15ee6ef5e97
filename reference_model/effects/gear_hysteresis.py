"""Gear hysteresis: a twist that depends on the history of the torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, GearEffect, GearSignals, Parameter, Values
from reference_model.effects.gear_spring import SPRING_STATED, damper, shared_stiffness

__all__ = ["GearHysteresis"]

#: Starting values: friction inside the gear relative to the rms torque, and the travel [rad or m].
TORQUE_SHARE = 0.1
TRAVELS = (1e-5, 1e-4, 1e-3)


class GearHysteresis(GearEffect):
    """T = K d + T_h z + D dd, travel zd = dd - |dd| z: friction inside the gear, in parallel with its spring.

    It is Bouc and Wen's spring with exponent 1 and equal shape parameters, whose z is Dahl's. The loop of
    torque against twist is rate-independent, has the height 2 T_h and, for twists far beyond the travel, the
    area 4 T_h times the amplitude minus that of the corners. Just after a reversal the gear is stiffer,
    K + 2 T_h/travel. With T_h travel z^2 / 2 as energy the loss T_h |dd| z^2 is never negative.
    """

    id = "gear_hysteresis"
    title = "Gear hysteresis"
    states = 1
    parameters = (
        Parameter(
            "torque", "N m", "T_h, half the height of the loop", 0.0, 1e5, 2.0, absent=0.0, linear=True
        ),
        Parameter("travel", "rad", "twist over which the friction builds up", 1e-8, 1.0, 1e-4),
        shared_stiffness("K, torque per twist along the flanks of the loop"),
        Parameter(
            "damping",
            "N m s/rad",
            f"D, damping of the twist; {SPRING_STATED}",
            0.0,
            1e7,
            10.0,
            absent=0.0,
            estimated=False,
            default=0.0,
        ),
    )
    equation = (
        "T = stiffness * d + torque * z + damping * dd, travel * zd = dd - |dd| * z, "
        "d = th - q and the motor as in joint_elasticity, in parallel with whose spring it acts if present"
    )
    source = (
        "Wen, ASCE J. Eng. Mech. Div. 102 (1976) 249-263; Dahl, Aerospace Corp. TOR-0158(3107-18)-1 (1968); "
        "in elastic joints: Ruderman, Bertram, Iwasaki, Mechatronics 24 (2014) 407-415"
    )
    signature = (
        "twist against torque follows a loop that is open at zero torque (lost motion), the same at every "
        "speed; the gear is stiffer just after a reversal"
    )
    confused_with = ("joint_elasticity", "backlash", "lugre_friction", "sensor_delay")
    experiment = (
        "hold the output and run loops of several amplitudes at two speeds: the height stays constant, while "
        "with damping it grows with speed and with backlash it is zero"
    )
    essential = ("torque", "travel")
    needs = ("motor_position",)

    def elastic(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        return p["stiffness"] * s.twist + p["torque"] * z

    def viscous(self, s: GearSignals, p: Values) -> ca.SX:
        return damper(s, p)

    def stored(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        return p["stiffness"] * s.twist**2 / 2 + p["torque"] * p["travel"] * z**2 / 2

    def loss(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        return super().loss(s, p, z) + p["torque"] * ca.fabs(s.rate) * z**2

    def state_rate(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        return (s.rate - ca.fabs(s.rate) * z) / p["travel"]

    def first_loading(self, s: GearSignals, p: Values) -> ca.SX:
        return ca.sign(s.twist) * (1 - ca.exp(-ca.fabs(s.twist) / p["travel"]))

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        torque = min(max(TORQUE_SHARE * extent.torque, 1e-6), self.parameter("torque").upper)
        return tuple({"torque": torque, "travel": travel} for travel in TRAVELS)

"""End stop: an elastic stop that acts on the joint beyond a position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, JointEffect, JointSignals, Parameter, Values

__all__ = ["EndStop"]

#: Starting values: distance of the stop from the end of the travel, as a fraction of the travel.
DEPTHS = (0.01, 0.05, 0.2)


class EndStop(JointEffect):
    """T = -k max(q - q_s, 0) for an upper stop (side +1), T = k max(q_s - q, 0) for a lower one (side -1)."""

    id = "end_stop"
    title = "End stop"
    place = "joint"
    is_beyond = True
    parameters = (
        Parameter("stiffness", "N m/rad", "stiffness of the stop", 0.0, 1e8, 100.0, absent=0.0, linear=True),
        Parameter("position", "rad", "joint position at which contact begins", -1e3, 1e3, 1.0),
        Parameter(
            "side", "-", "+1 stops motion upwards, -1 downwards", -1.0, 1.0, 1.0, estimated=False, default=1.0
        ),
    )
    equation = "T = -side * stiffness * max(side * (q - position), 0)"
    source = "Johnson, Contact Mechanics (1985), linearised contact"
    signature = "a torque that appears only beyond one position and grows with the distance from it"
    confused_with = ("cable_spring", "backlash", "contact", "torque_saturation")
    experiment = "approach the same position slowly and stop short of it: the torque vanishes"
    needs = ("position",)

    def contradiction(self, values: Mapping[str, float]) -> str:
        side = values["side"]
        return "" if abs(side) == 1 else f"side = {side:g} is neither 1 (upwards) nor -1 (downwards)"

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return -p["side"] * p["stiffness"] * ca.fmax(p["side"] * (s.position - p["position"]), 0)

    def bounds(self, extent: Extent) -> Mapping[str, tuple[float, float]]:
        low, high = extent.position
        return {"position": (low, high)} if high > low else {}  # beyond the travel it does not act

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        low, high = extent.position
        depths = [depth * (high - low) for depth in DEPTHS]
        upper = [{"position": high - depth, "side": 1.0} for depth in depths]
        lower = [{"position": low + depth, "side": -1.0} for depth in depths]
        return (*upper, *lower)

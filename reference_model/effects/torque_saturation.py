"""Torque saturation: the actuator cannot deliver more than a limit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, JointEffect, JointSignals, Parameter, Values

__all__ = ["TorqueSaturation"]

#: Fraction of the limit over which the corner of the characteristic is rounded, for smooth derivatives. It
#: reduces the torque by ROUNDING * ln 2 = 0.35 % at the corner, less than the accuracy of torques.
ROUNDING = 0.005
#: Starting values, as multiples of the rms torque: up to the crest factor of a rest-to-rest motion.
RMS_MULTIPLES = (0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
#: A limit below this fraction of the rms torque would cut off nearly all torque.
LOWEST_PART = 0.1
#: A limit above this multiple of the largest torque shows in no other recording of the same robot either.
HIGHEST_PART = 2.0


def _excess(value: ca.SX, width: ca.SX | float) -> ca.SX:
    """max(value, 0) rounded over `width`: width log(1 + exp(value/width)), written so as not to overflow."""
    scaled = value / width
    return width * (ca.fmax(scaled, 0) + ca.log1p(ca.exp(-ca.fabs(scaled))))


class TorqueSaturation(JointEffect):
    """T = clip(u, -limit, limit) - u."""

    id = "torque_saturation"
    title = "Torque saturation"
    place = "actuator"
    parameters = (
        # A limit above every torque that occurs has no influence; the upper bound means no limit.
        Parameter("limit", "N m", "largest torque delivered", 1e-3, 1e6, 50.0, absent=1e6),
    )
    equation = "T = clip(u, -limit, limit) - u, u = actuator torque"
    source = (
        "Khalil H. K., Nonlinear Systems (2002), ch. 1 (saturation among the common nonlinearities); here "
        "the corner is rounded over 0.5 % of the limit"
    )
    signature = "the residual is zero except at the highest torques, where it cuts them flat"
    confused_with = ("torque_gain", "actuator_lag", "end_stop")
    experiment = "repeat the motion slower: below the limit the residual is gone"
    uses_torque = True
    cuts_torque = True
    needs = ("torque",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        width = ROUNDING * p["limit"]
        return _excess(-s.torque - p["limit"], width) - _excess(s.torque - p["limit"], width)

    def bounds(self, extent: Extent) -> Mapping[str, tuple[float, float]]:
        limit = self.parameter("limit")
        low = min(max(LOWEST_PART * extent.torque, limit.lower), limit.upper)
        return {"limit": (low, min(max(HIGHEST_PART * extent.peak_torque, low), limit.upper))}

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        limit = self.parameter("limit")
        found = [min(max(k * extent.torque, limit.lower), limit.upper) for k in RMS_MULTIPLES]
        return tuple({"limit": value} for value in found)

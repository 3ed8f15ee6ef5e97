"""Temperature-dependent friction: the friction law of a joint changes as it warms up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, JointEffect, JointSignals, Parameter, Values

__all__ = ["TemperatureDependentFriction"]

#: Starting values [1/K]: published greases lie between 0.01 (static) and 0.05 (viscous part).
RATE_STARTS = (0.01, 0.04)


class TemperatureDependentFriction(JointEffect):
    """T = friction (exp(-b (temperature - T0)) - 1): all friction laws of the joint, scaled together."""

    id = "temperature_dependent_friction"
    title = "Temperature-dependent friction"
    place = "joint"
    parameters = (
        Parameter("rate", "1/K", "relative decrease of friction per kelvin", -0.1, 0.2, 0.02, absent=0.0),
        Parameter(
            "reference_temperature",
            "K",
            "temperature at which the friction law holds as given",
            1.0,
            1000.0,
            293.15,
            estimated=False,
            default=293.15,
        ),
    )
    equation = "T = friction * (exp(-rate * (temperature - reference_temperature)) - 1)"
    source = "Simoni, Beschi, Legnani, Visioli, IROS 2015; Carvalho Bittencourt et al., IROS 2010"
    signature = "friction drifts over tens of minutes with the joint's temperature, most at high speed"
    confused_with = ("stribeck_friction", "load_dependent_friction", "torque_gain")
    experiment = "repeat the friction curve warmed by running, warmed by a heater, and cooled down again"
    is_modifier = True
    needs = ("temperature",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return s.friction * (ca.exp(-p["rate"] * (s.temperature - p["reference_temperature"])) - 1)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return tuple({"rate": rate} for rate in RATE_STARTS)

"""Encoder eccentricity: the disc is off centre, so the reading errs once per turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import Extent, Parameter, SensorEffect, SensorSignals, Values
from reference_model.effects.orders import order_parameter, order_starts

__all__ = ["EncoderEccentricity"]


class EncoderEccentricity(SensorEffect):
    """measured = q + a cos(k q) + b sin(k q); the amplitude is eccentricity over disc radius at k = 1."""

    id = "encoder_eccentricity"
    title = "Encoder eccentricity"
    parameters = (
        Parameter("cosine", "rad", "cosine part of the error", -0.1, 0.1, 1e-3, absent=0.0, linear=True),
        Parameter("sine", "rad", "sine part of the error", -0.1, 0.1, 1e-3, absent=0.0, linear=True),
        order_parameter(
            "phase of the cycle per joint position; 1 for an encoder at the joint, the gear ratio for one at "
            "the motor, twice that for an oval disc",
            default=1.0,
        ),
    )
    #: Discs are centred to some hundredths of a millimetre on radii of some centimetres: 1e-3 rad is two
    #: standard deviations.
    priors: ClassVar[Mapping[str, tuple[float, float]]] = {"cosine": (0.0, 5e-4), "sine": (0.0, 5e-4)}
    equation = "measured = q + cosine * cos(order * q) + sine * sin(order * q)"
    source = (
        "Lu, Graetz, Amin-Shahidi and Smeds, CIRP Annals 59 (2010) 529-534 (mounted angle encoders, by "
        "harmonics); at order 1 the amplitude is eccentricity over radius, 41 arcsec for 10 um at 50 mm"
    )
    signature = "position and velocity ripple once per turn of the encoder, at any speed, without a torque"
    confused_with = ("torque_ripple", "position_dependent_friction", "gravity", "sensor_gain")
    experiment = "a second reading head, or motor against joint encoder at slow speed; the angle error stays"
    needs = ("position",)

    def error(self, s: SensorSignals, p: Values) -> ca.SX:
        phase = p["order"] * s.value
        return p["cosine"] * ca.cos(phase) + p["sine"] * ca.sin(phase)

    def apply(
        self, time: NDArray[np.float64], values: NDArray[np.float64], p: Mapping[str, float]
    ) -> NDArray[np.float64]:
        phase = p["order"] * values
        return values + p["cosine"] * np.cos(phase) + p["sine"] * np.sin(phase)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return order_starts(extent, self.parameter("order"))

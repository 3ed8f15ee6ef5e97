"""The temperature of a joint, and its influence on the joint's friction, as data."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot_model.input.fields import Description, Number, Positive

__all__ = ["ConstantTemperature", "SelfHeating", "TemperatureTable", "Thermal"]

#: No lubricant has a larger temperature dependence [1/K].
STEEPEST = 1.0

#: No friction changes by more over the temperatures of a joint: grease stiffens some thousand times. Factors
#: far beyond would round to zero or overflow.
LARGEST_FACTOR = 1e6


class ConstantTemperature(Description):
    """The joint keeps one temperature."""

    kind: Literal["constant"] = "constant"
    value: Positive = Field(description="temperature [K]")

    @property
    def given(self) -> tuple[float, ...]:
        """The temperatures that it states [K]."""
        return (self.value,)


class TemperatureTable(Description):
    """A temperature profile, linear between its instants and constant beyond them."""

    kind: Literal["table"] = "table"
    times: tuple[Number, ...] = Field(min_length=2, description="instants, rising [s]")
    values: tuple[Positive, ...] = Field(min_length=2, description="temperatures [K]")

    @model_validator(mode="after")
    def _fit(self) -> TemperatureTable:
        if len(self.times) != len(self.values):
            raise ValueError(
                f"times has {len(self.times)} entries and values has {len(self.values)}; give one each"
            )
        for before, after in zip(self.times, self.times[1:]):
            if after <= before:
                raise ValueError(f"times must rise, but {after:g} s follows {before:g} s")
        return self

    @property
    def given(self) -> tuple[float, ...]:
        """The temperatures that it states [K]."""
        return self.values


class SelfHeating(Description):
    """One heat capacity, heated by friction and cooled by its surroundings.

    C dT/dt = P - (T - T_ambient)/R, with P = -T_friction qd the power dissipated by the joint's friction.
    """

    kind: Literal["self_heating"] = "self_heating"
    ambient: Positive = Field(description="temperature of the surroundings [K]")
    initial: Positive | None = Field(
        default=None, description="temperature at time 0; that of the surroundings when left out [K]"
    )
    capacity: Positive = Field(description="heat capacity, C [J/K]")
    resistance: Positive = Field(description="thermal resistance to the surroundings, R [K/W]")

    @property
    def given(self) -> tuple[float, ...]:
        """The temperatures that it states [K]."""
        return (self.ambient, self.ambient if self.initial is None else self.initial)


class Thermal(Description):
    """The joint's temperature T and the temperature dependence of its friction.

    Static friction is multiplied by exp(-static_rate (T - T0)), kinetic friction (Coulomb, viscous, loads,
    position and direction) by exp(-kinetic_rate (T - T0)), T0 being the reference temperature at which
    friction equals that of its effects. A factor of 5 over 150 K is a rate of ln(5)/150 = 0.0107 1/K.
    """

    reference: Positive = Field(
        default=293.15, description="temperature at which friction is as given, T0 [K]"
    )
    static_rate: Number = Field(
        default=0.0, description="relative decrease of static friction per kelvin [1/K]"
    )
    kinetic_rate: Number = Field(
        default=0.0, description="relative decrease of kinetic friction per kelvin [1/K]"
    )
    temperature: Annotated[
        ConstantTemperature | TemperatureTable | SelfHeating, Field(discriminator="kind")
    ] = Field(description="the joint's temperature")

    @model_validator(mode="after")
    def _credible(self) -> Thermal:
        for key in ("static_rate", "kinetic_rate"):
            rate = getattr(self, key)
            if abs(rate) > STEEPEST:
                raise ValueError(
                    f"{key} is {rate:g} 1/K, a factor of e in {1 / abs(rate):.2g} K; give one between "
                    f"{-STEEPEST:g} and {STEEPEST:g}"
                )
            for value in self.temperature.given:
                exponent = rate * (value - self.reference)
                if abs(exponent) > math.log(LARGEST_FACTOR):
                    way = "fall" if exponent > 0 else "rise"
                    raise ValueError(
                        f"{key} of {rate:g} 1/K makes friction {way} more than {LARGEST_FACTOR:.0e} times "
                        f"from {self.reference:g} to {value:g} K; correct the rate or the temperature, which "
                        "is in kelvin"
                    )
        return self

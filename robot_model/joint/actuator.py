"""The actuator of a joint: a motor and its gear."""

from __future__ import annotations

from pydantic import Field

from robot_model.input.fields import Description, NonNegative, Positive

__all__ = ["Actuator"]


class Actuator(Description):
    """Motor and gear of a joint. Values are at the joint side unless marked as motor side."""

    gear_ratio: Positive = Field(default=1.0, description="motor turns per joint turn (or rad per m) [-]")
    rotor_inertia: NonNegative = Field(default=0.0, description="rotor inertia, motor side [kg m^2]")
    torque_constant: Positive | None = Field(default=None, description="motor torque per current [N m/A]")
    resistance: Positive | None = Field(default=None, description="winding resistance [ohm]")
    torque_limit: Positive | None = Field(default=None, description="largest torque at the joint [N m or N]")
    coulomb_friction: NonNegative = Field(
        default=0.0, description="of motor and gear input, at the joint; acts on the motor [N m or N]"
    )
    viscous_friction: NonNegative = Field(
        default=0.0, description="the same in proportion to the speed [N m s/rad or N s/m]"
    )

    @property
    def reflected_inertia(self) -> float:
        """Rotor inertia behind the gear, gear_ratio^2 rotor_inertia [kg m^2 or kg]."""
        return self.gear_ratio**2 * self.rotor_inertia

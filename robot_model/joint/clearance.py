"""The clearance of a journal in its bearing, as data."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_model.input.fields import Description, NonNegative, Positive

__all__ = ["Clearance"]

#: The energy after an impact scales with its square; the law is derived for values near one.
Restitution = Annotated[float, Field(strict=True, gt=0, le=1, allow_inf_nan=False)]


class Clearance(Description):
    """Radial clearance of a revolute joint: the child's journal moves in the parent's bearing, across the
    axis.

    With the eccentricity (x, y) of the journal, delta = sqrt(x^2 + y^2) - clearance is the penetration.
    The normal force is that of Lankarani and Nikravesh (ASME J. Mech. Design 112 (1990) 369-376),
    K delta^1.5 (1 + 3/4 (1 - restitution^2) delta_rate/approach), never pulling, with the `approach` speed at
    which the present contact began; Coulomb friction is `friction` times the normal force, smoothed over
    `transition` of the sliding speed at the surface of the journal. Along the axis and in bending the joint
    stays ideal. Its channels are `JOINT_clearance_x.position` and `JOINT_clearance_y.position`.
    """

    radial: Positive = Field(description="bearing radius minus journal radius [m]")
    journal_radius: Positive = Field(description="radius of the journal [m]")
    stiffness: Positive = Field(description="contact stiffness, K [N/m^1.5]")
    restitution: Restitution = Field(description="coefficient of restitution, above 0 and at most 1 [-]")
    friction: NonNegative = Field(default=0.0, description="coefficient of Coulomb friction [-]")
    transition: Positive = Field(
        default=1e-3, description="sliding speed over which friction changes its sign [m/s]"
    )

    @model_validator(mode="after")
    def _is_play(self) -> Clearance:
        if self.radial >= self.journal_radius:
            raise ValueError(
                f"radial is {self.radial:g} m, no less than the journal's radius of "
                f"{self.journal_radius:g} m; give both in metres, the clearance far below the radius"
            )
        return self

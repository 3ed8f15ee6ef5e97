"""Controllers and reference motions, as data; each engine implements them separately."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot_model.controllers.base import Sampled
from robot_model.controllers.nonlinear import AdaptiveNetwork, SlidingMode
from robot_model.input.fields import Description, Flag, Gains, NonNegative, Number, Positive

__all__ = [
    "AdaptiveNetwork",
    "ComputedTorque",
    "Controller",
    "Cycloid",
    "Hold",
    "JointPD",
    "JointReference",
    "MultiSine",
    "NoController",
    "Quintic",
    "Reference",
    "SlidingMode",
    "Table",
    "VoltageServo",
]


class NoController(Description):
    """No actuator torque at all."""

    kind: Literal["none"] = "none"


class _Feedforward(Sampled):
    """Feed-forward terms of joint controllers, and their sample time."""

    coulomb_feedforward: Gains = Field(
        default=0.0, description="friction torque added along the reference velocity [N m or N]"
    )
    load_feedforward: Gains = Field(
        default=0.0,
        description="friction coefficient; times the nominal load of the `bearing`, added likewise [-]",
    )


class JointPD(_Feedforward):
    """Joint PD with optional integral action: u = kp (r - q) + ki int(r - q) + kd (rd - qd) [+ gravity]."""

    kind: Literal["pd"] = "pd"
    kp: Gains = Field(description="proportional gain, one number or one per moving joint [N m/rad or N/m]")
    kd: Gains = Field(default=0.0, description="derivative gain [N m s/rad or N s/m]")
    ki: Gains = Field(default=0.0, description="integral gain [N m/(rad s) or N/(m s)]")
    gravity_feedforward: Flag = Field(default=False, description="add the nominal static gravity torque")


class ComputedTorque(_Feedforward):
    """Computed torque with the nominal model: u = Z(q) (rdd + kd ed + kp e) - z(q, qd).

    e = r - q and ed = rd - qd. The rigid model treats flexible links as undeformed rigid bodies of the same
    mass; the full one measures modal coordinates and rates and eliminates the modal accelerations. For a
    free base, attitude and velocities are measured, and its accelerations are eliminated: no force acts on
    it. With `base_kp` an unlimited wrench on the base holds it at its initial pose: position and attitude
    obey the same law with their own gains, the attitude error being twice the vector part of the return
    quaternion.
    """

    kind: Literal["computed_torque"] = "computed_torque"
    model: Literal["rigid", "full"] = Field(
        default="rigid", description="whether the controller knows the flexible links' deformation"
    )
    kp: Gains = Field(description="position gain, one number or one per moving joint [1/s^2]")
    kd: Gains = Field(description="velocity gain [1/s]")
    base_kp: Positive | None = Field(
        default=None, description="holds a free base by a wrench: gain of position and attitude [1/s^2]"
    )
    base_kd: NonNegative = Field(default=0.0, description="gain of the held base's velocities [1/s]")

    @model_validator(mode="after")
    def _base_gains_together(self) -> ComputedTorque:
        if self.base_kp is None and self.base_kd > 0:
            raise ValueError("base_kd without base_kp does nothing; give base_kp too, or remove base_kd")
        return self


class VoltageServo(Sampled):
    """A hobby servo: winding voltage = clip(gain (r - q), +-1) * supply, with the motor's back-EMF."""

    kind: Literal["voltage_servo"] = "voltage_servo"
    gain: Gains = Field(description="duty cycle per position error [1/rad]")
    supply: Positive = Field(description="supply voltage [V]")


Controller = Annotated[
    NoController | JointPD | ComputedTorque | SlidingMode | AdaptiveNetwork | VoltageServo,
    Field(discriminator="kind"),
]


class _JointPart(Description):
    joint: str = Field(description="the moving joint")


class Hold(_JointPart):
    """Stay at the initial position."""

    kind: Literal["hold"] = "hold"


class Cycloid(_JointPart):
    """th0 + D (s - sin(2 pi s)/(2 pi)), s = (t - start)/duration: rest to rest."""

    kind: Literal["cycloid"] = "cycloid"
    displacement: Number = Field(description="D [rad or m]")
    start: NonNegative = Field(default=0.0, description="when it begins [s]")
    duration: Positive = Field(description="how long it takes [s]")


class Quintic(_JointPart):
    """th0 + D (10 s^3 - 15 s^4 + 6 s^5), s = (t - start)/duration: rest to rest."""

    kind: Literal["quintic"] = "quintic"
    displacement: Number = Field(description="D [rad or m]")
    start: NonNegative = Field(default=0.0, description="when it begins [s]")
    duration: Positive = Field(description="how long it takes [s]")


class MultiSine(_JointPart):
    """th0 + w(t) sum_k A_k sin(2 pi f_k t + phi_k); w rises smoothly from 0 to 1 over `ramp`.

    w = 10 s^3 - 15 s^4 + 6 s^5 with s = t/ramp up to s = 1.
    """

    kind: Literal["multisine"] = "multisine"
    amplitudes: tuple[Number, ...] = Field(min_length=1, description="A_k [rad or m]")
    frequencies: tuple[Number, ...] = Field(min_length=1, description="f_k [Hz]")
    phases: tuple[Number, ...] = Field(default=(), description="phi_k, zero when left out [rad]")
    ramp: NonNegative = Field(default=1.0, description="time over which the motion fades in [s]")

    @model_validator(mode="after")
    def _same_length(self) -> MultiSine:
        if len(self.frequencies) != len(self.amplitudes):
            raise ValueError(
                f"{len(self.amplitudes)} amplitudes need as many frequencies, not {len(self.frequencies)}"
            )
        if self.phases and len(self.phases) != len(self.amplitudes):
            raise ValueError(f"{len(self.amplitudes)} amplitudes need as many phases, not {len(self.phases)}")
        return self


class Table(_JointPart):
    """A table of positions, interpolated by a spline (not-a-knot); held at the ends."""

    kind: Literal["table"] = "table"
    times: tuple[Number, ...] = Field(min_length=4, description="instants, rising [s]")
    positions: tuple[Number, ...] = Field(min_length=4, description="positions [rad or m]")
    degree: Literal[3, 5] = Field(
        default=3,
        description="of the spline: 3 has a continuous acceleration, 5 (six instants or more) also "
        "continuous third and fourth derivatives",
    )

    @model_validator(mode="after")
    def _rising(self) -> Table:
        if len(self.times) != len(self.positions):
            raise ValueError(f"{len(self.times)} times need as many positions, not {len(self.positions)}")
        if len(self.times) <= self.degree:
            raise ValueError(
                f"a spline of degree {self.degree} needs {self.degree + 1} instants, not {len(self.times)}"
            )
        for before, after in zip(self.times, self.times[1:]):
            if after <= before:
                raise ValueError(f"times must rise, but {before:.9g} s is followed by {after:.9g} s")
        return self


JointReference = Annotated[Hold | Cycloid | Quintic | MultiSine | Table, Field(discriminator="kind")]


#: Above this a recording of all channels no longer fits into memory; one of the two keys must be wrong.
MOST_SAMPLES = 50_000_000


class Reference(Description):
    """The reference motion and how a simulation of it is sampled."""

    duration: Positive = Field(description="length of the simulation [s]")
    sample_rate: Positive = Field(default=1000.0, description="samples per second of the recording [Hz]")
    joints: tuple[JointReference, ...] = Field(default=(), description="one motion per joint; others hold")

    @model_validator(mode="after")
    def _fits_memory(self) -> Reference:
        if self.duration * self.sample_rate > MOST_SAMPLES:
            raise ValueError(
                f"duration {self.duration:g} s at sample_rate {self.sample_rate:g} Hz makes more than "
                f"{MOST_SAMPLES:,} samples"
            )
        return self

"""Controllers and reference motions, as data; each engine carries them out by itself."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

__all__ = [
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
    "Table",
    "VoltageServo",
]

Gains = float | tuple[float, ...]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class NoController(_Part):
    """No actuator torque at all."""

    kind: Literal["none"] = "none"


class JointPD(_Part):
    """Joint PD with optional integral action: u = kp (r - q) + ki int(r - q) + kd (rd - qd) [+ gravity]."""

    kind: Literal["pd"] = "pd"
    kp: Gains = Field(description="proportional gain, one number or one per moving joint [N m/rad or N/m]")
    kd: Gains = Field(0.0, description="derivative gain [N m s/rad or N s/m]")
    ki: Gains = Field(0.0, description="integral gain [N m/(rad s) or N/(m s)]")
    gravity_feedforward: bool = Field(False, description="add the nominal static gravity torque")
    sample_time: float = Field(0.0, ge=0, description="zero-order hold of the output; 0 is continuous [s]")


class ComputedTorque(_Part):
    """Computed torque with the nominal rigid model: u = Z(q) (rdd + kd ed + kp e) - z(q, qd).

    On a free base the reduced form is used: base accelerations are eliminated (model.md 8.3).
    """

    kind: Literal["computed_torque"] = "computed_torque"
    kp: Gains = Field(description="position gain, one number or one per moving joint [1/s^2]")
    kd: Gains = Field(description="velocity gain [1/s]")
    sample_time: float = Field(0.0, ge=0, description="zero-order hold of the output; 0 is continuous [s]")


class VoltageServo(_Part):
    """A hobby servo: winding voltage = clip(gain (r - q), +-1) * supply; the motor's back-EMF acts."""

    kind: Literal["voltage_servo"] = "voltage_servo"
    gain: Gains = Field(description="duty cycle per position error [1/rad]")
    supply: float = Field(gt=0, description="supply voltage [V]")
    sample_time: float = Field(0.0, ge=0, description="zero-order hold of the output; 0 is continuous [s]")


Controller = Annotated[
    NoController | JointPD | ComputedTorque | VoltageServo, Field(discriminator="kind")
]


class _JointPart(_Part):
    joint: str = Field(description="the moving joint")


class Hold(_JointPart):
    """Stay at the initial position."""

    kind: Literal["hold"] = "hold"


class Cycloid(_JointPart):
    """th0 + D (s - sin(2 pi s)/(2 pi)), s = (t - start)/duration: rest to rest."""

    kind: Literal["cycloid"] = "cycloid"
    displacement: float = Field(description="D [rad or m]")
    start: float = Field(0.0, ge=0, description="when it begins [s]")
    duration: float = Field(gt=0, description="how long it takes [s]")


class Quintic(_JointPart):
    """th0 + D (10 s^3 - 15 s^4 + 6 s^5), s = (t - start)/duration: rest to rest."""

    kind: Literal["quintic"] = "quintic"
    displacement: float = Field(description="D [rad or m]")
    start: float = Field(0.0, ge=0, description="when it begins [s]")
    duration: float = Field(gt=0, description="how long it takes [s]")


class MultiSine(_JointPart):
    """th0 + w(t) sum_k A_k sin(2 pi f_k t + phi_k); w rises smoothly from 0 to 1 over `ramp`.

    w = 10 s^3 - 15 s^4 + 6 s^5 with s = t/ramp up to s = 1.
    """

    kind: Literal["multisine"] = "multisine"
    amplitudes: tuple[float, ...] = Field(min_length=1, description="A_k [rad or m]")
    frequencies: tuple[float, ...] = Field(min_length=1, description="f_k [Hz]")
    phases: tuple[float, ...] = Field((), description="phi_k, zero when left out [rad]")
    ramp: float = Field(1.0, ge=0, description="time over which the motion fades in [s]")

    @model_validator(mode="after")
    def _same_length(self) -> MultiSine:
        if len(self.frequencies) != len(self.amplitudes):
            raise ValueError("amplitudes and frequencies differ in number")
        if self.phases and len(self.phases) != len(self.amplitudes):
            raise ValueError("phases and amplitudes differ in number")
        return self


class Table(_JointPart):
    """A table of positions, interpolated by a cubic spline (not-a-knot); held at the ends."""

    kind: Literal["table"] = "table"
    times: tuple[float, ...] = Field(min_length=4, description="instants, rising [s]")
    positions: tuple[float, ...] = Field(min_length=4, description="positions [rad or m]")

    @model_validator(mode="after")
    def _rising(self) -> Table:
        if len(self.times) != len(self.positions):
            raise ValueError("times and positions differ in number")
        if any(b <= a for a, b in zip(self.times, self.times[1:])):
            raise ValueError("times must rise")
        return self


JointReference = Annotated[
    Hold | Cycloid | Quintic | MultiSine | Table, Field(discriminator="kind")
]


class Reference(_Part):
    """The reference motion and how a simulation of it is sampled."""

    duration: float = Field(gt=0, description="length of the simulation [s]")
    sample_rate: float = Field(1000.0, gt=0, description="samples per second of the recording [Hz]")
    joints: tuple[JointReference, ...] = Field((), description="one motion per joint; others hold")

"""Motion and torque of the drives, from a recording interpreted by a robot file.

A drive is a directly actuated joint, or a motor of a transmission. Sensor errors listed in the file are
corrected.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque, is_passive
from missing_physics.evaluation.band import Band, low_passed, thinned
from missing_physics.evaluation.held import as_held
from missing_physics.evaluation.sensors import without_error
from missing_physics.evaluation.sliding import directions, shares, slides
from missing_physics.recordings import noise_of, sensor_of
from reference_model.effects.base import GearEffect, SensorEffect
from reference_model.effects.catalogue import used_effects
from reference_model.plant.acting import AMBIENT_TEMPERATURE
from robot_model import Drive, InputError, Recording, Robot

__all__ = ["SIGN_UNCERTAINTY", "SLOWEST", "JointMotion"]

Array = NDArray[np.float64]

#: A gap of more than this many sampling times ends a stretch that can be filtered.
LONGEST_GAP = 10.0
#: Fewest samples in such a stretch.
FEWEST_SAMPLES = 50
#: A position whose sensor is late is interpolated between its samples, where a monotone cubic has kinks in
#: its acceleration; with this many instants per sample the kinks are below the resolution of encoders.
DENSER = 8
#: tanh(v / (1.25 s)) is within 2 % of the mean sign of a velocity that is known with standard deviation s.
SIGN_UNCERTAINTY = 1.25
#: Slowest speed whose sign is known, as a fraction of the largest one.
SLOWEST = 2e-4


@dataclass(frozen=True)
class JointMotion:
    """Motion and torque of n drives on a uniform clock.

    Attributes:
        time: [s], shape (N,).
        position, velocity, acceleration: of the joints [rad or m, and per s, s^2], shape (N, n).
        motor: position, velocity and acceleration of the motors, at the joint side of their gears, for gears
            with effects; otherwise those of the joints.
        behind: joints with a gear effect and only a motor encoder, so that `position`, `velocity` and
            `acceleration` are the motor's.
        torque: of the actuators at the joints, at the time it took effect [N m or N], shape (N, n); NaN if
            not known, zero if nothing drives the joint.
        temperature: of the joints [K], shape (N, n).
        base_rates: as measured by gyros on the base [rad/s], shape (N, 3); NaN columns for axes without one.
        sign_speed: speed below which the sign of a velocity is not known, shape (n,).
        band: of the smoothing.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    motor: tuple[Array, Array, Array]
    behind: tuple[int, ...]
    torque: Array
    temperature: Array
    base_rates: Array
    sign_speed: Array
    band: Band

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return float(1.0 / (self.time[1] - self.time[0]))

    @cached_property
    def slides(self) -> NDArray[np.bool_]:
        """Samples in which the direction of each joint's friction is known, shape (N, n)."""
        return self._slides(self.velocity, self.acceleration)

    @cached_property
    def shares(self) -> Array:
        """Weight of each sample in the comparison at each joint, 0 to 1, shape (N, n)."""
        slides = self.slides
        return shares(slides, np.array(self.band.rest or [0.0] * slides.shape[1]))

    @cached_property
    def direction(self) -> Array:
        """Direction of each joint's friction, -1 to 1, shape (N, n)."""
        return directions(self.velocity, self.slides)

    @cached_property
    def motor_direction(self) -> Array:
        """Direction of the friction of each motor behind a gear with effects, else of its joint, (N, n)."""
        _, velocity, acceleration = self.motor
        return directions(velocity, self._slides(velocity, acceleration))

    def _slides(self, velocity: Array, acceleration: Array) -> NDArray[np.bool_]:
        noise, memory = self.sign_speed / SIGN_UNCERTAINTY, 0.5 / self.band.motion
        return slides(velocity, acceleration, noise, memory=memory, step=1.0 / self.rate)

    @classmethod
    def of(cls, robot: Robot, recording: Recording, band: Band) -> JointMotion:
        """The motion of `robot` in `recording`.

        Raises:
            InputError: the position of a joint is not recorded, or too few samples are.
        """
        reader = _Reader(robot, recording, band)
        joints, motors = reader.moved("joint"), reader.moved("motor")
        torque = np.column_stack([reader.torque(joint, k) for k, joint in enumerate(robot.drives)])
        stride = 1  # flexible links respond beyond the band
        if not robot.flexible_links:
            torque, stride = thinned(torque, rate=reader.rate, smoothing=band.motion)
        speed = np.abs(joints[1]).max(axis=0, initial=0.0)
        known = np.maximum(SIGN_UNCERTAINTY * reader.velocity_noise(), SLOWEST * speed)
        temperature = np.column_stack([reader.temperature(joint.name) for joint in robot.drives])
        rates, known = reader.base_rates(), np.maximum(known, 1e-9)
        at = slice(None, None, stride)
        joint, motor = ((p[at], v[at], a[at]) for p, v, a in (joints, motors))
        return cls(
            reader.time[at], *joint, motor, reader.behind, torque[at], temperature[at], rates[at], known, band
        )


class _Reader:
    """Channels of one recording on a uniform clock, corrected for sensor errors."""

    def __init__(self, robot: Robot, recording: Recording, band: Band) -> None:
        self.robot, self.recording, self.band = robot, recording, band
        effects = used_effects(robot)
        self._geared = {used.at for used in effects if isinstance(used.effect, GearEffect)}
        self._errors = [used for used in effects if isinstance(used.effect, SensorEffect)]
        self._encoders = {
            end: [self._encoder(joint, end) for joint in robot.drives] for end in ("joint", "motor")
        }
        self.time = self._clock({*self._encoders["joint"], *self._encoders["motor"], *self._drives()})
        self.rate = float(1.0 / (self.time[1] - self.time[0]))

    @property
    def behind(self) -> tuple[int, ...]:
        """Joints behind gears with effects that have only a motor encoder."""
        channels = self._encoders["joint"]
        joints = enumerate(self.robot.drives)
        return tuple(
            k for k, j in joints if j.name in self._geared and channels[k].endswith("motor_position")
        )

    def moved(self, end: str) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of the joints or of the motors, shape (N, n) each."""
        position = np.column_stack([self._position(channel) for channel in self._encoders[end]])
        spline = make_interp_spline(self.time, position, k=5)
        return position, spline(self.time, 1), spline(self.time, 2)

    def torque(self, joint: Drive, k: int) -> Array:
        """Torque of a joint's actuator at the time it took effect, shape (N,)."""
        channel, factor = actuator_torque(self.robot, self.recording, joint.name)
        if channel is None:
            passive = is_passive(self.robot, self.recording, joint.name)
            return np.full(self.time.size, 0.0 if passive else np.nan)
        found = factor * self._true(self._values(channel), channel)
        if channel.endswith(".voltage"):
            motor = joint.actuator
            assert motor is not None
            assert motor.torque_constant is not None
            assert motor.resistance is not None
            damping = (motor.gear_ratio * motor.torque_constant) ** 2 / motor.resistance  # back-EMF
            found = found - damping * self.moved("motor")[1][:, k]
        return as_held(found, self.time, self.robot, self.recording, channel)

    def temperature(self, joint: str) -> Array:
        channel = f"{joint}.temperature"
        if channel not in self.recording or not np.isfinite(self.recording[channel]).any():
            return np.full(self.time.size, AMBIENT_TEMPERATURE)
        return self._true(self._values(channel), channel)

    def base_rates(self) -> Array:
        """Angular velocity measured by gyros on the base, shape (N, 3)."""
        found = np.full((self.time.size, 3), np.nan)
        for k, axis in enumerate("xyz"):
            channel = f"base.angular_velocity.{axis}"
            if channel in self.recording and np.isfinite(self.recording[channel]).sum() >= FEWEST_SAMPLES:
                found[:, k] = self._true(self._values(channel), channel)
        return found

    def velocity_noise(self) -> Array:
        """Standard deviation of the smoothed velocities due to encoder noise, shape (n,).

        For white noise below a cut-off f: the integral of (2 pi f)^2 times its density.
        """
        found = []
        for channel in self._encoders["joint"]:
            sensor = sensor_of(self.robot, self.recording, channel)
            if sensor is not None:
                white, rounded = sensor.noise, sensor.resolution
            else:
                white = noise_of(self.recording, channel)
                rounded = self.recording.resolution.get(channel, 0.0)
            found.append(float(np.hypot(white, rounded / 12**0.5)))
        cutoff = self.band.motion
        return np.array(found) * np.sqrt(2.0 / self.rate * (2 * np.pi) ** 2 * cutoff**3 / 3.0)

    def _encoder(self, joint: Drive, end: str) -> str:
        """The position channel of a joint or of its motor."""
        both = [f"{joint.name}.motor_position", f"{joint.name}.position"]
        if joint.name in self._geared and end == "joint":
            both.reverse()
        for channel in both:
            if channel in self.recording:
                return channel
        raise InputError(
            f"{self.recording.source or 'the recording'} has neither {both[1]} nor {both[0]}, so that the "
            f"motion of {joint.name} is not known; record one of them, or name its source with --map."
        )

    def _drives(self) -> list[str]:
        found = (actuator_torque(self.robot, self.recording, d.name)[0] for d in self.robot.drives)
        return [channel for channel in found if channel is not None]

    def _clock(self, channels: set[str]) -> Array:
        """Uniform instants over the longest stretch in which no channel of `channels` has a long gap."""
        time, name = self.recording.time, self.recording.source or "the recording"
        recorded = {c: time[np.isfinite(self.recording[c])] for c in channels}
        if min(instants.size for instants in recorded.values()) < FEWEST_SAMPLES:
            scarce = min(recorded, key=lambda c: recorded[c].size)
            raise InputError(f"{name}: {scarce} holds fewer than {FEWEST_SAMPLES} numbers.")
        fastest = max(recorded.values(), key=len)
        ends = max(t[0] for t in recorded.values()), min(t[-1] for t in recorded.values())
        kept = fastest[(fastest >= ends[0]) & (fastest <= ends[1])]
        for instants in recorded.values():
            kept = kept[_covered(kept, instants)]
        stretch = _longest_stretch(kept)
        if stretch.size < FEWEST_SAMPLES:
            raise InputError(f"{name} has fewer than {FEWEST_SAMPLES} samples in a row.")
        count = round((stretch[-1] - stretch[0]) / float(np.median(np.diff(stretch)))) + 1
        return np.linspace(stretch[0], stretch[-1], count)

    def _values(self, channel: str) -> Array:
        """A channel at the instants of the clock, shape (N,)."""
        good = np.isfinite(self.recording[channel])
        time, values = self.recording.time[good], self.recording[channel][good]
        step = self.time[1] - self.time[0]
        first = int(np.searchsorted(time, self.time[0] - 0.5 * step))
        same = time[first : first + self.time.size]
        if same.size == self.time.size and np.abs(same - self.time).max() < 1e-3 * step:
            return np.array(values[first : first + self.time.size])
        return np.asarray(make_interp_spline(time, values, k=3)(np.clip(self.time, time[0], time[-1])))

    def _position(self, channel: str) -> Array:
        """The true position, smooth enough to be differentiated twice, shape (N,)."""
        smooth = low_passed(self._values(channel), rate=self.rate, cutoff=self.band.motion)
        if not any(used.at == channel for used in self._errors):
            return smooth
        dense = np.linspace(self.time[0], self.time[-1], DENSER * (self.time.size - 1) + 1)
        return self._true(make_interp_spline(self.time, smooth, k=5)(dense), channel, dense)[::DENSER]

    def _true(self, measured: Array, channel: str, time: Array | None = None) -> Array:
        """A channel corrected for the sensor errors that the robot file lists."""
        found, instants = measured, self.time if time is None else time
        for used in reversed([used for used in self._errors if used.at == channel]):
            found = without_error(instants, found, used)
        return found


def _covered(time: Array, recorded: Array) -> NDArray[np.bool_]:
    """Mask of the instants between recorded values without a gap relative to the channel's sampling time."""
    after = np.clip(np.searchsorted(recorded, time), 1, recorded.size - 1)
    steps = np.diff(recorded)
    return np.asarray(steps[after - 1] <= LONGEST_GAP * float(np.median(steps)))


def _longest_stretch(time: Array) -> Array:
    """The longest run of instants without a gap."""
    steps = np.diff(time)
    if not steps.size:
        return time
    cuts = np.flatnonzero(steps > LONGEST_GAP * float(np.median(steps))) + 1
    return max(np.split(time, cuts), key=len)

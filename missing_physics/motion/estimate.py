"""The joint motion and the actuator torque of a recording.

The motion is estimated by a zero-phase low-pass filter and a quintic spline, whose derivatives are velocity
and acceleration. Everything that is compared later, measured or computed, passes through the same filter, so
that the filter causes no bias (parallel filtering; Gautier, "Dynamic identification of robots with power
model", ICRA 1997).

The cut-off follows from the data: below it, position noise differentiated twice accounts for little of the
recorded torque.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque, is_passive
from missing_physics.checks.clocks import FEWEST_SAMPLES, Clock
from missing_physics.evaluation.held import as_held
from missing_physics.evaluation.joint_motion import SIGN_UNCERTAINTY, SLOWEST
from missing_physics.motion.low_pass import LowPass
from missing_physics.standard.band import HIGHEST, LOWEST, WIDER, WIDEST, position_channel, velocity_noise_of
from robot_model import Recording, Robot

__all__ = ["Motion", "estimate_motion"]

Array = NDArray[np.float64]

#: The smoother of the motion is wider only as far as velocity noise stays below this fraction of the largest
#: speed.
SIGN_KNOWN = 2e-3
#: Position noise may account for this fraction of a joint's rms torque.
NOISE_PART = 1e-2


@dataclass(frozen=True)
class Motion:
    """Joint motion and torque in one part of a recording, on a uniform grid.

    Attributes:
        source: name of the recording.
        time: [s], shape (N,), uniform.
        position, velocity, acceleration: smoothed, joint side, shape (N, n).
        torque: actuator torque at the joint at the time it took effect, not smoothed, shape (N, n); NaN
            columns where unknown, zero where nothing drives the joint.
        temperature: joint temperature [K], shape (N, n); NaN where unknown.
        position_noise: standard deviation of white position noise per sample, shape (n,).
        torque_noise: the same of torque, shape (n,).
        low_pass: the filter through which measured and computed torques are compared.
        motion_cutoff: cut-off of the smoother of the motion itself, higher than that of `low_pass` [Hz].
        raw_position: recorded position, resampled, shape (N, n).
        position_channels: the channel of each joint's position.
        others: further recorded channels on the same grid.
        left_out: which part of the recording is not used and why, as a clause; empty if all is used.
        drive: like `torque`, but without subtracting the back-EMF if it follows from a voltage.
    """

    source: str
    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    temperature: Array
    position_noise: Array
    torque_noise: Array
    low_pass: LowPass
    motion_cutoff: float
    raw_position: Array
    position_channels: tuple[str, ...]
    others: Mapping[str, Array] = field(default_factory=dict)
    left_out: str = ""
    drive: Array | None = None

    @property
    def velocity_noise(self) -> Array:
        """Standard deviation of the smoothed velocity due to position noise, shape (n,)."""
        return velocity_noise_of(self.position_noise, self.low_pass.rate, self.motion_cutoff)

    @property
    def transition(self) -> Array:
        """Speed below which the sign of the smoothed velocity is not known [rad/s or m/s], shape (n,)."""
        least = np.maximum(SLOWEST * np.abs(self.velocity).max(axis=0), 1e-9)
        return np.maximum(SIGN_UNCERTAINTY * self.velocity_noise, least)

    def moved(self, more: Array) -> Motion:
        """The motion with a change of the recorded positions, shape (N, n), smoothed in the same way."""
        smooth = LowPass(self.low_pass.rate, self.motion_cutoff).smooth(more)
        position, velocity, acceleration = _derivatives(self.time, smooth)
        return replace(
            self,
            position=self.position + position,
            velocity=self.velocity + velocity,
            acceleration=self.acceleration + acceleration,
        )

    @property
    def kept(self) -> slice:
        """Samples that `LowPass.reduce` keeps."""
        return self.low_pass.kept(self.time.size)

    @property
    def reduced_time(self) -> Array:
        """Times of these samples [s]."""
        return self.time[self.kept]


def estimate_motion(
    robot: Robot,
    recording: Recording,
    *,
    inertia: Array,
    noise: Mapping[str, float],
    cutoff: float | None = None,
) -> Motion:
    """The motion of all moving joints and the torque of their actuators.

    Args:
        robot: the nominal robot; names the channels.
        recording: must hold `JOINT.position` or `JOINT.motor_position` of every moving joint.
        inertia: typical effective inertia of each joint [kg m^2 or kg], shape (n,); only sets the cut-off.
        noise: standard deviation of white noise by channel, in its unit.
        cutoff: of the filter [Hz]; found from the data when None.

    Raises:
        InputError: a joint's position is absent, or too few samples.
    """
    names = [joint.name for joint in robot.moving_joints]
    channels = [position_channel(robot, recording, name) for name in names]
    sources = [actuator_torque(robot, recording, name)[0] for name in names]
    core = [*channels, *(source for source in sources if source)]
    clock = Clock.of(recording, core)
    time, rate, slowest = clock.time, clock.rate, clock.slowest(core)
    raw = np.column_stack([clock.values(channel) for channel in channels])
    torque = np.column_stack([_torque(robot, clock, name) for name in names])
    position_noise = np.array([clock.spread(c) * _noise_of(recording, noise, c) for c in channels])
    torque_noise = np.array(
        [
            clock.spread(source or "") * _noise_of(recording, noise, f"{name}.torque")
            for name, source in zip(names, sources)
        ]
    )
    highest = HIGHEST * slowest
    chosen = cutoff
    if chosen is None:
        chosen = _cutoff(time, torque, raw, inertia, position_noise, highest=highest)
    chosen = chosen if slowest == rate else min(chosen, highest)
    low_pass = LowPass(rate, chosen)
    widest = WIDEST * clock.slowest(channels)
    smoothing = _motion_cutoff(rate, chosen, raw, position_noise, widest=widest)
    position, velocity, acceleration = _derivatives(time, LowPass(rate, smoothing).smooth(raw))
    temperature = np.column_stack([clock.values(f"{name}.temperature", absent=np.nan) for name in names])
    drive = _held(robot, recording, time, torque, sources)
    torque = _held(robot, recording, time, _with_back_emf(robot, recording, torque, velocity), sources)
    others = [
        channel
        for channel in recording
        if channel not in channels and np.isfinite(recording[channel]).sum() >= FEWEST_SAMPLES
    ]
    return Motion(
        source=recording.source,
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        torque=torque,
        temperature=temperature,
        position_noise=position_noise,
        torque_noise=torque_noise,
        low_pass=low_pass,
        motion_cutoff=smoothing,
        raw_position=raw,
        position_channels=tuple(channels),
        others={channel: clock.values(channel) for channel in others},
        left_out=clock.left_out,
        drive=drive,
    )


def _torque(robot: Robot, clock: Clock, name: str) -> Array:
    channel, scale = actuator_torque(robot, clock.recording, name)
    if channel is None:
        return np.full(clock.time.size, 0.0 if is_passive(robot, clock.recording, name) else np.nan)
    return scale * clock.values(channel)


def _with_back_emf(robot: Robot, recording: Recording, torque: Array, velocity: Array) -> Array:
    """Torque with the contribution of the back-EMF subtracted where it was computed from a voltage."""
    result = torque.copy()
    for column, joint in enumerate(robot.moving_joints):
        channel, _ = actuator_torque(robot, recording, joint.name)
        if channel is not None and channel.endswith(".voltage"):
            motor = joint.actuator
            assert motor is not None
            assert motor.torque_constant is not None
            assert motor.resistance is not None
            damping = (motor.gear_ratio * motor.torque_constant) ** 2 / motor.resistance
            result[:, column] -= damping * velocity[:, column]
    return result


def _held(
    robot: Robot, recording: Recording, time: Array, torque: Array, sources: Sequence[str | None]
) -> Array:
    """Torques at the time at which they took effect, shape (N, n), recorded in the channels `sources`."""
    columns = zip(torque.T, sources)
    return np.column_stack([as_held(one, time, robot, recording, source) for one, source in columns])


def _noise_of(recording: Recording, noise: Mapping[str, float], channel: str) -> float:
    """White noise per sample, including the uniform error of rounding to the resolution."""
    sigma = noise.get(channel, recording.noise.get(channel, 0.0))
    return float(np.hypot(sigma, recording.resolution.get(channel, 0.0) / np.sqrt(12.0)))


def _cutoff(
    time: Array,
    torque: Array,
    raw: Array,
    inertia: Array,
    position_noise: Array,
    *,
    highest: float,
) -> float:
    """Frequency below which twice-differentiated position noise is a small part of every joint's torque [Hz].

    White noise of density S causes a torque of variance J^2 (2 pi)^4 S f^5 / 5 below f at an inertia J.
    """
    rate = float(1.0 / (time[1] - time[0]))
    slow = LowPass(rate, min(LOWEST, highest)).smooth(raw)
    chosen = highest
    for column in range(torque.shape[1]):
        series = torque[:, column]
        if not np.isfinite(series).all() or not position_noise[column]:
            continue
        if not series.any():  # undriven: use the inertial torque of its motion instead
            series = inertia[column] * _derivatives(time, slow[:, column])[2]
        allowed = (NOISE_PART * float(np.sqrt(np.mean(series**2)))) ** 2
        density = (inertia[column] * (2 * np.pi) ** 2 * position_noise[column]) ** 2 * 2.0 / rate
        chosen = min(chosen, float((5.0 * allowed / density) ** 0.2))
    return float(np.clip(chosen, min(LOWEST, highest), highest))


def _motion_cutoff(
    rate: float,
    cutoff: float,
    raw: Array,
    position_noise: Array,
    *,
    widest: float,
) -> float:
    """Cut-off of the motion's smoother: as high as the sign of the velocity allows [Hz].

    Reversals of a joint are faster than the band of its torque. A wider smoother preserves them; the noise
    that it passes is removed again by the filter that all torques pass.
    """
    speed = np.abs(np.gradient(LowPass(rate, cutoff).smooth(raw), axis=0)).max(axis=0) * rate
    noise = velocity_noise_of(position_noise, rate, 1.0)  # which grows as the power 3/2 of the cut-off
    known = [(SIGN_KNOWN * v / own) ** (2 / 3) for v, own in zip(speed, noise) if own > 0.0]
    return max(min(WIDER * cutoff, widest, *known), cutoff)


def _derivatives(time: Array, values: Array) -> tuple[Array, Array, Array]:
    spline = make_interp_spline(time, values, k=5)
    return values, spline(time, 1), spline(time, 2)

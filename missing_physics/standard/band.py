"""Motion and torque of a recording in the band in which a rigid model can be compared with it.

Following common practice (Gautier, "Dynamic identification of robots with power model", ICRA 1997; Janot,
Vandanjon, Gautier, IEEE Trans. Control Systems Technology 22 (2014)): positions pass a zero-phase low-pass
filter and are then differentiated. Everything that is compared, measured or computed, passes one narrower
zero-phase filter, and only as many samples are kept as the band requires.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque, is_passive
from missing_physics.checks.clocks import Clock
from missing_physics.evaluation.band import SPOILED_PERIODS, low_passed, thinned
from missing_physics.evaluation.held import as_held
from missing_physics.evaluation.sliding import cells, directions, shares, slides, undetermined
from missing_physics.evaluation.steps import unsteadiness
from missing_physics.recordings import noise_of, sensor_of
from missing_physics.recordings.channels.estimates import resolution_of
from robot_model import InputError, Recording, Robot

__all__ = [
    "HIGHEST",
    "LOWEST",
    "SAMPLES_PER_PERIOD",
    "SIGN_KNOWN",
    "SLOWEST",
    "WIDER",
    "WIDEST",
    "BandMotion",
    "band_motion",
    "motion_band",
    "position_channel",
    "velocity_noise_of",
]

Array = NDArray[np.float64]

#: The band ends at this multiple of the motion's bandwidth (Gautier 1997: two to five times).
BAND = 5.0
#: Fraction of the position's energy about its mean below the motion's bandwidth; encoder noise affects it
#: less than the energy of a derivative.
ENERGY = 0.999
#: Highest end of the band as a fraction of the sampling rate; above, interpolation and sub-sample delays
#: matter.
HIGHEST = 0.08
#: Lowest end of the band [Hz]: any robot's motion contains this frequency.
LOWEST = 2.0
#: The position filter is wider than the band by this factor, so that it does not affect the comparison.
WIDER = 5.0
#: Its largest cut-off as a fraction of the sampling rate.
WIDEST = 0.25
#: Samples kept per period of the band's end.
SAMPLES_PER_PERIOD = 4
#: tanh(v / (1.25 s)) is within 2 % of the expected sign of a speed v known to a standard deviation s.
SIGN_KNOWN = 1.25
#: A joint slides at speeds above this fraction of the robot's largest one, and above three times the speed's
#: noise; below, stiction leaves its torque undetermined. A joint whose range of motion is below this fraction
#: of the widest one is held while others move: it only yields with its gear and controller.
SLOWEST = 1e-2


@dataclass(frozen=True)
class BandMotion:
    """One recording on a uniform clock before the band's filter, at the rate that its smoothed motion needs.

    Attributes:
        source: name of the recording.
        time: [s], shape (N,).
        position, velocity, acceleration: of the moving joints, smoothed, shape (N, n).
        torque: of the actuators at the joints, below two fifths of the rate, shape (N, n) [N m or N]; NaN
            columns where not recorded, zero where nothing drives the joint.
        unsteady: standard deviation in the band of the torque's error due to sampling and quantisation,
            beyond white noise (`missing_physics.evaluation.steps`), shape (N, n) [N m or N].
        rounding: rms of the quantisation error alone, shape (n,).
        velocity_noise: standard deviation of the smoothed velocity, shape (n,).
        torque_noise: standard deviation of white torque noise per recorded sample, shape (n,).
        cutoff: end of the band [Hz].
        smoothing: cut-off of the position filter [Hz].
        sampling: sampling rate of the recording [Hz].
        reversals: whether samples near quick reversals are compared, too.
    """

    source: str
    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    unsteady: Array
    rounding: Array
    velocity_noise: Array
    torque_noise: Array
    cutoff: float
    smoothing: float
    sampling: float
    reversals: bool = False

    @property
    def rate(self) -> float:
        """Samples per second [Hz], at most the sampling rate."""
        return float(1.0 / (self.time[1] - self.time[0]))

    @property
    def transition(self) -> Array:
        """Speed below which the direction of motion is not known [rad/s or m/s], shape (n,)."""
        return np.maximum(SIGN_KNOWN * self.velocity_noise, 1e-9)

    @property
    def position_density(self) -> Array:
        """One-sided spectral density of the noise of positions, shape (n,) [rad^2/Hz or m^2/Hz]."""
        return self.velocity_noise**2 / ((2.0 * np.pi) ** 2 * self.smoothing**3 / 3.0)

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Samples in which the direction of each joint's friction is known, shape (N, n)."""
        state = self.velocity, self.acceleration, self.velocity_noise
        return slides(*state, memory=self.memory, step=1.0 / self.rate)

    @property
    def direction(self) -> Array:
        """Direction of each joint's friction, -1 to 1, shape (N, n)."""
        return directions(self.velocity, ~self.unknown if self.reversals else self.slides)

    @cached_property
    def unknown(self) -> NDArray[np.bool_]:
        """Samples in which the direction of each joint's motion is not known, shape (N, n)."""
        state = self.velocity, self.acceleration, self.velocity_noise
        return undetermined(*state, memory=self.memory, step=1.0 / self.rate)

    @cached_property
    def parts(self) -> tuple[tuple[NDArray[np.bool_], list[slice]], ...]:
        """For each joint the samples near stops, shape (N,), and the cells of its quick reversals.

        A stop lasts longer than half a period of the band's end. A cell is as long as the filter's memory.
        """
        speed = np.abs(self.velocity)
        slow = self.unknown | (speed <= SLOWEST * speed.max(axis=0))
        near = ~self.slides | slow
        longest, size = round(0.5 * self.rate / self.cutoff), max(1, round(self.memory * self.rate))
        return tuple(cells(*own, longest=longest, size=size) for own in zip(self.unknown.T, slow.T, near.T))

    def in_cells(self, k: int) -> Array:
        """A force of one in each cell of joint k's reversals, smoothed, shape (N, V)."""
        found = np.zeros((self.time.size, len(self.parts[k][1])))
        for column, cell in enumerate(self.parts[k][1]):
            found[cell, column] = 1.0
        return self.smooth(found) if found.size else found

    @property
    def memory(self) -> float:
        """Time over which the position filter spreads an instant [s]."""
        return 0.5 / self.smoothing

    def smooth(self, values: Array) -> Array:
        """Apply the position filter along the first axis."""
        return low_passed(values, rate=self.rate, cutoff=self.smoothing)

    @cached_property
    def smooth_torque(self) -> Array:
        """Torque after the position filter, shape (N, n); NaN columns where not recorded."""
        known = np.isfinite(self.torque).all(axis=0)
        return np.where(known, self.smooth(np.where(known, self.torque, 0.0)), np.nan)

    @property
    def kept(self) -> slice:
        """Samples that are kept of a filtered series."""
        stride = max(1, int(self.rate / (SAMPLES_PER_PERIOD * self.cutoff)))
        edge = int(SPOILED_PERIODS * self.rate / self.cutoff)
        return slice(edge, max(edge, self.time.size - edge), stride)

    def reduce(self, values: Array) -> Array:
        """Filter along the first axis and keep as many samples as the band requires, shape (K, ...)."""
        return low_passed(values, rate=self.rate, cutoff=self.cutoff)[self.kept]

    def shares(self, prismatic: NDArray[np.bool_], rest: Array) -> Array:
        """Weight of every sample at each joint, 0 to 1, shape (N, n): one where it slides fast enough.

        With `reversals` it is one except near stops.

        Args:
            prismatic: mask of prismatic joints, shape (n,): speeds are compared within each kind.
            rest: weight of the other samples, shape (n,); zero for a joint held while others move.
        """
        speed, width = np.abs(self.velocity), self.position.std(axis=0)
        least = np.zeros(speed.shape[1])
        for kind in (prismatic, ~prismatic):
            if kind.any():
                least[kind] = SLOWEST * float(speed[:, kind].max())
                least[kind & (width < SLOWEST * float(width[kind].max()))] = np.inf
        moves, known = np.isfinite(least), self.slides & (speed > least)
        if self.reversals:
            known = ~np.column_stack([stopped for stopped, _ in self.parts]) & moves
        return shares(known, np.where(moves, rest, 0.0))

    def steadiness(self, residual: Array) -> Array:
        """Weight of every torque sample, 0 to 1, shape (N, n): usual variance over the variance of its error.

        Args:
            residual: rms residual of a fit in the band, shape (n,) [N m or N].
        """
        usual = np.maximum(residual, np.sqrt(np.mean(self.unsteady**2, axis=0)))
        above = self.unsteady > usual
        return np.where(above, (usual / np.where(above, self.unsteady, 1.0)) ** 2, 1.0)


def position_channel(robot: Robot, recording: Recording, joint: str) -> str:
    """The position channel on the motor's side: the motor's encoder, else the joint's.

    Raises:
        InputError: neither is recorded.
    """
    for quantity in ("motor_position", "position"):
        if f"{joint}.{quantity}" in recording:
            return f"{joint}.{quantity}"
    raise InputError(
        f"{recording.source or 'the recording'} has neither {joint}.position nor {joint}.motor_position; "
        f"robot '{robot.name}' moves that joint (name its source in a map file, --map)."
    )


def motion_band(robot: Robot, recording: Recording) -> float:
    """End of the band in which this recording's motion lies [Hz]."""
    clock = _clock(robot, recording)
    highest = HIGHEST * clock.rate
    found: dict[str, list[tuple[float, float]]] = {}
    for joint in robot.drives:
        position = clock.values(position_channel(robot, recording, joint.name))
        end = _energy_below(position, clock.rate)
        found.setdefault(joint.kind, []).append((float(np.std(position)), end))
    ends = []
    for joints in found.values():
        widest = max(width for width, _ in joints)
        ends += [end for width, end in joints if width > SLOWEST * widest and end > 0.0]
    return float(np.clip(BAND * max(ends, default=highest), min(LOWEST, highest), highest))


def band_motion(
    robot: Robot, recording: Recording, cutoff: float, smoothing: float | None = None
) -> BandMotion:
    """The joints' motion and the actuators' torque for comparison below `cutoff` [Hz].

    Args:
        robot, recording: the positions of all moving joints must be recorded.
        cutoff: end of the band [Hz].
        smoothing: cut-off of the position filter [Hz]; `WIDER` times `cutoff` when None.

    Raises:
        InputError: the position of a moving joint is not recorded, or too few samples.
    """
    clock = _clock(robot, recording)
    joints = [drive.name for drive in robot.drives]
    channels = [position_channel(robot, recording, joint) for joint in joints]
    wide = min(WIDER * cutoff if smoothing is None else smoothing, WIDEST * clock.rate)
    smooth = low_passed(
        np.column_stack([clock.values(channel) for channel in channels]), rate=clock.rate, cutoff=wide
    )
    spline = make_interp_spline(clock.time, smooth, k=5)
    velocity = np.asarray(spline(clock.time, 1))
    spread = np.array([_noise(robot, recording, channel) for channel in channels])
    torques = [_torque(robot, recording, clock, joint, velocity[:, k]) for k, joint in enumerate(joints)]
    torque = np.column_stack([torque for torque, _ in torques])
    noise = np.array([sigma for _, sigma in torques])
    steps = np.array([_step(robot, recording, joint) for joint in joints])
    jumps, rounding = unsteadiness(torque, noise, steps, rate=clock.rate, cutoff=cutoff, smoothing=wide)
    sources = [actuator_torque(robot, recording, joint)[0] for joint in joints]
    held = [as_held(one, clock.time, robot, recording, source) for one, source in zip(torque.T, sources)]
    torque, stride = thinned(np.column_stack(held), rate=clock.rate, smoothing=wide)
    return BandMotion(
        source=recording.source,
        time=clock.time[::stride],
        position=smooth[::stride],
        velocity=velocity[::stride],
        acceleration=np.asarray(spline(clock.time[::stride], 2)),
        torque=torque[::stride],
        unsteady=np.hypot(jumps, rounding)[::stride],
        rounding=np.sqrt(np.mean(rounding**2, axis=0)),
        velocity_noise=velocity_noise_of(spread, clock.rate, wide),
        torque_noise=noise,
        cutoff=cutoff,
        smoothing=wide,
        sampling=clock.rate,
    )


def _clock(robot: Robot, recording: Recording) -> Clock:
    joints = [drive.name for drive in robot.drives]
    sources = [actuator_torque(robot, recording, joint)[0] for joint in joints]
    positions = [position_channel(robot, recording, joint) for joint in joints]
    return Clock.of(recording, [*positions, *(source for source in sources if source)])


def _noise(robot: Robot, recording: Recording, channel: str) -> float:
    """White noise of a channel: what the recording states, else the robot's sensors, else an estimate."""
    sensor = sensor_of(robot, recording, channel)
    if sensor is None:
        return noise_of(recording, channel)
    return float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12.0)))


def _torque(
    robot: Robot, recording: Recording, clock: Clock, joint: str, velocity: Array
) -> tuple[Array, float]:
    """Torque at the joint [N m or N], shape (N,), and its white noise per sample."""
    channel, factor = actuator_torque(robot, recording, joint)
    if channel is None:
        nothing = 0.0 if is_passive(robot, recording, joint) else np.nan
        return np.full(clock.time.size, nothing), 0.0
    torque = factor * clock.values(channel)
    if channel.endswith(".voltage"):  # less the back-EMF
        motor = robot.drive(joint).actuator
        assert motor is not None
        assert motor.torque_constant is not None
        assert motor.resistance is not None
        torque = torque - (motor.gear_ratio * motor.torque_constant) ** 2 / motor.resistance * velocity
    return torque, abs(factor) * _noise(robot, recording, channel)


def _step(robot: Robot, recording: Recording, joint: str) -> float:
    """Resolution of the recorded torque of a joint, stated or visible, else 0 [N m or N]."""
    channel, factor = actuator_torque(robot, recording, joint)
    if channel is None:
        return 0.0
    sensor = sensor_of(robot, recording, channel)
    step = resolution_of(recording, channel) if sensor is None else sensor.resolution
    return abs(factor) * step


def velocity_noise_of(position_noise: Array, rate: float, cutoff: float) -> Array:
    """rms velocity due to white position noise below `cutoff`: integral of (2 pi f)^2 times its density."""
    return np.asarray(position_noise * np.sqrt(2.0 / rate * (2 * np.pi) ** 2 * cutoff**3 / 3.0))


def _energy_below(position: Array, rate: float) -> float:
    """Frequency below which the fraction `ENERGY` of the position's energy lies [Hz]; 0 at rest."""
    window = np.hanning(position.size)
    energy = np.cumsum(np.abs(np.fft.rfft((position - position.mean()) * window)) ** 2)
    if energy[-1] <= 0.0:
        return 0.0
    return float(np.searchsorted(energy, ENERGY * energy[-1]) * rate / position.size)

"""Recordings in the band of the motion, with everything that effects depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.evaluation.stops import NEAR, Stops, through_stops
from missing_physics.standard import StandardModel
from missing_physics.standard.band import BandMotion, band_motion
from missing_physics.standard.prediction import (
    ROOM_TEMPERATURE,
    Along,
    inertial_with_effects,
    torque_of_effects,
)
from missing_physics.standard.rows import FRICTION, Rows, rows_of, without_friction
from reference_model.effects.base import JointSignals
from reference_model.evaluation.drive_model import drive_model
from reference_model.evaluation.model import RobotModel
from robot_model import Recording

__all__ = ["Beyond", "Run", "directed", "run_about", "runs_of"]

Array = NDArray[np.float64]

#: No friction is smaller [N m or N].
SMALLEST = 1e-12


@dataclass(frozen=True)
class Run:
    """One recording; N samples, K rows of the band, n joints.

    Attributes:
        model: of the robot without friction.
        along: its dynamics along the recorded motion.
        rows: what is compared.
        torque: recorded ones less what the robot's other effects take, as they were before the delays in
            `numbers`, in the band, shape (K, n).
        acting: recorded torques at full rate, as they were before the delays, shape (N, n); zero where none
            is recorded.
        velocity: of the joints as friction bends it, shape (N, n).
        direction: of each joint's friction, -1 to 1, shape (N, n): that of its motion, and near rest what the
            torque says.
        dry: dry friction that the torque says near rest [N m or N], shape (N, n); NaN elsewhere.
        force: on each joint of the effects that were taken off that, shape (N, n) [N m or N].
        beyond: at which joints there were any, shape (n,).
        numbers: of the standard model by which it says so, shape (X,).
        friction: of the standard model at each joint, as a force on it, shape (N, n) [N m or N].
        needed: torque by the standard model, shape (N, n).
        channels: recorded channels.
        temperature: of the joints [K], shape (N, n).
    """

    model: RobotModel
    along: Along
    rows: Rows
    torque: Array
    acting: Array
    velocity: Array
    direction: Array
    dry: Array
    force: Array
    beyond: NDArray[np.bool_]
    numbers: Array
    friction: Array
    needed: Array
    channels: frozenset[str]
    temperature: Array

    @property
    def motion(self) -> BandMotion:
        """Of the joints, at full rate."""
        return self.along.motion

    def reduce(self, values: Array) -> Array:
        """Into the band."""
        return self.motion.reduce(values)

    @cached_property
    def loads(self) -> Array:
        """Bearing loads, shape (N, n, 4)."""
        return self.along.loads()

    def moved(self, k: int, series: Array) -> Array:
        """Torques more that it takes to move joint k by C small series more, (N, C); shape (N, n, C)."""
        spline = make_interp_spline(self.motion.time, series, k=5)
        bent = series, spline(self.motion.time, 1), spline(self.motion.time, 2)
        parts = (matrix[:, :, k, None] * one[:, None, :] for matrix, one in zip(self._jacobians, bent))
        return np.asarray(sum(parts))

    @property
    def delays(self) -> Array:
        """By how much torques are recorded late in `numbers` [s], shape (n,)."""
        joints = len(self.model.joints)
        return _delays(self.numbers[len(self.model.inertial_names) + joints * len(FRICTION) :], joints)

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Joints of which a torque was recorded that is not zero throughout, shape (n,)."""
        return np.asarray(self.rows.measured.any(axis=0))

    @property
    def coulomb(self) -> Array:
        """Torque that the standard model's dry friction takes, shape (N, n)."""
        return -self.friction - self._viscous * self.motion.velocity

    @property
    def _viscous(self) -> Array:
        first, joints = len(self.model.inertial_names), len(self.model.joints)
        return self.numbers[first : first + joints * len(FRICTION)].reshape(joints, -1)[:, 0]

    @cached_property
    def mass(self) -> Array:
        """Mass matrix of the joints, rotors included, as of a base that is held, shape (N, n, n)."""
        joints = len(self.model.joints)
        matrix = self.model.mass_matrix(
            self.motion.position, base=self.along.base, inner=self.along.inner, inertial=self.along.inertial
        )
        start = self.model.tree.offset
        return np.asarray(matrix[:, start : start + joints, start : start + joints])

    def sliding(self, k: int, numbers: Array) -> Array:
        """Torque of joint k near rest but for dry friction, where `dry` is known, shape (K,).

        That which recorded torques show as they are late is taken off it.

        Args:
            k: the joint; of a robot of which joints are all that moves.
            numbers: of the standard model, shape (X,).
        """
        near, count = np.flatnonzero(~np.isnan(self.dry[:, k])), self._regressor.shape[2]
        rows = self._regressor[np.searchsorted(self._near, near), k]
        viscous, _, offset = numbers[count + k * len(FRICTION) :][: len(FRICTION)]
        late = _delays(numbers[count + self.dry.shape[1] * len(FRICTION) :], self.dry.shape[1])[k]
        own = rows @ numbers[:count] + viscous * self.motion.velocity[near, k] + offset
        return np.asarray(own - late * self._rate[near, k])

    @cached_property
    def _rate(self) -> Array:
        """Of the recorded torques, shape (N, n) [N m/s or N/s]."""
        return np.asarray(np.gradient(self.motion.smooth_torque, self.motion.time, axis=0))

    @cached_property
    def _near(self) -> NDArray[np.int_]:
        """Samples at which any joint is near rest."""
        return np.flatnonzero((~np.isnan(self.dry)).any(axis=1))

    @cached_property
    def _regressor(self) -> Array:
        """Derivative of the torques by the inertial numbers there, shape (K, n, P)."""
        motion, near = self.motion, self._near
        state = motion.position[near], motion.velocity[near], motion.acceleration[near]
        return self.model.regressor(*state)

    @property
    def is_rigid_and_fixed(self) -> bool:
        """Whether the joints are all that moves."""
        return self.along.base is None and self.along.inner is None

    @cached_property
    def _jacobians(self) -> tuple[Array, Array, Array]:
        """Derivatives of the torque by position, velocity, acceleration, shape (N, n, n) each."""
        motion = self.motion
        stiffness, damping, inertia = self.model.motion_jacobians(
            motion.position, motion.velocity, motion.acceleration, inertial=self.along.inertial
        )
        return stiffness, damping, inertia

    def signals(self, k: int) -> Array:
        """Of joint k in the order of `JointSignals.CHANNELS`, the direction behind them, shape (N, 12)."""
        return self._signals[k]

    @cached_property
    def _signals(self) -> tuple[Array, ...]:
        return tuple(map(self._signals_of, range(len(self.model.joints))))

    def _signals_of(self, k: int) -> Array:
        motion = self.motion
        columns = [
            motion.time,
            motion.position[:, k],
            self.velocity[:, k],
            motion.acceleration[:, k],
            self.needed[:, k],
            self.friction[:, k],
            *self.loads[:, k].T,
            self.temperature[:, k],
            self.direction[:, k],
        ]
        assert len(columns) == 1 + len(JointSignals.CHANNELS)
        return np.column_stack(columns)


@dataclass(frozen=True)
class Beyond:
    """What a hypothesis has beyond the standard model at the joints of one recording.

    Attributes:
        force: of its effects on each joint but for dry friction, shape (N, n) [N m or N].
        level: of dry friction, shape (N, n) [N m or N].
        at: at which joints it has anything, shape (n,).
        still: level at standstill, shape (N, n) [N m or N].
        speeds: at which `rise` is, rising from zero, shape (n, S) [rad/s or m/s].
        rise: level at these speeds above that at standstill, shape (n, S) [N m or N].
    """

    force: Array
    level: Array
    at: NDArray[np.bool_]
    still: Array
    speeds: Array
    rise: Array


def runs_of(standard: StandardModel, recordings: Sequence[Recording]) -> tuple[Run, ...]:
    """The recordings in the band in which the standard model was fitted, about that model."""
    model = drive_model(without_friction(standard.nominal))
    found = []
    for recording in recordings:
        motion = band_motion(model.robot, recording, standard.cutoff)
        rows = rows_of(model, recording, standard.cutoff)
        known = frozenset(name for name, values in recording.channels.items() if np.any(values))
        temperature = [_series(recording, f"{joint}.temperature", motion.time) for joint in model.joints]
        degrees = np.column_stack(temperature)
        found.append(run_about(model, motion, rows, known, degrees, standard.estimate.values))
    return tuple(found)


def run_about(
    model: RobotModel,
    motion: BandMotion,
    rows: Rows,
    channels: frozenset[str],
    temperature: Array,
    numbers: Array,
    beyond: Beyond | None = None,
) -> Run:
    """One recording about a hypothesis: what friction does near rest follows from all the rest.

    Args:
        model, motion, rows, channels, temperature: see `Run`.
        numbers: of the standard model, delays of the torque behind them, shape (X,).
        beyond: what the hypothesis has beyond it.
    """
    count, joints = len(model.inertial_names), len(model.joints)
    inertial = numbers[:count].copy()
    inertial[-3:] = inertial_with_effects(model)[-3:]
    along = Along.of(model, motion, inertial)
    viscous, coulomb, offset = numbers[count : count + joints * len(FRICTION)].reshape(joints, -1).T
    sliding = along.needed + viscous * motion.velocity + offset
    more = beyond or Beyond(
        force=np.zeros_like(sliding),
        level=np.broadcast_to(coulomb, sliding.shape),
        at=np.zeros(joints, dtype=bool),
        still=np.broadcast_to(coulomb, sliding.shape),
        speeds=np.zeros((joints, 1)),
        rise=np.zeros((joints, 1)),
    )
    late = numbers.size > count + joints * len(FRICTION)  # else the delay could be taken for a reversal's
    delays = _delays(numbers[count + joints * len(FRICTION) :], joints)
    dry = _earlier(motion, motion.smooth_torque, delays) - sliding - torque_of_effects(along) + more.force
    acting = np.nan_to_num(_earlier(motion, motion.torque, delays))
    mobility = _mobility(along) if late else None
    velocity, direction, near = _sliding(
        motion, dry, more, acting, mobility, np.asarray(rows.counted.any(axis=0))
    )
    dry[~near] = np.nan
    friction = rows.friction.copy()
    friction[:, :, FRICTION.index("coulomb")] = motion.reduce(direction)
    return Run(
        model=model,
        along=along,
        rows=replace(rows, friction=friction),
        torque=motion.reduce(acting) - (rows.measured - rows.torque),
        acting=acting,
        velocity=velocity,
        direction=direction,
        dry=dry,
        force=more.force,
        beyond=more.at,
        numbers=numbers,
        friction=-(viscous * motion.velocity + coulomb * direction),
        needed=sliding + coulomb * direction,
        channels=channels,
        temperature=temperature,
    )


def _earlier(motion: BandMotion, values: Array, delays: Array) -> Array:
    """Series of every joint as they were before a delay, shape (N, n)."""
    found = values.copy()
    for k in np.flatnonzero(delays):
        if np.isfinite(values[:, k]).all():
            instants = np.clip(motion.time + delays[k], motion.time[0], motion.time[-1])
            found[:, k] = make_interp_spline(motion.time, values[:, k], k=3)(instants)
    return found


def _mobility(along: Along) -> Array | None:
    """Acceleration of every joint by a torque at each, shape (N, n, n); None where links bend.

    A free base, which takes no force, gives way.
    """
    if along.inner is not None:
        return None
    masses = along.model.mass_matrix(along.motion.position, base=along.base, inertial=along.inertial)
    start, joints = along.model.tree.offset, len(along.model.joints)
    return np.asarray(np.linalg.inv(masses)[:, start : start + joints, start : start + joints])


def _sliding(
    motion: BandMotion,
    dry: Array,
    more: Beyond,
    torque: Array,
    mobility: Array | None,
    compared: NDArray[np.bool_],
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Velocity as friction bends it, direction of friction, and where it holds joints, (N, n) each.

    Args:
        motion: of the joints.
        dry: what dry friction has to be at rest, shape (N, n) [N m or N].
        more: effects, and the level of dry friction.
        torque: of the actuators as it was recorded, shape (N, n).
        mobility: acceleration of joints by torques at joints, shape (N, n, n); None where stops are not
            integrated.
        compared: joints of which torques are, shape (n,); stops of others are not integrated.
    """
    near = (np.abs(motion.velocity) <= NEAR * motion.velocity_noise) & ~np.isnan(dry)
    direction = np.where(near, directed(dry, more.level), np.tanh(motion.velocity / motion.transition))
    if mobility is None:
        return motion.velocity, direction, near
    stops = Stops(
        step=1.0 / motion.rate,
        velocity=motion.velocity,
        noise=np.broadcast_to(motion.velocity_noise, dry.shape),
        left=dry,
        level=more.level,
        still=more.still,
        speeds=more.speeds,
        rise=more.rise,
        jumps=torque - motion.smooth(torque),
        mobility=mobility,
        memory=motion.memory,
        smooth=motion.smooth,
    )
    return through_stops(stops, direction, near, compared)


def _delays(numbers: Array, joints: int) -> Array:
    """Of each joint, of the common one and what each is later [s], shape (n,)."""
    return np.asarray(numbers[0] + numbers[1:]) if numbers.size else np.zeros(joints)


def directed(dry: Array, level: Array | float) -> Array:
    """Direction of a joint's dry friction of which the size is known, -1 to 1.

    At rest it is as large as it has to be, up to its level; as it begins to slide it is at its level.

    Args:
        dry: what it has to be [N m or N].
        level: largest that it can be [N m or N].
    """
    return np.asarray(np.clip(dry / np.maximum(level, SMALLEST), -1.0, 1.0))


def _series(recording: Recording, channel: str, time: Array) -> Array:
    if channel not in recording:
        return np.full(time.size, ROOM_TEMPERATURE)
    values = recording[channel]
    good = np.isfinite(values)
    inside = np.clip(time, recording.time[good][0], recording.time[good][-1])
    return np.asarray(make_interp_spline(recording.time[good], values[good], k=1)(inside))

"""Recordings prepared for the inference: motion, dynamics and rows in the band of the standard model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.standard import StandardModel
from missing_physics.standard.band import BandMotion, band_motion
from missing_physics.standard.bending import model_of
from missing_physics.standard.fit import design_of
from missing_physics.standard.prediction import (
    ROOM_TEMPERATURE,
    Along,
    force_of,
    inertial_with_effects,
)
from missing_physics.standard.rows import FRICTION, Rows, rows_of, taken_about, without_friction
from reference_model.effects.base import JointSignals
from reference_model.effects.catalogue import UsedEffect, used_effects
from reference_model.effects.pushing import BodySeries
from reference_model.evaluation.model import RobotModel
from robot_model import Recording, Robot

__all__ = ["Run", "about", "runs_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """One recording, linearised at parameters of the standard model; N samples, K rows of the band, n joints.

    Attributes:
        model: of the robot without friction.
        along: its dynamics along the recorded motion.
        rows: of the regression.
        torque: recorded torques minus those of the robot's other effects, corrected for the delays in
            `parameters`, in the band, shape (K, n).
        acting: recorded torques at full rate, corrected for the delays, shape (N, n); zero where none is
            recorded.
        parameters: of the standard model, shape (X,).
        friction: of the standard model at each joint, as a force on it, shape (N, n) [N m or N].
        needed: torque that the motion needs by the standard model, shape (N, n).
        channels: recorded channels.
        temperature: of the joints [K], shape (N, n).
        laws: friction laws of the robot file at joints where it also has modifiers of friction.
    """

    model: RobotModel
    along: Along
    rows: Rows
    torque: Array
    acting: Array
    parameters: Array
    friction: Array
    needed: Array
    channels: frozenset[str]
    temperature: Array
    laws: tuple[UsedEffect, ...]

    @property
    def motion(self) -> BandMotion:
        """Motion of the joints, at full rate."""
        return self.along.motion

    def reduce(self, values: Array) -> Array:
        """Weight torques at all joints like the rows and reduce them, (N, n, ...) to (K, n, ...)."""
        active = np.flatnonzero(
            values.any(axis=(0, *range(2, values.ndim)))
        )  # skip joints that are zero throughout
        shares = self.rows.shares[:, active].reshape(len(values), active.size, *[1] * (values.ndim - 2))
        kept = np.zeros_like(values[self.motion.kept])
        kept[:, active] = self.motion.reduce(values[:, active] * shares)
        return kept

    def reduce_at(self, k: int, values: Array) -> Array:
        """Smooth torques at joint k, weight them like its rows and reduce them, (N, C) to (K, C)."""
        return self.reduce_each([k], [values])[0]

    def reduce_each(self, joints: Sequence[int], values: Sequence[Array]) -> list[Array]:
        """`reduce_at` of several joints, (N, C) each, in one pass of the filters; shapes (K, C)."""
        widths = [own.shape[1] for own in values]
        shares = self.rows.shares[:, np.repeat(joints, widths)]
        found = self.motion.reduce(self.motion.smooth(np.concatenate(values, axis=1)) * shares)
        return np.split(found, np.cumsum(widths)[:-1], axis=1)

    @cached_property
    def loads(self) -> Array:
        """Bearing loads, shape (N, n, 4)."""
        return self.along.loads()

    def moved(self, k: int, series: Array) -> Array:
        """Change of the torques for C small changes of joint k's motion, (N, C); shape (N, n, C)."""
        spline = make_interp_spline(self.motion.time, series, k=5)
        bent = series, spline(self.motion.time, 1), spline(self.motion.time, 2)
        active = np.flatnonzero(np.any([m[:, :, k].any(axis=0) for m in self._jacobians], axis=0))
        rows = np.zeros((len(series), self._jacobians[0].shape[1], series.shape[1]))
        for matrix, one in zip(self._jacobians, bent):
            rows[:, active] += matrix[:, active, k, None] * one[:, None, :]
        found = self.along.at_joints(rows)
        found[:, k] += self._viscous[k] * bent[1]
        return found

    def body(self, link: str) -> tuple[BodySeries, Array]:
        """Motion of a rigid link, and the map from a wrench on it to all rows (`RobotModel.body_motion`)."""
        if link not in self._bodies:
            self._bodies[link] = self.along.body(link)
        return self._bodies[link]

    def link_at_rows(self, link: str) -> tuple[Array, Array, Array]:
        """Position and rotation of a rigid link's frame at the rows, and joint forces per wrench there.

        Shapes (K, 3), (K, 3, 3) and (K, n, 6).
        """
        if link not in self._links_at_rows:
            (series, spread), kept = self.body(link), self.motion.kept
            joint_forces = self.along.at_joints(spread)[kept]
            self._links_at_rows[link] = series.position[kept], series.rotation[kept], joint_forces
        return self._links_at_rows[link]

    @cached_property
    def _bodies(self) -> dict[str, tuple[BodySeries, Array]]:
        return {}

    @cached_property
    def _links_at_rows(self) -> dict[str, tuple[Array, Array, Array]]:
        return {}

    @cached_property
    def residual(self) -> Array:
        """Torque minus that of the standard model at `parameters`, zero where not compared, shape (K, n)."""
        design = design_of(self.rows)
        return np.where(self.rows.counted, self.torque - design @ self.parameters[: design.shape[2]], 0.0)

    @cached_property
    def reshaped(self) -> dict[tuple[str, str], object]:
        """Cache of `links` and `yielding`: what effects change along the motion, by effect and place."""
        return {}

    @property
    def delays(self) -> Array:
        """Delays of the recorded torques in `parameters` [s], shape (n,)."""
        joints = len(self.model.joints)
        return _delays(self.parameters[len(self.model.inertial_names) + joints * len(FRICTION) :], joints)

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Joints with a recorded torque that is not zero throughout, shape (n,)."""
        return np.asarray(self.rows.measured.any(axis=0))

    @property
    def sliding(self) -> Array:
        """Torque by the standard model without dry friction, shape (N, n)."""
        return self.needed + self.friction + self._viscous * self.motion.velocity

    @property
    def _viscous(self) -> Array:
        first, joints = len(self.model.inertial_names), len(self.model.joints)
        return self.parameters[first : first + joints * len(FRICTION)].reshape(joints, -1)[:, 0]

    @cached_property
    def _jacobians(self) -> tuple[Array, Array, Array]:
        """Derivatives of inverse dynamics by position, velocity, acceleration, shape (N, rows, n) each."""
        motion, along = self.motion, self.along
        stiffness, damping, inertia = self.model.motion_jacobians(
            motion.position,
            motion.velocity,
            motion.acceleration,
            base=along.base,
            inner=along.inner,
            inertial=along.inertial,
        )
        return stiffness, damping, inertia

    def signals(self, k: int) -> Array:
        """Signals of joint k in the order of `JointSignals.CHANNELS`, then the direction, shape (N, 12)."""
        return self._signals[k]

    @cached_property
    def _signals(self) -> tuple[Array, ...]:
        return tuple(map(self._signals_of, range(len(self.model.joints))))

    def _signals_of(self, k: int) -> Array:
        motion = self.motion
        columns = [
            motion.time,
            motion.position[:, k],
            motion.velocity[:, k],
            motion.acceleration[:, k],
            self.needed[:, k],
            self.friction[:, k],
            *self.loads[:, k].T,
            self.temperature[:, k],
            motion.direction[:, k],
        ]
        assert len(columns) == 1 + len(JointSignals.CHANNELS)
        found, joint = np.column_stack(columns), self.model.robot.drives[k]
        own = [law for law in self.laws if law.at == joint.name]
        if own:  # modifiers of the file multiply the file's friction laws
            forces = [force_of(law, joint, found[:, :-1], motion, k) for law in own]
            found[:, JointSignals.CHANNELS.index("friction")] = np.sum(forces, axis=0)
        return found


def runs_of(standard: StandardModel, recordings: Sequence[Recording]) -> tuple[Run, ...]:
    """The recordings in the band in which the standard model was fitted, linearised at its estimate."""
    model = model_of(without_friction(standard.nominal))
    found, laws = [], tuple(_modified(standard.nominal))
    for recording in recordings:
        motion = band_motion(model.robot, recording, standard.cutoff)
        motion = replace(motion, reversals=standard.weights.reversals)
        rows = rows_of(
            model, recording, standard.cutoff, about=standard.estimate.values, weights=standard.weights
        )
        known = frozenset(name for name, values in recording.channels.items() if np.any(values))
        temperature = [_series(recording, f"{joint}.temperature", motion.time) for joint in model.joints]
        degrees = np.column_stack(temperature)
        found.append(_run_about(model, motion, rows, known, degrees, laws, standard.estimate.values))
    return tuple(found)


def _modified(robot: Robot) -> Iterator[UsedEffect]:
    """Friction laws of the robot file at joints where it also has modifiers of friction."""
    every = [(one, one.effect) for one in used_effects(robot)]
    joints = {one.at for one, effect in every if effect.is_modifier}
    for one, effect in every:
        if one.at in joints and effect.is_friction_law:
            yield one


def _run_about(
    model: RobotModel,
    motion: BandMotion,
    rows: Rows,
    channels: frozenset[str],
    temperature: Array,
    laws: tuple[UsedEffect, ...],
    parameters: Array,
) -> Run:
    """One recording, linearised at parameters of the standard model.

    Args:
        model, motion, rows, channels, temperature, laws: see `Run`.
        parameters: of the standard model, followed by the delays of the torque, shape (X,).
    """
    count, joints = len(model.inertial_names), len(model.joints)
    inertial = parameters[:count].copy()
    inertial[-3:] = inertial_with_effects(model)[-3:]
    along = Along.of(model, motion, inertial)
    if along.response is not None and rows.measured.any(axis=0).all():
        rows = taken_about(rows, along)
    viscous, coulomb, offset = parameters[count : count + joints * len(FRICTION)].reshape(joints, -1).T
    friction = -(viscous * motion.velocity + coulomb * motion.direction)
    delays = _delays(parameters[count + joints * len(FRICTION) :], joints)
    smooth = motion.smooth_torque
    change = np.nan_to_num(_advanced(motion, smooth, delays) - smooth)
    return Run(
        model=model,
        along=along,
        rows=rows,
        torque=rows.torque + rows.nuisance.removed(motion.reduce(change * rows.shares)),
        acting=np.nan_to_num(_advanced(motion, motion.torque, delays)),
        parameters=parameters,
        friction=friction,
        needed=along.needed + offset - friction,
        channels=channels,
        temperature=temperature,
        laws=laws,
    )


def about(run: Run, parameters: Array) -> Run:
    """The same recording, linearised at other parameters of the standard model."""
    return _run_about(run.model, run.motion, run.rows, run.channels, run.temperature, run.laws, parameters)


def _advanced(motion: BandMotion, values: Array, delays: Array) -> Array:
    """Series of every joint, advanced by its delay, shape (N, n)."""
    found = values.copy()
    for k in np.flatnonzero(delays):
        if np.isfinite(values[:, k]).all():
            instants = np.clip(motion.time + delays[k], motion.time[0], motion.time[-1])
            found[:, k] = make_interp_spline(motion.time, values[:, k], k=3)(instants)
    return found


def _delays(parameters: Array, joints: int) -> Array:
    """Delay of each joint: the common delay plus the joint's additional one [s], shape (n,)."""
    return np.asarray(parameters[0] + parameters[1:]) if parameters.size else np.zeros(joints)


def _series(recording: Recording, channel: str, time: Array) -> Array:
    if channel not in recording:
        return np.full(time.size, ROOM_TEMPERATURE)
    values = recording[channel]
    good = np.isfinite(values)
    inside = np.clip(time, recording.time[good][0], recording.time[good][-1])
    return np.asarray(make_interp_spline(recording.time[good], values[good], k=1)(inside))

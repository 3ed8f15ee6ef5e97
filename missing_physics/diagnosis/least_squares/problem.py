"""The regression problem a diagnosis solves: recorded torque against what models predict.

For every recording the measured actuator torque, the nominal prediction and the contribution of every term
go through the same filter and decimation. What remains is a stack of rows, one per kept sample and joint,
ordered by time so that blocks of time are contiguous.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.dynamics.measurements import modal_sight
from missing_physics.diagnosis.least_squares.contribution import Contribution, Output
from missing_physics.diagnosis.modal.smoother import VibrationSmoother
from missing_physics.diagnosis.motion.commanded_torque import quiet
from missing_physics.diagnosis.motion.estimate import LOWEST_CUTOFF, Motion
from missing_physics.diagnosis.motion.low_pass import LowPass
from missing_physics.diagnosis.motion.sliding import transition_speeds, weights
from missing_physics.diagnosis.responses.hidden_torques import HiddenResponses
from missing_physics.diagnosis.responses.passive_channels import PassiveResponses
from missing_physics.diagnosis.responses.pushes import Pushes
from missing_physics.diagnosis.responses.signals import signals_along
from missing_physics.diagnosis.statistics.blocks import blocks
from missing_physics.diagnosis.terms.term import (
    Place,
    Term,
    body_terms,
    channel_error,
    depends_on,
    joint_torque,
    sensor_error,
)
from reference_model.effects.base import BodyEffect, JointEffect, JointSignals, SensorEffect
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.catalogue import used_effects
from reference_model.effects.structure import StructureEffect
from robot_model import Robot

__all__ = ["Contribution", "Output", "Problem", "Segment"]

Array = NDArray[np.float64]

#: Contributions of terms kept for reuse.
MOST_CACHED = 600
#: Noise may make this part of the rate of a joint's torque.
NOISE_OF_RATE = 0.05
#: Step of a central difference by velocity, as a part of the largest speed.
SLOPE_STEP = 1e-2


class Segment:
    """One recording: motion, nominal prediction, and the contributions of terms along it."""

    def __init__(self, robot: Robot, dynamics: MotionDynamics, motion: Motion) -> None:
        self.robot = robot
        self.motion = motion
        self.dynamics = dynamics
        self.joints = robot.moving_joints
        unknown = np.full(motion.time.size, np.nan)
        rates = [motion.others.get(channel, unknown) for channel in dynamics.further]
        recorded = np.column_stack([motion.torque, *rates])
        self.usable: NDArray[np.bool_] = np.asarray(np.isfinite(recorded).all(axis=0))
        self.measured = self.reduce(np.where(np.isfinite(recorded), recorded, 0.0))
        self.time = motion.reduced_time
        kept = motion.low_pass.kept(motion.time.size)
        self.position = motion.position[kept]
        self.velocity = motion.velocity[kept]
        self.places = tuple(Place.of(joint, t) for joint, t in zip(self.joints, transition_speeds(motion)))
        always = np.ones((motion.time.size, len(dynamics.further)))  # a base's rate knows no friction
        self.sliding, self.moving = (
            np.hstack([weight, always])[kept] for weight in weights(robot, motion, self._slow())
        )
        self._cache: dict[tuple[object, ...], Contribution] = {}
        self.hidden = HiddenResponses(robot, dynamics, self.reduce)
        self.pushes = Pushes(dynamics, self.reduce)
        self.passive = PassiveResponses(dynamics)
        self._signals: dict[int, Array] = {}
        self._driving = motion.torque  # until there is a prediction that has less noise
        self._needed = nominal = self._nominal_torque()
        outputs = dynamics.nominal_outputs.copy()
        if self.vibration is not None:
            outputs[:, : len(self.joints)] += self.vibration.torque
            nominal = nominal + self.vibration.torque
        self.inverse = self.reduce(outputs)
        about = motion.torque_noise, motion.velocity, self._slow(), motion.low_pass
        self._driving = quiet(motion.torque, nominal, *about)
        self._signals.clear()
        aside = np.nan_to_num(motion.torque - self._driving)
        self.aside = self.reduce(np.pad(aside, ((0, 0), (0, len(rates)))))

    @cached_property
    def vibration(self) -> VibrationSmoother | None:
        """The correction of the flexible links' vibration, where there are any and torques are known."""
        return None if self.dynamics.modal_response is None else self.smoother

    @cached_property
    def smoother(self) -> VibrationSmoother | None:
        """How joints and links truly moved, with its uncertainty; None where torque or encoder is missing."""
        motion = self.motion
        if motion.derived or not self.usable[: len(self.joints)].all():
            return None
        return VibrationSmoother(
            self.dynamics.motion_response,
            motion.torque - self._needed,
            motion.raw_position - motion.position,
            position_noise=motion.position_noise,
            torque_noise=motion.torque_noise,
            rate_noise=motion.velocity_noise,
            level=(_rms(motion.raw_position), _rms(motion.torque)),
            guessed=np.array([channel in motion.guessed for channel in motion.position_channels]),
            sight=modal_sight(self.dynamics),
        )

    def beside(self, added: Array, smoother: VibrationSmoother | None = None) -> Segment:
        """The same recording with outputs (N, m) known to be added, vibration put right with them."""
        other, known = copy(self), added.copy()
        if self.vibration is not None and smoother is not None:
            other.__dict__["vibration"] = smoother
            torque = smoother.torque_of(*smoother.data)[:, :, 0]
            known[:, : len(self.joints)] += torque - self.vibration.torque
        other.inverse = self.inverse + self.reduce(known)
        other._cache = {}
        return other

    def _nominal_torque(self) -> Array:
        """What the nominal robot predicts with the effects at its joints, shape (N, n)."""
        predicted = self.dynamics.torque.copy()
        terms = [Term(used.effect, used.at, dict(used.parameters)) for used in used_effects(self.robot)]
        for term in terms:
            if isinstance(term.effect, JointEffect):
                index, force, _ = self._force(term, self._laws(term, terms))
                predicted[:, index] -= force
            elif isinstance(term.effect, BodyEffect):
                added = self.dynamics.body_columns(term.at) @ body_terms(term)[0]
                predicted += added[:, : predicted.shape[1]]
        return predicted

    def reduce(self, outputs: Array) -> Array:
        """Filter and decimate outputs, shape (N, m) or (N, m, k).

        Of rates the mean is taken away: a gyro's bias, and a turn of the base before the recording, say
        nothing of the robot.
        """
        kept = self.motion.low_pass.reduce(outputs)
        rates = kept[:, len(self.joints) :]
        if not len(kept):
            return kept
        return np.concatenate([kept[:, : len(self.joints)], rates - rates.mean(axis=0)], axis=1)

    def _slow(self) -> Array:
        """Transition speed of each joint, shape (n,)."""
        return np.array([place.transition for place in self.places])

    def signals(self, joint: int, friction: Array | None = None) -> Array:
        """Arrays of `JointSignals.CHANNELS` of one joint at the full rate, shape (N, 11)."""
        if friction is not None:
            signals = self.signals(joint).copy()
            signals[:, JointSignals.CHANNELS.index("friction")] = friction
            return signals
        if joint not in self._signals:
            self._signals[joint] = signals_along(self.dynamics, joint, self._driving[:, joint])
            self._signals[joint].flags.writeable = False
        return self._signals[joint]

    def contribution(self, term: Term, others: Sequence[Term] = ()) -> Contribution:
        """What `term` adds to the predicted torque; `others` are the friction laws a modifier multiplies."""
        laws = self._laws(term, others)
        linear = term.is_linear
        key = (
            term.key,
            term.free,
            () if linear else tuple(sorted(term.parameters.items())),
            tuple((law.key, tuple(sorted(law.parameters.items()))) for law in laws),
        )
        if key not in self._cache:
            if len(self._cache) > MOST_CACHED:
                self._cache.clear()
            whole = replace(term, frozen=False, unseen=()) if linear else term
            self._cache[key] = self._evaluate(whole, laws)
        stored = self._cache[key]
        if not linear:
            return stored
        # Linear in every parameter: the Jacobian is the contribution of a unit of each.
        values = np.array([term.parameters[p.name] for p in term.effect.estimated])
        names = [p.name for p in term.effect.estimated]
        columns = [names.index(name) for name in term.free]
        return Contribution(stored.jacobian @ values, stored.jacobian[:, :, columns])

    @staticmethod
    def _laws(term: Term, others: Sequence[Term]) -> tuple[Term, ...]:
        """Friction laws on which the contribution of `term` depends."""
        modifies = isinstance(term.effect, JointEffect) and term.effect.is_modifier
        if not modifies and (not isinstance(term.effect, SensorEffect) or term.at_torque):
            return ()
        here = [
            other
            for other in others
            if other.at == term.at.split(".")[0]
            and isinstance(other.effect, JointEffect)
            and other.effect.is_friction_law
        ]
        # A sensor's error changes smooth laws through their slope; a dry law has none but at rest.
        return tuple(law for law in here if modifies or law.effect.family != "dry_friction")

    def _evaluate(self, term: Term, laws: tuple[Term, ...]) -> Contribution:
        if isinstance(term.effect, JointEffect):
            return self._joint(term, laws)
        if isinstance(term.effect, BodyEffect):
            return self._body(term)
        if isinstance(term.effect, StructureEffect):
            return Contribution(*self.hidden.contribution(term))
        if isinstance(term.effect, ForceEffect):
            return Contribution(*self.pushes.contribution(term))
        assert isinstance(term.effect, SensorEffect)
        return self._sensor(term, laws)

    def _force(self, term: Term, laws: tuple[Term, ...]) -> tuple[int, Array, Array]:
        """Joint, force of its effect (N,) and Jacobian (N, k) at the full rate."""
        index = [joint.name for joint in self.joints].index(term.at)
        place = self.places[index]
        friction = None
        if laws:
            plain = self.signals(index)
            friction = np.sum([joint_torque(law, place, plain)[0] for law in laws], axis=0)
        return index, *joint_torque(term, place, self.signals(index, friction))

    def _joint(self, term: Term, laws: tuple[Term, ...]) -> Contribution:
        index, force, jacobian = self._force(term, laws)
        return self._in_column(index, -np.column_stack([force, jacobian]))

    def _in_column(self, index: int, values: Array) -> Contribution:
        """A value and its derivatives, shape (N, 1 + k), that show in one output alone."""
        reduced = self.motion.low_pass.reduce(values)
        if index >= len(self.joints):
            reduced = reduced - reduced.mean(axis=0)  # as in `reduce`
        stacked = np.zeros((*self.measured.shape, reduced.shape[1]))
        stacked[:, index] = reduced
        return Contribution(stacked[:, :, 0], stacked[:, :, 1:])

    def _body(self, term: Term) -> Contribution:
        values, jacobian = body_terms(term)
        columns = self.dynamics.body_columns(term.at)
        both = columns @ np.column_stack([values, jacobian])
        reduced = self.reduce(both)
        return Contribution(reduced[:, :, 0], reduced[:, :, 1:])

    def _sensor(self, term: Term, laws: tuple[Term, ...]) -> Contribution:
        if term.at in self.dynamics.further:
            return self._rate_sensor(term)
        if term.at_torque:
            return self._torque_sensor(term)
        motion = self.motion
        index = [joint.name for joint in self.joints].index(term.at.split(".")[0])
        # What does not ask for a rate is told of the very motion that inertial numbers are multiplied with.
        own = motion.position[:, index], motion.velocity[:, index]
        seen = self._calm_motion(index) if depends_on(term.effect, "rate") else own
        error, jacobian = sensor_error(term, motion.time, *seen)
        both = np.concatenate([error[:, :, None], jacobian], axis=2)
        errors = np.zeros((3, motion.time.size, len(self.joints), both.shape[2]))
        errors[:, :, index] = both
        change = -self.dynamics.moved(tuple(errors))
        if laws:
            change[:, index] += self._friction_slope(index, laws)[:, None] * both[1]
        reduced = self.reduce(change)
        return Contribution(reduced[:, :, 0], reduced[:, :, 1:])

    def _torque_sensor(self, term: Term) -> Contribution:
        """What an error of a torque sensor adds to its own channel."""
        index = [joint.name for joint in self.joints].index(term.at.split(".")[0])
        recorded = self._driving[:, index]
        measured = recorded if np.isfinite(recorded).all() else self.dynamics.torque[:, index]
        error, jacobian = channel_error(term, self.motion.time, measured)
        return self._in_column(index, np.column_stack([error, jacobian]))

    def _rate_sensor(self, term: Term) -> Contribution:
        """What an error of a gyro adds to its own channel."""
        time, column = self.motion.time, len(self.joints) + self.dynamics.further.index(term.at)
        rate = self.motion.low_pass.smooth(self.dynamics.outputs[:, column])
        error, jacobian = sensor_error(term, time, rate, np.gradient(rate, time))
        return self._in_column(column, np.column_stack([error[0], jacobian[0]]))

    def _calm_motion(self, index: int) -> tuple[Array, Array]:
        """Position and velocity of a joint, smooth enough to be differentiated once more, shape (N,) each.

        The contribution of a delay is in proportion to the rate of the torque. Noise in it would make the
        delay come out too small, as errors in a regressor do.
        """
        motion, rate = self.motion, self.motion.low_pass.rate
        inertia = float(np.sqrt(np.mean(self.dynamics.inertia[:, index] ** 2)))
        torque = motion.low_pass.smooth(self.dynamics.torque[:, index])
        allowed = NOISE_OF_RATE * float(np.std(np.gradient(torque, 1.0 / rate)))
        density = (inertia * (2 * np.pi) ** 3 * motion.position_noise[index]) ** 2 * 2.0 / rate
        cutoff = motion.motion_cutoff
        if density > 0:
            cutoff = min(cutoff, float((7.0 * allowed**2 / density) ** (1.0 / 7.0)))
        smoother = LowPass(rate, max(cutoff, min(LOWEST_CUTOFF, motion.low_pass.cutoff)))
        return smoother.smooth(motion.position[:, index]), smoother.smooth(motion.velocity[:, index])

    def _friction_slope(self, index: int, laws: tuple[Term, ...]) -> Array:
        """Derivative of the friction of `laws` by the velocity, shape (N,), by central differences."""
        signals = self.signals(index)
        column = JointSignals.CHANNELS.index("velocity")
        step = SLOPE_STEP * max(float(np.abs(signals[:, column]).max()), 1e-12)
        slope = np.zeros(len(signals))
        for sign in (1.0, -1.0):
            moved = signals.copy()
            moved[:, column] += sign * step
            for law in laws:
                slope += sign * joint_torque(replace(law, frozen=True), self.places[index], moved)[0]
        return slope / (2 * step)


class Problem:
    """All segments of one set of recordings, stacked.

    Attributes:
        segments: one per recording.
        joints: names of the n moving joints.
        outputs: what is predicted, the m columns of the arrays below: the joints' torques, then the channels
            of a gyro on the base where there is one.
        residual: measured minus inverse dynamics, before any effect, shape (R, m).
        aside: the part of what was measured that is noise and drives no actuator, shape (R, m).
        nuisance: changes of the predictions by the free combinations of inertial numbers, (R, m, B).
        blocks: block of each row, shape (R,), rising.
        usable: whether an output is known, shape (m,).
        sliding: 1 where a joint surely moves in one direction, else 0, shape (R, m).
        moving: the same with quick reversals included, shape (R, m).
        noise_floor: rms that sensor noise alone leaves, shape (m,).
        lightness: how much of the nominal inertia the joints feel at least, of the combinations' values.
    """

    def __init__(
        self,
        segments: Sequence[Segment],
        nuisance: Array,
        noise_floor: Array,
        lightness: Callable[[Array], float],
    ) -> None:
        self.segments = tuple(segments)
        self.robot = segments[0].robot
        self.joints = tuple(joint.name for joint in segments[0].joints)
        torques = (Output(f"{name}.torque", name, k) for k, name in enumerate(self.joints))
        rates = (Output(channel, channel.split(".")[0], None) for channel in segments[0].dynamics.further)
        self.outputs = (*torques, *rates)
        self.measured = np.concatenate([s.measured for s in segments])
        self.residual = np.concatenate([s.measured - s.inverse for s in segments])
        self.aside = np.concatenate([s.aside for s in segments])
        self.velocity = np.concatenate([s.velocity for s in segments])
        self.position = np.concatenate([s.position for s in segments])
        self.time = np.concatenate([s.time for s in segments])
        self.usable = np.all([s.usable for s in segments], axis=0)
        self.sliding = np.concatenate([s.sliding for s in segments])
        self.moving = np.concatenate([s.moving for s in segments])
        self.nuisance = nuisance
        self.noise_floor = noise_floor
        self.lightness = lightness
        self.segment_of = np.concatenate([np.full(s.time.size, i) for i, s in enumerate(segments)])
        self.blocks = blocks([segment.time for segment in segments])

    def evaluate(self, terms: Sequence[Term]) -> tuple[Array, Array]:
        """Sum of the contributions, shape (R, m), and their Jacobians side by side, shape (R, m, K)."""
        values, jacobians = [], []
        for segment in self.segments:
            parts = [segment.contribution(term, terms) for term in terms]
            rows, n = segment.measured.shape
            values.append(np.sum([part.value for part in parts], axis=0) if parts else np.zeros((rows, n)))
            jacobians.append(
                np.concatenate([part.jacobian for part in parts], axis=2) if parts else np.zeros((rows, n, 0))
            )
        return np.concatenate(values), np.concatenate(jacobians)


def _rms(columns: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(columns**2, axis=0)))

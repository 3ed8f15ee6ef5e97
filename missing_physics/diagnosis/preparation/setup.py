"""From recordings to the regression problem: motions, inertial combinations, noise floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis.candidates.structural import LOOKED_FOR
from missing_physics.diagnosis.dynamics.base_rates import base_rate_channels
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics, joint_inertia
from missing_physics.diagnosis.dynamics.joints_from_base import joints_from_base
from missing_physics.diagnosis.dynamics.lightness import Lightness
from missing_physics.diagnosis.dynamics.measurements import drawn_gap
from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.motion.estimate import Motion, estimate_motion
from missing_physics.diagnosis.motion.low_pass import LowPass
from missing_physics.diagnosis.terms.term import Term
from missing_physics.recordings import estimate_noise, sensors_of
from reference_model.effects.base import Effect, GearEffect
from reference_model.effects.catalogue import used_effects
from reference_model.evaluation.model import RobotModel
from robot_model import InputError, Recording, Robot

__all__ = [
    "InertialBasis",
    "build_problem",
    "inertial_basis",
    "make_dynamics",
    "make_segments",
    "most_samples",
    "nominal_terms",
    "typical_sizes",
]

Array = NDArray[np.float64]

#: An inertial combination is re-estimated when changing it by its own size moves what is predicted by at
#: least this part of its rms; weaker ones are invisible in the data.
VISIBLE = 3e-3
#: Runs in closed loop know more than a regression: they see weaker ones, down to this part.
FAINT = 2e-4
#: Drawings of noise from which its floor is computed.
NOISE_DRAWS = 2
#: Samples of one recording times joints squared: about 3 GB.
MOST_SAMPLES = 3_000_000


@dataclass(frozen=True)
class InertialBasis:
    """Combinations of the inertial numbers that the training data can see (base parameters).

    Attributes:
        names: inertial numbers, `RobotModel.inertial_names` without gravity and the known ones.
        columns: their places in `RobotModel.inertial_names`.
        directions: change of the numbers per unit of each combination, shape (P', B).
        scale: typical size of each number, shape (P',).
        faint: further combinations that only runs in closed loop see, as `directions`, shape (P', F).
    """

    names: tuple[str, ...]
    columns: NDArray[np.int_]
    directions: Array
    scale: Array
    faint: Array | None = None

    @property
    def most(self) -> int:
        """How many combinations runs may see."""
        return self.directions.shape[1] + (0 if self.faint is None else self.faint.shape[1])

    def first(self, count: int) -> Array:
        """Change of the numbers per unit of each of the first `count` combinations, shape (P', count)."""
        known = self.directions if self.faint is None else np.hstack([self.directions, self.faint])
        return known[:, :count]

    def identifiable(self, index: int, count: int) -> bool:
        """Whether the single number `index` is determined by the first `count` combinations."""
        unit = self.first(count) / self.scale[:, None]
        return bool(unit[index] @ unit[index] > 0.98)


#: Nothing is re-estimated: every inertial number is known, or no torque tells anything of them.
_EMPTY = InertialBasis((), np.zeros(0, int), np.zeros((0, 0)), np.zeros(0))


def nominal_terms(robot: Robot) -> tuple[Term, ...]:
    """The effects that the nominal robot has already, as terms.

    What lies in a gear is none: it adds no torque along the motor's motion that a recording could show. What
    acts on the whole robot stays as described: it has no regressors from which its numbers would follow.
    """
    return tuple(
        Term(use.effect, use.at, dict(use.parameters), nominal=True, frozen=not use.effect.along_motion)
        for use in used_effects(robot)
        if not isinstance(use.effect, GearEffect)
    )


def make_segments(
    robot: Robot, recordings: Sequence[Recording], *, cutoff: float | None = None
) -> tuple[Segment, ...]:
    """`make_dynamics`, with what is compared along each recording."""
    found = make_dynamics(robot, recordings, cutoff=cutoff)
    return tuple(Segment(robot, dynamics, dynamics.motion) for dynamics in found)


@lru_cache(maxsize=4)
def _model(robot: Robot) -> RobotModel:
    """One for all recordings of a robot, since code is generated for it."""
    return RobotModel(robot)


def make_dynamics(
    robot: Robot, recordings: Sequence[Recording], *, cutoff: float | None = None
) -> tuple[MotionDynamics, ...]:
    """Estimate motion and nominal dynamics of each recording, all through one cut-off.

    Raises:
        InputError: the robot has coordinates that no joint recording tells.
    """
    if robot.spherical_joints:
        raise InputError(
            f"robot '{robot.name}': the motion of spherical joint '{robot.spherical_joints[0].name}' is no "
            "channel of a recording; describe it by three revolute joints to diagnose the robot."
        )
    if not robot.moving_joints:
        raise InputError(
            f"robot '{robot.name}' has no moving joint, so that there is nothing to diagnose; give the "
            "joint that moved another kind than 'fixed'."
        )
    for used in used_effects(robot):
        if not (used.effect.along_motion or _follows(robot, used.effect)):
            raise InputError(
                f"robot '{robot.name}', effect '{used.effect.id}' at '{used.at}': recorded joints do not "
                "determine what it does, so that a diagnosis cannot include it; describe the robot without "
                "it."
            )
    for recording in recordings:
        _fits_in_memory(robot, recording)
    model = _model(robot)
    inertia = joint_inertia(model, np.array([joint.initial_position for joint in robot.moving_joints]))
    noises = [_noise(robot, recording) for recording in recordings]
    found = [joints_from_base(model, recording, noise) for recording, noise in zip(recordings, noises)]

    def motion_of(k: int, below: float | None) -> Motion:
        recording, noise, told = recordings[k], noises[k], found[k]
        if told is None:
            return estimate_motion(robot, recording, inertia=inertia, noise=noise, cutoff=below)
        noise, walk = {**noise, **told.noise}, told.walk
        motion = estimate_motion(robot, told.recording, inertia=inertia, noise=noise, cutoff=below, walk=walk)
        return replace(motion, derived=tuple(walk), remark=told.words)

    motions = [motion_of(k, cutoff) for k in range(len(recordings))]
    lowest = min(motion.low_pass.cutoff for motion in motions)
    if any(motion.low_pass.cutoff > lowest for motion in motions):
        motions = [motion_of(k, lowest) for k in range(len(recordings))]
    motions = [replace(motion, guessed=_guessed(robot, r)) for motion, r in zip(motions, recordings)]
    # a gyro that tells of joints without encoders says nothing twice
    further = () if any(found) else base_rate_channels(robot, recordings)
    return tuple(MotionDynamics(model, motion, further) for motion in motions)


def _follows(robot: Robot, effect: Effect) -> bool:
    """Whether what an effect of the whole robot does can be simulated along the recorded joint motion."""
    return effect.id in LOOKED_FOR and robot.base.kind == "fixed" and not robot.flexible_links


def most_samples(robot: Robot) -> int:
    """Samples of one recording that a diagnosis of this robot takes."""
    return MOST_SAMPLES // max(len(robot.moving_joints), 1) ** 2


def _fits_in_memory(robot: Robot, recording: Recording) -> None:
    """Refuse recordings whose derivatives by all inertial numbers would need too much memory."""
    joints = max(len(robot.moving_joints), 1)
    most = most_samples(robot)
    if len(recording) > most:
        raise InputError(
            f"{recording.source or 'the recording'} has {len(recording)} samples; a diagnosis of {joints} "
            f"joint{'s' if joints > 1 else ''} takes at most {most}: cut it or keep fewer samples per second."
        )


def _noise(robot: Robot, recording: Recording) -> Mapping[str, float]:
    """Noise by channel: what the recording states, else the robot's sensors, else an estimate."""
    stated = {}
    for s in sensors_of(robot, recording):  # a recording's own resolution is added where its noise is used
        rounding = 0.0 if s.channel in recording.resolution else s.resolution / np.sqrt(12.0)
        stated[s.channel] = float(np.hypot(s.noise, rounding))
    return {**estimate_noise(recording), **recording.noise, **stated}


def _guessed(robot: Robot, recording: Recording) -> frozenset[str]:
    """Channels of whose noise neither the robot's sensors nor the recording say anything."""
    stated = {sensor.channel for sensor in robot.sensors} | set(recording.noise)
    return frozenset(channel for channel in recording if channel not in stated)


def inertial_basis(robot: Robot, segments: Sequence[Segment]) -> InertialBasis:
    """Base parameters by singular values of the scaled regressor (Gautier, J. Robotic Systems 8 (1991))."""
    model = segments[0].dynamics.model
    names = model.inertial_names
    free = [i for i, name in enumerate(names) if not name.startswith("gravity") and not _known(robot, name)]
    if not free:
        return _EMPTY
    scale = typical_sizes(robot, model)[free]
    joints = len(robot.moving_joints)
    torque = _torques([s.measured for s in segments], segments)
    if not torque.any():  # nothing drives the joints: what they need stands for it
        torque = _torques([s.inverse for s in segments], segments)
    weight = np.ones(segments[0].usable.size)
    for column in range(joints, weight.size):  # rates count as much as torques do
        rate = np.concatenate([s.measured[:, column] for s in segments])
        weight[column] = _rms(torque) / max(_rms(rate), 1e-300)
    rows = np.concatenate(
        [
            (s.reduce(s.dynamics.regressor[:, :, free]) * scale * weight[:, None])[:, s.usable].reshape(
                -1, len(free)
            )
            for s in segments
        ]
    )
    if rows.size == 0:
        return _EMPTY
    _, singular, vectors = np.linalg.svd(rows.T @ rows)
    seen = np.sqrt(singular) / max(float(np.linalg.norm(torque)), 1e-300)
    visible, faint = seen > VISIBLE, (seen > FAINT) & (seen <= VISIBLE)
    return InertialBasis(
        tuple(names[i] for i in free),
        np.array(free),
        vectors[visible].T * scale[:, None],
        scale,
        vectors[faint].T * scale[:, None],
    )


def _torques(outputs: Sequence[Array], segments: Sequence[Segment]) -> Array:
    """The known joints' torques among the outputs (R, m) of each segment, in one row."""
    n = len(segments[0].joints)
    return np.concatenate([o[:, :n][:, s.usable[:n]].ravel() for o, s in zip(outputs, segments)])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _known(robot: Robot, name: str) -> bool:
    return name in robot.known or name.split(".")[0] in robot.known


def typical_sizes(robot: Robot, model: RobotModel) -> Array:
    """A size by which each inertial number may credibly be wrong; never zero where a number may exist."""
    sizes = []
    reach = {joint.parent: float(np.linalg.norm(joint.origin)) for joint in robot.joints}
    own = dict(zip(model.inertial_names, model.inertial))
    total = sum(link.mass for link in robot.links)
    for name in model.inertial_names:
        body, _, number = name.partition(".")
        if number == "reflected_inertia":
            child = robot.link(robot.joint(body).child)
            sizes.append(max(own[name], 0.1 * (child.mass * 0.01 or max(abs(m) for m in child.inertia))))
            continue
        if body == "gravity":
            sizes.append(1.0)
            continue
        link = robot.base if body == "base" else robot.link(body)
        length = max(reach.get(body, 0.0), float(np.linalg.norm(link.center_of_mass)), 1e-2)
        inertia = max(max(abs(m) for m in link.inertia), 1e-9)
        # A motor alone may be described by its inertia, without any mass in the whole robot.
        mass = max(own[f"{body}.mass"], 1e-3 * total) or inertia / length**2
        spread = max(mass * length**2, inertia)
        sizes.append({"mass": mass, "first_moment": mass * length}.get(number.split(".")[0], spread))
    return np.array(sizes)


def build_problem(segments: Sequence[Segment], basis: InertialBasis, *, seed: int = 0) -> Problem:
    """Stack segments, with the columns of the inertial combinations and the noise floor."""
    columns = []
    for segment in segments:
        if basis.columns.size:
            full = segment.dynamics.regressor[:, :, basis.columns] @ basis.directions
            columns.append(segment.reduce(full))
        else:
            columns.append(np.zeros((*segment.measured.shape, 0)))
    floor = np.sqrt(np.mean([_noise_floor(s, seed=seed) ** 2 for s in segments], axis=0))
    lightness = Lightness(segments[0].dynamics, basis.columns, basis.directions)
    return Problem(segments, np.concatenate(columns), floor, lightness)


def _noise_floor(segment: Segment, *, seed: int) -> Array:
    """rms of the residual that sensor noise alone makes, shape (m,), by drawing noise."""
    motion: Motion = segment.motion
    rates = [motion.noise_between(channel) for channel in segment.dynamics.further]
    noise = np.concatenate([motion.torque_noise, rates])
    response = segment.dynamics.modal_response
    chance = np.random.default_rng(seed)
    left, gaps = [], []
    for _ in range(NOISE_DRAWS):
        shape = motion.position.shape
        recorded = motion.drawn_noise(chance)
        position = LowPass(motion.low_pass.rate, motion.motion_cutoff).smooth(recorded)
        spline = make_interp_spline(motion.time, position, k=5)
        errors = (position, spline(motion.time, 1), spline(motion.time, 2))
        made = chance.standard_normal((shape[0], noise.size)) * noise
        made -= segment.dynamics.moved([error[:, :, None] for error in errors])[:, :, 0]
        if response is not None:
            made[:, : shape[1]] -= response.driven(errors[2])
        left.append(made)
        gaps.append(recorded - position)
        if segment.vibration is not None and segment.vibration.sight is not None:
            seen = drawn_gap(segment.dynamics, segment.vibration.sight, errors, chance)
            gaps[-1] = np.hstack([gaps[-1], seen])
    made = np.stack(left, axis=2)
    if segment.vibration is not None:
        joints = made[:, : len(segment.joints)]
        joints -= segment.vibration.torque_of(joints, np.stack(gaps, axis=2))
    return np.asarray(np.sqrt(np.mean(segment.reduce(made) ** 2, axis=(0, 2))))

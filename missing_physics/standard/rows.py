"""Rows of the linear regression of the measured torque on the parameters of the standard model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.bodies.pseudo_inertia import COUNT, sizes
from missing_physics.checks.actuation import is_passive
from missing_physics.evaluation.nuisance import Nuisance
from missing_physics.evaluation.vibration.whitening import Vibration
from missing_physics.standard.band import BandMotion, band_motion, motion_band
from missing_physics.standard.prediction import Along, inertial_with_effects, torque_of_effects
from reference_model.dynamics.inertial import body_names
from reference_model.effects.base import Effect, JointEffect
from reference_model.effects.catalogue import used_effects
from reference_model.evaluation.model import RobotModel
from robot_model import EffectUse, Recording, Robot

__all__ = [
    "FRICTION",
    "MODEL_ERROR",
    "Rows",
    "Sample",
    "Weights",
    "common_band",
    "held_scale",
    "is_friction",
    "rows_of",
    "taken_about",
    "without_friction",
]

Array = NDArray[np.float64]

#: Error of integrators, gears and sensors that no hypothesis explains, as a fraction of the recorded torque's
#: rms [-]: residuals below it are no evidence of physics. Torque sensors are accurate to a few thousandths.
MODEL_ERROR = 3e-3
#: A row is compared where the mean weight within the band's filter is at least this.
MOSTLY = 0.5
TINY = 1e-300
#: Least noise of a torque relative to the largest one [-]: some may be recorded without any.
NOISELESS = 1e-3
#: Parameters of a joint other than its rotor, in this order: N m s/rad, N m, N m (or N s/m, N, N).
FRICTION = ("viscous", "coulomb", "offset")


@dataclass(frozen=True)
class Sample:
    """Samples of one recording that are compared, as prescribed by the caller.

    Attributes:
        time: [s], shape (K,).
        counted: mask of the compared samples by joint, shape (K,) each; joints not listed are not compared.
        cutoff: end of the band [Hz].
        smoothing: cut-off of the position filter [Hz].
    """

    time: Array
    counted: Mapping[str, NDArray[np.bool_]]
    cutoff: float
    smoothing: float

    def at(self, time: Array, joints: Sequence[str]) -> NDArray[np.bool_]:
        """Mask of compared instants at other times, by the nearest sample, shape (N, n)."""
        after = np.searchsorted(self.time, time).clip(1, self.time.size - 1)
        place = after - (time - self.time[after - 1] < self.time[after] - time)
        inside = (time >= self.time[0]) & (time <= self.time[-1])
        none = np.zeros(self.time.size, dtype=bool)
        return np.column_stack([self.counted.get(joint, none)[place] & inside for joint in joints])


@dataclass(frozen=True)
class Weights:
    """Weights of samples in the rows, from a first fit.

    Attributes:
        rest: weight of samples in which a joint may be at rest, shape (n,).
        residual: rms residual of the fit at each joint, shape (n,) [N m or N].
        reversals: whether samples near quick reversals are compared, too, with their friction as noise.
    """

    rest: Array
    residual: Array
    reversals: bool = False


@dataclass(frozen=True)
class Rows:
    """One recording in the band: K instants, n joints, P inertial parameters.

    Attributes:
        source: name of the recording.
        time: [s], shape (K,).
        torque: measured torque minus that of the robot's other effects, weighted by `shares`, shape (K, n).
        measured: recorded torque in the band, shape (K, n).
        inertial: derivatives of the torques by the inertial parameters, shape (K, n, P).
        friction: derivatives of each joint's torque by its `FRICTION`, shape (K, n, 3).
        counted: mask of the rows that are compared: the torque is known and the joint slides most of the
            time within the band's filter, shape (K, n).
        shares: weight with which each sample enters the rows, 0 to 1, shape (N, n): see `sliding`.
        noise: rms in the band of the noise of torques and encoders, shape (n,).
        nuisance: correlated noise; it is removed from torque and derivatives by inertial parameters.
        weights: those from which `shares` follow.
        shaken: rms in the band of the torque of links excited by encoder noise, shape (n,).
        scale: torque relative to which errors are judged, shape (K, n): the measured one; for an undriven
            joint the root sum of squares of its bodies' contributions, as these cancel each other.
    """

    source: str
    time: Array
    torque: Array
    measured: Array
    inertial: Array
    friction: Array
    counted: NDArray[np.bool_]
    shares: Array
    noise: Array
    scale: Array
    nuisance: Nuisance
    weights: Weights
    shaken: Array

    @property
    def samples(self) -> Array:
        """Number of samples that each row counts as, 0 to 1, shape (K, n)."""
        return np.where(self.counted, self.nuisance.left, 0.0)


def common_band(robot: Robot, recordings: Sequence[Recording]) -> float:
    """End of the band in which all these recordings can be compared [Hz]."""
    return min(motion_band(robot, recording) for recording in recordings)


def is_friction(effect: Effect) -> bool:
    """Whether an effect is a friction law at a joint, or a modifier of its joint's friction."""
    return effect.is_friction_law or effect.is_modifier


def without_friction(robot: Robot) -> Robot:
    """The robot without its friction laws and drive offsets, which the standard model replaces.

    Friction of joints moved through a transmission stays: the standard model has friction at motors only.
    """
    drives = {drive.name for drive in robot.drives}

    def stays(use: EffectUse) -> bool:
        effect = used_effects(robot.model_copy(update={"effects": (use,)}))[0].effect
        return (use.at not in drives and isinstance(effect, JointEffect)) or (
            not is_friction(effect) and effect.id != "torque_offset"
        )

    return robot.model_copy(update={"effects": tuple(use for use in robot.effects if stays(use))})


def rows_of(
    model: RobotModel,
    recording: Recording,
    cutoff: float,
    sample: Sample | None = None,
    about: Array | None = None,
    weights: Weights | None = None,
) -> Rows:
    """The rows of one recording, filtered and decimated to the band below `cutoff` [Hz].

    Args:
        model: of the robot without friction (`without_friction`).
        recording: must hold every moving joint's position.
        cutoff: end of the band [Hz].
        sample: samples that are compared; those in which joints slide when None.
        about: parameters of the standard model, shape (X,) or longer, at which the rows of undriven joints
            are linearised; the file's bodies without friction when None. Without actuators the total mass is
            not identifiable: the residual of a lighter robot is smaller in proportion. So the residual of
            these joints is divided by the scale s of the bodies, (Y phi + f) / s(phi).
        weights: of samples; when None, one where a joint slides and zero where it may be at rest.
    """
    motion = band_motion(model.robot, recording, cutoff, None if sample is None else sample.smoothing)
    motion = replace(motion, reversals=weights is not None and weights.reversals)
    along = Along.of(model, motion, _bodies(model, about))
    direction = motion.smooth(motion.direction)  # as the torque
    friction = np.stack([motion.velocity, direction, np.ones_like(motion.velocity)], axis=2)
    known = np.isfinite(motion.torque)
    inertial = along.regressor
    others = motion.smooth(torque_of_effects(along)) + along.constant(inertial)
    noise = np.hypot(_noise_in_band(along), motion.rounding)
    given = weights or Weights(np.zeros(noise.size), np.full(noise.size, np.inf))
    shares = motion.shares(prismatic(model.robot), given.rest) * motion.steadiness(given.residual)
    torque = motion.reduce(np.where(known, motion.torque, 0.0))
    scale = torque.copy()
    for k, joint in enumerate(model.joints):
        if is_passive(model.robot, recording, joint):
            file, columns = inertial_with_effects(model)[:-3], inertial[:, k, :-3]
            scale[:, k] = np.sqrt(np.sum(motion.reduce(columns * file) ** 2, axis=1))
            at, own = (file, np.zeros(len(FRICTION))) if about is None else _parts(about, file.size, k)
            held = held_scale(np.asarray(columns.any(axis=0)), file, len(body_names(model.robot)))
            left = columns @ at + friction[:, k] @ own + others[:, k]
            others[:, k] += left
            inertial[:, k, :-3] = columns - np.outer(left, held / max(float(held @ at), TINY))
    time = motion.time[motion.kept]
    if sample is None:
        counted = (motion.reduce(shares) > MOSTLY) & known.all(axis=0)
    else:
        counted = sample.at(time, model.joints) & known.all(axis=0)
    own = np.where(known, motion.smooth_torque, 0.0) - others
    nuisance, shaken = _nuisance(along, shares, counted, noise, given)
    return Rows(
        source=recording.source,
        time=time,
        torque=nuisance.removed(motion.reduce(own * shares)),
        measured=torque,
        inertial=nuisance.removed(motion.reduce(inertial * shares[:, :, None])),
        friction=motion.reduce(friction * shares[:, :, None]),
        counted=counted,
        shares=shares,
        noise=noise,
        scale=scale,
        nuisance=nuisance,
        weights=given,
        shaken=shaken,
    )


def taken_about(rows: Rows, along: Along) -> Rows:
    """The rows of a robot with free base or flexible links, linearised at the parameters of `along`."""
    motion, shares, inertial = along.motion, rows.shares, along.regressor
    others = motion.smooth(torque_of_effects(along)) + along.constant(inertial)
    own = np.where(np.isfinite(motion.torque), motion.smooth_torque, 0.0) - others
    nuisance, shaken = _nuisance(along, shares, rows.counted, rows.noise, rows.weights)
    return replace(
        rows,
        torque=nuisance.removed(motion.reduce(own * shares)),
        inertial=nuisance.removed(motion.reduce(inertial * shares[:, :, None])),
        nuisance=nuisance,
        shaken=shaken,
    )


def _nuisance(
    along: Along, shares: Array, counted: NDArray[np.bool_], noise: Array, weights: Weights
) -> tuple[Nuisance, Array]:
    """Correlated noise, and the rms of the links' vibration excited by encoder noise, shape (n,)."""
    full, spread = along.vibration()
    columns = along.motion.reduce(full * shares[:, :, None])
    floor = np.maximum(noise, NOISELESS * max(float(noise.max()), TINY))
    wandering = np.where(np.isfinite(spread), spread, 0.0)  # the start is removed wherever it is compared
    shaken = np.sqrt(np.mean(((columns * wandering) ** 2).sum(axis=2), axis=0))
    reversals = _reversals(along.motion, shares, counted, weights)
    whitened = Nuisance(Vibration.of(columns[:, :, :0], counted / floor**2), reversals)
    links = Vibration.of(whitened.without_reversals(columns), counted / floor**2, spread)
    return Nuisance(links, reversals), shaken


def _reversals(
    motion: BandMotion, shares: Array, counted: NDArray[np.bool_], weights: Weights
) -> tuple[Vibration, ...]:
    """Unknown friction of each joint at its quick reversals, in units of the noise of its torque."""
    if not weights.reversals:
        return ()
    found = []
    for k, weight in enumerate(weights.rest):
        level = np.sqrt((1.0 - weight) / weight) if weight > 0.0 else 0.0  # see `sliding.determined`
        columns = motion.reduce(level * motion.in_cells(k) * shares[:, [k]])[:, None, :]
        mask = counted[:, [k]].astype(float)
        found.append(Vibration.of(columns, mask, np.ones(columns.shape[2])))
    return tuple(found)


def _bodies(model: RobotModel, about: Array | None) -> Array:
    """Inertial parameters for the motion: the given ones for free bases and flexible links, or the file's."""
    found = inertial_with_effects(model)
    if about is not None and (model.tree.modal or model.free_base):
        found[:-3] = about[: found.size - 3]
    return found


def _parts(numbers: Array, count: int, joint: int) -> tuple[Array, Array]:
    """Inertial parameters without gravity, and one joint's friction, from the standard model's parameters."""
    first = count + 3 + joint * len(FRICTION)
    return numbers[:count], numbers[first : first + len(FRICTION)]


def held_scale(active: NDArray[np.bool_], file: Array, bodies: int) -> Array:
    """Derivative by the inertial parameters of the bodies' scale s, one at the file's values, shape (P,).

    Args:
        active: mask of the parameters that affect the motion, shape (P,); the others do not enter the scale.
        file: parameters of the robot file, shape (P,).
        bodies: number of bodies, whose parameters come first.
    """
    size = np.where(file == 0.0, np.inf, np.abs(file))
    for first in range(0, COUNT * bodies, COUNT):
        ten = file[first : first + COUNT]
        if ten[0] > 0.0 and ten[4:7].max() > 0.0:
            size[first : first + COUNT] = sizes(ten)
    weighted = np.where(active, file / size**2, 0.0)
    return np.asarray(weighted / max(float(weighted @ file), TINY))


def prismatic(robot: Robot) -> NDArray[np.bool_]:
    """Mask of the prismatic moving joints, shape (n,)."""
    return np.array([joint.kind == "prismatic" for joint in robot.drives])


def _noise_in_band(along: Along) -> Array:
    """rms in the band of the noise of torques and encoders, shape (n,).

    Only the part of the white torque noise in the band remains. Position noise becomes acceleration noise,
    (2 pi f)^2 times as large at each frequency, multiplied by the mass matrix; velocity noise enters through
    friction, which is smaller at these frequencies.
    """
    motion = along.motion
    white = motion.torque_noise * np.sqrt(min(1.0, 2.0 * motion.cutoff / motion.sampling))
    ratio = 2.0 * np.pi * np.sqrt((motion.cutoff**5 / 5.0) / (motion.smoothing**3 / 3.0))
    inertia = np.sqrt(np.mean(along.mass**2, axis=0))
    return np.hypot(white, np.sqrt(inertia**2 @ (ratio * motion.velocity_noise) ** 2))

"""The standard model fitted by the likelihood, before anything else is asked of it.

On a real machine the estimates have to agree with weighted least squares in the band of the motion, and what
is left has to be white; else nothing that is built on this likelihood can be believed. Beside the numbers of
the standard model it has one of each set of recordings: how much later than the recorded torque the motion
answers, since torque and position rarely belong to the same instant (a held command, a filtered current, two
buses).

The columns are taken along positions as an encoder tells them, smoothed without any dynamics. What the
smoother lets through of the encoder's noise is in the residual as well and pulls the timing towards later:
by 0.2 of a sample where the noise is 1e-6 rad on an arm at 500 Hz, by half of one at 5e-6 rad. A course from
the smoother of the fitted model has to take its place before effects are selected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.special import erf
from threadpoolctl import threadpool_limits

from missing_physics.checks.actuation import actuator_torque
from missing_physics.inference.corners import Scored, best_errors
from missing_physics.likelihood.bands import Bands, Spectrum
from missing_physics.likelihood.evidence import JointSums, ModelError, Posterior, Prior, posterior
from missing_physics.likelihood.gram import Gram, Whitener
from missing_physics.likelihood.weights import Unsure, unsure
from missing_physics.standard import StandardModel
from missing_physics.standard.bodies import divergence
from missing_physics.standard.rows import FRICTION, without_friction
from missing_physics.statespace.course import first_course
from missing_physics.statespace.plant import Plant, under_triangle
from missing_physics.statespace.signals import Signals
from reference_model.model import RobotModel
from robot_model import Recording, Robot

__all__ = ["JointFit", "StandardHypothesis", "fit_standard_hypothesis"]

Array = NDArray[np.float64]

#: Prior standard deviation of the offset between torque and position [samples]: it lies between -2 and 2.
OFFSET = 1.0
#: Rounds in which the torque is shifted by what was found, and the shift [samples] that is not worth another.
ROUNDS, AGREED = 4, 0.02


@dataclass(frozen=True)
class JointFit:
    """What the likelihood found at one joint.

    Attributes:
        estimates: viscous and Coulomb friction and offset: value and standard deviation each.
        error: corners of the model's error.
        unsure: where friction is unsure.
        chi_square: power of the whitened residual over its level, one where the model is adequate.
        octaves: the same of each octave from the slowest.
    """

    estimates: dict[str, tuple[float, float]]
    error: ModelError
    unsure: Unsure
    chi_square: float
    octaves: Array


@dataclass(frozen=True)
class StandardHypothesis:
    """The standard model by the likelihood.

    Attributes:
        joints: by name, of those that slide with their torque known.
        timing: how much later than the recorded torque the motion answers, and its standard deviation [s].
        step: sample time [s].
        log_evidence: natural logarithm of the evidence, up to a constant of the data.
    """

    joints: dict[str, JointFit]
    timing: tuple[float, float]
    step: float
    log_evidence: float


@threadpool_limits.wrap(limits=1, user_api="blas")
def fit_standard_hypothesis(start: StandardModel, recordings: Sequence[Recording]) -> StandardHypothesis:
    """Fit the standard model by its likelihood.

    Args:
        start: by weighted least squares; the likelihood is linear about it.
        recordings: those that `start` was fitted to.
    """
    model = RobotModel(without_friction(start.nominal))
    late = 0.0
    for _ in range(ROUNDS):
        plants = [_plant(model, start, recording, late) for recording in recordings]
        found = _fitted(start, plants, late)
        further = found.timing[0] - late
        late = found.timing[0]
        if abs(further) < AGREED * found.step:
            break
    return found


def _fitted(start: StandardModel, plants: Sequence[Plant], late: float) -> StandardHypothesis:
    """The fit along these plants, whose torque acts `late` [s] later than it was recorded."""
    layout, step = start.estimate.layout, plants[0].signals.step
    free = np.flatnonzero(layout.free)
    bands = Bands.of(max(len(p.unexplained) for p in plants) * step, 1.0 / step)
    names = [name for name in plants[0].joints if layout.free[layout.names.index(f"{name}.viscous")]]
    pairs = [_joint(start, plants, plants[0].joints.index(name), free, bands) for name in names]
    sums = [own for own, _ in pairs]
    prior = _prior(start, free, step, late)

    def scored(errors: tuple[ModelError, ...]) -> Scored[Posterior]:
        found = posterior(sums, prior, errors)
        return Scored(found.log_evidence, found)

    errors, found = best_errors(len(sums), 2.0 * start.cutoff, scored)
    spread = np.sqrt(np.diag(found.covariance))
    joints = {}
    for name, (own, slow), error, energy in zip(names, pairs, errors, found.energies):
        places = {kind: layout.names.index(f"{name}.{kind}") for kind in FRICTION}
        at = {kind: int(np.searchsorted(free, place)) for kind, place in places.items()}
        estimates = {
            kind: (float(start.estimate.values[place] + found.mean[at[kind]]), float(spread[at[kind]]))
            for kind, place in places.items()
        }
        count = own.gram.count
        chi_square = float(np.sum(energy * count) / np.sum(count))
        joints[name] = JointFit(estimates, error, slow, chi_square, _octaves(energy, count))
    timing = late + float(found.mean[-1]), float(spread[-1])
    return StandardHypothesis(joints, timing, step, found.log_evidence)


def _plant(model: RobotModel, start: StandardModel, recording: Recording, late: float) -> Plant:
    """Along a recording of which the torque acts `late` [s] later than it says."""
    signals = Signals.of(start.nominal, recording)
    course = first_course(signals)
    signals = _less_back_emf(start.nominal, recording, signals, course.velocity)
    if late:
        inside = np.clip(signals.time - late, signals.time[0], signals.time[-1])
        known = np.nan_to_num(signals.torque)
        acted = np.asarray(make_interp_spline(signals.time, known, k=3)(inside))
        signals = replace(signals, torque=np.where(np.isfinite(signals.torque), acted, np.nan))
    return Plant.along(model, signals, course, start.estimate.values[: len(model.inertial_names)])


def _less_back_emf(robot: Robot, recording: Recording, signals: Signals, velocity: Array) -> Signals:
    """Torque of joints of which only the voltage is known, with the back-EMF taken away."""
    torque = signals.torque.copy()
    for k, joint in enumerate(robot.moving_joints):
        channel, _ = actuator_torque(robot, recording, joint.name)
        motor = joint.actuator
        if channel and channel.endswith(".voltage") and motor and motor.torque_constant and motor.resistance:
            per_speed = (motor.gear_ratio * motor.torque_constant) ** 2 / motor.resistance
            torque[:, k] -= per_speed * velocity[:, k]
    return replace(signals, torque=torque)


@dataclass(frozen=True)
class _Columns:
    """Of one joint along one recording, M samples: residual, derivatives, explained forces, velocity."""

    residual: Array
    derivatives: Array
    forces: Array
    velocity: Array


def _joint(
    start: StandardModel, plants: Sequence[Plant], k: int, free: NDArray[np.int_], bands: Bands
) -> tuple[JointSums, Unsure]:
    """Band sums of joint k over all recordings."""
    rate = 1.0 / plants[0].signals.step
    places = _places(plants, k, free)
    columns = [_columns(start, plant, k, free[places]) for plant in plants]
    spectrum = _spectrum([c.residual for c in columns], bands, rate)
    plain = [Whitener(spectrum, np.ones(len(c.residual)), rate) for c in columns]
    white = [w.series(c.residual[:, None])[:, 0] for w, c in zip(plain, columns)]
    slow = unsure(white, [c.velocity[-len(w) :] for c, w in zip(columns, white)])
    grams = []
    for c in columns:
        whitener = Whitener(spectrum, 1.0 / np.sqrt(slow.variance(c.velocity)), rate)
        grams.append(Gram.of(whitener, np.column_stack([c.residual, c.derivatives, c.forces])))
    inertial = sum(not name.endswith(FRICTION) for name in start.estimate.layout.names)
    law = np.append(free[places] >= inertial, False)  # the last one is the timing's
    gram = sum(grams[1:], grams[0])
    sums = JointSums(gram, np.append(places, free.size), bands.centres, np.array([False, True, True]), law)
    return sums, slow


def _places(plants: Sequence[Plant], k: int, free: NDArray[np.int_]) -> NDArray[np.int_]:
    """Which of the free parameters joint k's torque depends on."""
    count = plants[0].regressor.shape[2]
    felt = np.max([np.abs(p.regressor[:, k]).max(axis=0) for p in plants], axis=0) > 0.0
    first = count + k * len(FRICTION)
    own = (free >= first) & (free < first + len(FRICTION))
    return np.flatnonzero(own | ((free < count) & felt[np.minimum(free, count - 1)]))


def _columns(start: StandardModel, plant: Plant, k: int, places: NDArray[np.int_]) -> _Columns:
    count = plant.regressor.shape[2]
    first = count + k * len(FRICTION)
    velocity, spread = plant.course.velocity[:, k], np.maximum(plant.course.spread[:, k], 1e-12)
    direction = erf(velocity / (np.sqrt(2.0) * spread))
    friction = under_triangle(np.column_stack([velocity, direction, np.ones_like(velocity)]))
    values = start.estimate.values
    parts = friction * values[first : first + len(FRICTION)]
    bodies = plant.regressor[:, k] @ values[:count]
    whole = np.column_stack([plant.regressor[:, k], friction])
    local = np.where(places < count, places, places - first + count)
    late = np.gradient(bodies + parts.sum(axis=1), plant.signals.step)
    return _Columns(
        residual=plant.unexplained[:, k] - parts.sum(axis=1),
        derivatives=np.column_stack([whole[:, local], late]),
        forces=np.column_stack([bodies, parts[:, :2]]),
        velocity=velocity[1:-1],
    )


def _spectrum(residuals: Sequence[Array], bands: Bands, rate: float) -> Spectrum:
    """Mean power of the residuals in each band; bands without a bin get that between their neighbours."""
    total, count = np.zeros(bands.count), np.zeros(bands.count)
    for residual in residuals:
        power = np.abs(np.fft.rfft(residual)) ** 2 / residual.size
        for b, part in enumerate(bands.parts(residual.size, rate)):
            total[b] += power[part].sum()
            count[b] += part.stop - part.start
    good = (count > 0) & (total > 0)
    logs = np.log(total[good] / count[good])
    return Spectrum(bands, np.exp(np.interp(np.log(bands.centres), np.log(bands.centres[good]), logs)))


def _prior(start: StandardModel, free: NDArray[np.int_], step: float, late: float) -> Prior:
    """That of the standard model near its estimate, and that of the timing."""
    layout, values, width = start.estimate.layout, start.estimate.values, start.estimate.width
    precision, pull = np.zeros((values.size, values.size)), np.zeros(values.size)
    for place in layout.bodies:
        _, slope, curvature = divergence(values[place], layout.start[place])
        precision[place, place] += curvature / width**2
        pull[place] -= slope / width**2
    own = layout.own
    precision[own, own] += 1.0 / layout.size[own] ** 2
    pull[own] -= values[own] / layout.size[own] ** 2
    size = free.size + 1
    whole = np.zeros((size, size))
    whole[:-1, :-1] = precision[np.ix_(free, free)]
    whole[-1, -1] = 1.0 / (OFFSET * step) ** 2
    return Prior(whole, np.append(pull[free], -late * whole[-1, -1]), 0.0)


def _octaves(energy: Array, count: Array) -> Array:
    """Mean of pairs of bands, the slowest first."""
    pairs = range(0, energy.size - 1, 2)
    return np.array(
        [np.sum((energy * count)[b : b + 2]) / max(np.sum(count[b : b + 2]), 1e-300) for b in pairs]
    )

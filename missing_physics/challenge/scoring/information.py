"""Whether a hidden effect is identifiable, judged from the true model and independent of any answer.

The recording's torque residual has independent Gaussian coefficients in the cosine basis, with the spectrum
that follows from torque noise and position noise (differentiated twice by the inverse dynamics): Whittle's
likelihood. In these whitened coefficients the Fisher information of a parameter is the energy of its column.
The distance of an effect is the energy of its torque that neither plausible errors of the nominal robot nor
a rival effect can explain, nor an offset of up to 1.5 samples between torques and positions, which is
timing and not physics: twice the log-likelihood by which the best substitute falls short. What
effects of base and environment do to other sensors than those of torque is not counted, so that a few are
rated less identifiable than they are. Effects in a gear are treated in `gear_information`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from missing_physics.challenge.scoring.gear_information import gear_distance
from missing_physics.challenge.torques.along import ArmAlong
from reference_model.effects.base import BodyEffect, Effect, Extent, GearEffect, SensorEffect
from reference_model.effects.catalogue import catalogue, get_effect
from robot_model import EffectUse, Robot, Sensor

__all__ = ["IDENTIFIABLE", "distances", "strengths"]

Array = NDArray[np.float64]

#: Twice the log-likelihood that raises one among 60 rivals (some twenty effects at three places) to a
#: probability of 95 %, 2 log(60 * 19) = 14, and as much again because a quarter of the data is held out and
#: the filters of a practical diagnosis lose some.
IDENTIFIABLE = 28.0
#: Plausible relative standard deviation of the error of a nominal parameter.
PLAUSIBLE = 0.3
#: The same for nominal friction, which is uncertain.
FRICTION = 1.0
#: Largest offset between torque and position due to timing [samples]: a held command, a filtered current,
#: a bus that is read once per sample.
OFFSET = 1.5
#: Step of a numerical derivative, relative to the parameter.
STEP = 1e-4
#: Maximum number of starting values per rival.
STARTS = 6


def distances(along: ArmAlong, hidden: Sequence[EffectUse]) -> dict[str, float]:
    """Distance of each hidden effect from its nearest substitute, by `ID@PLACE`.

    Args:
        along: the nominal robot along the exact motion, with the sensors that recorded it.
        hidden: the hidden effects.
    """
    whiten = _Whitening(along)
    found = {}
    for use in hidden:
        if isinstance(get_effect(use.effect), GearEffect):
            found[f"{use.effect}@{use.at}"] = gear_distance(along, use)
            continue
        target, nuisance = _target_and_nuisance(along, hidden, use, whiten)
        late = whiten(-np.gradient(along.torque, axis=0))
        nearest = [_residual_energy(target, nuisance, np.zeros((target.size, 0)), late=late)]
        for rival in _rivals(along, use):
            nearest.append(_residual_energy(target, nuisance, whiten.columns(rival), late=late))
        found[f"{use.effect}@{use.at}"] = float(min(nearest))
    return found


def strengths(along: ArmAlong, hidden: Sequence[EffectUse]) -> dict[str, float]:
    """Distance of each hidden effect from noise and plausible nominal errors alone, without rivals."""
    whiten = _Whitening(along)
    parts = {f"{use.effect}@{use.at}": _target_and_nuisance(along, hidden, use, whiten) for use in hidden}
    return {
        label: _residual_energy(target, prior, np.zeros((target.size, 0)))
        for label, (target, prior) in parts.items()
    }


def _target_and_nuisance(
    along: ArmAlong, hidden: Sequence[EffectUse], use: EffectUse, whiten: _Whitening
) -> tuple[Array, Array]:
    """Torque of a hidden effect, and columns of the other uncertain quantities."""
    others = [other for other in hidden if other is not use]
    nuisance = whiten.columns([*_nominal_columns(along, use), *_other_columns(along, others)])
    return whiten(along.part(use)), nuisance


class _Whitening:
    """Map from torques, shape (N, n), to coefficients with unit noise."""

    def __init__(self, along: ArmAlong) -> None:
        robot, time = along.robot, along.time
        frequency = np.arange(len(time)) / (2 * float(time[-1] - time[0]))
        w = 2 * np.pi * frequency[:, None]
        self._rows = [k for k, joint in enumerate(along.joints) if robot.sensor(f"{joint}.torque")]
        size = [np.sqrt(np.mean(np.einsum("tii->ti", j) ** 2, axis=0)) for j in along.inertance]
        torque = np.array([_variance(robot.sensor(f"{joint}.torque")) for joint in along.joints])
        position = np.array([_variance(robot.sensor(f"{joint}.position")) for joint in along.joints])
        spectrum = torque + position * ((size[0] + size[2] * w**2) ** 2 + (size[1] * w) ** 2)
        self._scale = 1 / np.sqrt(np.maximum(spectrum, 1e-300))

    def __call__(self, values: Array) -> Array:
        coefficients = dct(values, axis=0, norm="ortho") * self._scale
        return np.asarray(coefficients[:, self._rows].ravel())

    def columns(self, parts: Sequence[Array]) -> Array:
        made = [self(part) for part in parts]
        return np.column_stack(made) if made else np.zeros((self._scale[:, self._rows].size, 0))


def _variance(sensor: Sensor | None) -> float:
    return sensor.noise**2 + sensor.resolution**2 / 12 if sensor else 0.0


def _residual_energy(target: Array, prior: Array, free: Array, *, late: Array | None = None) -> float:
    """min |target - late c - prior a - free b|^2 + |a|^2 over a, b and |c| <= `OFFSET`.

    The energy that neither plausible errors nor a rival explain; `late` is the effect of a delay of all
    torques by one sample, if allowed.
    """
    columns = np.column_stack([target, np.zeros_like(target) if late is None else late])
    (energy, shared), (_, other) = _quadratic_form(columns, prior, free)
    offset = float(np.clip(shared / other, -OFFSET, OFFSET)) if other > 0 else 0.0
    return float(max(energy - 2 * offset * shared + offset**2 * other, 0.0))


def _quadratic_form(targets: Array, prior: Array, free: Array) -> Array:
    """Products of the residuals of `targets`, shape (N, m), after projection on the others: (m, m)."""
    both = np.hstack([prior, free])
    if both.shape[1] == 0:
        return np.asarray(targets.T @ targets)
    damping = np.diag([*np.ones(prior.shape[1]), *np.zeros(free.shape[1])])
    size = np.sqrt(np.maximum((both**2).sum(0) + np.diag(damping), 1e-300))
    normal = (both.T @ both + damping) / np.outer(size, size)
    right = (both.T @ targets) / size[:, None]
    values, vectors = np.linalg.eigh(normal)
    kept = values > 1e-12 * values[-1]
    taken = vectors[:, kept].T @ right
    return np.asarray(targets.T @ targets - taken.T @ (taken / values[kept][:, None]))


def _nominal_columns(along: ArmAlong, use: EffectUse) -> Iterator[Array]:
    """Plausible errors of the nominal robot, except of a body whose own change is hidden."""
    own = use.at if isinstance(get_effect(use.effect), BodyEffect) else ""
    numbers = dict(zip(along.model.inertial_names, along.model.inertial))
    largest: dict[str, float] = {}
    for name, value in numbers.items():
        group = ".".join(name.split(".")[:2])
        largest[group] = max(largest.get(group, 0.0), abs(float(value)))
    for k, name in enumerate(along.model.inertial_names):
        body = name.split(".")[0]
        if body not in (own, "gravity"):
            yield PLAUSIBLE * largest[".".join(name.split(".")[:2])] * along.regressor[:, :, k]
    for column in along.beam_columns:
        yield PLAUSIBLE * column
    for nominal in along.robot.effects:
        yield FRICTION * along.part(nominal)


def _other_columns(along: ArmAlong, others: Sequence[EffectUse]) -> Iterator[Array]:
    """Derivatives with respect to the parameters of the other hidden effects, each with 100 % uncertainty."""
    for other in others:
        for parameter in get_effect(other.effect).estimated:
            value = other.parameters.get(parameter.name, 0.0)
            step = STEP * (abs(value) or parameter.typical)
            up, down = (_changed(other, parameter.name, value + s) for s in (step, -step))
            yield (along.part(up) - along.part(down)) / (2 * step) * (abs(value) or parameter.typical)


def _changed(use: EffectUse, name: str, value: float) -> EffectUse:
    return use.model_copy(update={name: value})


def _rivals(along: ArmAlong, use: EffectUse) -> Iterator[list[Array]]:
    """Columns of every simpler or equally simple effect that the catalogue lists as similar to this one.

    The same error of another sensor is similar as well, except a delay, which would have to be negative.
    """
    effect = get_effect(use.effect)
    for other in catalogue().values():
        kin = other.id in (*effect.confused_with, *effect.simpler) or effect.id in other.confused_with
        family = effect.family is not None and other.family == effect.family
        twin = other.id == effect.id and isinstance(effect, SensorEffect) and other.id != "sensor_delay"
        if not (kin or family or twin) or other.is_event or not other.along_motion:
            continue
        if isinstance(other, GearEffect):  # appears between two encoders, not in a torque
            continue
        if len(other.estimated) > len(effect.estimated):
            continue
        for at in _places(along.robot, other, use.at):
            if other.id == effect.id and (at == use.at or not twin):
                continue
            yield from _columns_of(along, other, at)


def _places(robot: Robot, effect: Effect, at: str) -> list[str]:
    """Places of a rival that acts at the same joint."""
    joint = _joint_of(robot, at)
    if effect.place == "base":
        return ["base"]
    if isinstance(effect, BodyEffect):
        return [j.child for j in robot.moving_joints if joint in ("base", j.name)]
    if joint == "base":
        return []
    if isinstance(effect, SensorEffect):
        return [f"{joint}.{quantity}" for quantity in ("torque", "position")]
    return [joint]


def _joint_of(robot: Robot, at: str) -> str:
    """The joint at which a place appears; `base` for the base."""
    place = at.split(".")[0]
    for joint in robot.joints:
        if place in (joint.name, joint.child):
            return joint.name
    return "base"


def _columns_of(along: ArmAlong, effect: Effect, at: str) -> Iterator[list[Array]]:
    """First-order columns of the effect, for each starting value of its other parameters."""
    k = along.joints.index(j) if (j := _joint_of(along.robot, at)) in along.joints else 0
    for start in list(effect.starts(_extent(along, k)))[:STARTS]:
        absent = {p.name: p.absent for p in effect.parameters if p.absent is not None and p.name not in start}
        fixed = {p.name: p.default if p.default is not None else p.typical for p in effect.parameters}
        values = {**fixed, **absent, **start}
        columns = []
        for parameter in effect.estimated:
            if parameter.absent is None or parameter.name in start:
                continue
            one = {**values, parameter.name: parameter.typical}
            columns.append(along.part(EffectUse.model_validate({"effect": effect.id, "at": at, **one})))
        if columns:
            yield columns


def _extent(along: ArmAlong, k: int) -> Extent:
    position, velocity = along.state[0][:, k], np.abs(along.state[1][:, k])
    joint = along.robot.moving_joints[k]
    return Extent(
        position=(float(position.min()), float(position.max())),
        speed=float(velocity.max()),
        slow=float(np.quantile(velocity, 0.1)),
        torque=float(np.sqrt(np.mean(along.torque[:, k] ** 2))),
        residual=float(np.sqrt(np.mean((along.torque - along.nominal())[:, k] ** 2))),
        duration=float(along.time[-1]),
        sample_time=float(along.time[1] - along.time[0]),
        gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
        peak_torque=float(np.abs(along.torque[:, k]).max()),
    )

"""The usual identification model: base inertial parameters, rotors, viscous and Coulomb friction, offsets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from missing_physics.checks.actuation import is_passive
from missing_physics.standard.bending import model_of
from missing_physics.standard.fit import Estimate, design_of, estimate, weights_of
from missing_physics.standard.prediction import inertial_with_effects
from missing_physics.standard.rows import (
    FRICTION,
    Rows,
    Sample,
    Weights,
    common_band,
    rows_of,
    without_friction,
)
from reference_model.dynamics.inertial import BODY_NUMBERS, body_names
from reference_model.effects.base import BodyEffect
from reference_model.effects.catalogue import used_effects
from reference_model.evaluation.model import RobotModel
from reference_model.flexible.beam_numbers import POSITIVE, beam_with
from robot_model import EffectUse, InputError, Recording, Robot

__all__ = [
    "AGREED",
    "EFFECTS",
    "HALVINGS",
    "JointErrors",
    "StandardModel",
    "as_robot",
    "fit_standard",
    "use_of",
]

Array = NDArray[np.float64]
#: Stretches of time [s], first and last instant of each.
Windows = Sequence[tuple[float, float]]

#: Effect and parameter of each friction parameter of the fit in a robot file, and its sign there.
EFFECTS = {
    "viscous": ("viscous_friction", "coefficient", 1.0),
    "coulomb": ("coulomb_friction", "torque", 1.0),
    "offset": ("torque_offset", "torque", -1.0),
}
#: Most linearisation rounds for flexible links, step halvings in one round, and the decrease of the squared
#: residual, in units of its variance, below which they end.
BENDING_ROUNDS, HALVINGS, AGREED = 12, 5, 1.0
#: Rounds of linearisation at the estimate.
ROUNDS = 2
#: Digits of a number in a robot file.
DIGITS = 10


@dataclass(frozen=True)
class JointErrors:
    """rms of measured minus predicted torque of one joint where it slides [N m or N].

    NaN where no sample of the joint counts.
    """

    nominal: float
    standard: float
    noise: float
    measured: float


@dataclass(frozen=True)
class StandardModel:
    """The standard model of one robot.

    Attributes:
        robot: the robot file with the standard model's parameters.
        estimate: the fit.
        cutoff: end of the band in which it was fitted [Hz].
        nominal: the given robot file.
        weights: of samples, from a first fit.
    """

    robot: Robot
    estimate: Estimate
    cutoff: float
    nominal: Robot
    weights: Weights

    def errors(self, recordings: Sequence[Recording]) -> Mapping[str, JointErrors]:
        """Errors of each moving joint over these recordings, in the band of the fit."""
        model, named = model_of(without_friction(self.nominal)), model_of(self.nominal)
        about, weights = self.estimate.values, self.weights
        parts = [rows_of(model, r, self.cutoff, about=about, weights=weights) for r in recordings]
        before = [rows_of(named, r, self.cutoff, weights=weights) for r in recordings]
        start = inertial_with_effects(named)
        found = {}
        for k, joint in enumerate(model.joints):
            counted = [r.counted[:, k] for r in parts]
            after = [self.estimate.residual(r)[c, k] for r, c in zip(parts, counted)]
            left = [(r.torque - _product(r.inertial, start))[c, k] for r, c in zip(before, counted)]
            whole = [r.measured[c, k] for r, c in zip(parts, counted)]
            noise = float(np.mean([r.noise[k] for r in parts])) if parts else float("nan")
            found[joint] = JointErrors(_rms(left), _rms(after), noise, _rms(whole))
        return found


@threadpool_limits.wrap(limits=1, user_api="blas")
def fit_standard(
    robot: Robot,
    recordings: Sequence[Recording],
    *,
    cutoff: float | None = None,
    held_out: Sequence[Windows] = (),
    samples: Sequence[Sample] = (),
) -> StandardModel:
    """Fit the standard model.

    Args:
        robot: the nominal robot; its friction laws and drive offsets are replaced, its other effects stay.
        recordings: those that are fitted.
        cutoff: end of the band [Hz]; five times the motion's bandwidth when None.
        held_out: time intervals of each recording that are not fitted [s].
        samples: samples of each recording in which other models are compared with this one. It is then fitted
            to the same samples, in the narrowest of their bands. In a narrower band, parameters with effects
            above it would be undetermined, and masses fitted to the counted joints would be judged at others.

    Raises:
        InputError: a joint's position is not recorded, no joint slides with its torque known, or these
            recordings do not determine the model.
    """
    stripped = without_friction(robot)
    model = model_of(stripped)
    if cutoff is None and samples:
        cutoff = min(sample.cutoff for sample in samples)
    band = common_band(robot, recordings) if cutoff is None else cutoff
    asked: Sequence[Sample | None] = samples or [None] * len(recordings)

    def taken(weights: Weights, about: Array | None = None) -> list[Rows]:
        found = [
            rows_of(model, r, band, own, about, weights) for r, own in zip(recordings, asked, strict=True)
        ]
        if held_out:
            found = [_without(r, windows) for r, windows in zip(found, held_out, strict=True)]
        return found

    joints = len(model.joints)
    rows = taken(Weights(np.ones(joints), np.full(joints, np.inf)))
    if not any(r.counted.any() for r in rows):
        raise InputError(
            "no joint moves while its torque is known, so that the standard model cannot be fitted; record "
            "torque, current or voltage of the joints (JOINT.torque in the map)."
        )
    try:
        nominal = inertial_with_effects(model)
        weights = weights_of(model, nominal, rows, _dry(robot))
        found = estimate(model, nominal, taken(weights))
        for _ in range(ROUNDS if _has_passive(robot, recordings) else 0):
            found = estimate(model, nominal, taken(weights, found.values))
        if model.tree.modal or model.free_base:
            found = _iterated(model, nominal, found, lambda about: taken(weights, about))
    except np.linalg.LinAlgError:
        raise InputError(
            "the standard model cannot be identified: these recordings do not determine its parameters; "
            "record a motion that moves more joints, and faster."
        ) from None
    numbers = dict(zip(found.layout.names, map(float, found.values)))
    return StandardModel(as_robot(stripped, model, numbers), found, band, robot, weights)


def _iterated(
    model: RobotModel, nominal: Array, first: Estimate, taken: Callable[[Array], list[Rows]]
) -> Estimate:
    """The estimate with a free base or flexible links, linearised at itself.

    The phase of a vibration, and the motion of a base, are linear in masses and stiffness only for small
    changes. So a step is halved until the recordings, linearised at its end, are predicted better.
    """
    place, found, count = nominal.copy(), first, nominal.size - 3
    rows = taken(nominal)
    for _ in range(BENDING_ROUNDS):
        step, before = found.values[:count] - place[:count], _misfit(found, place, rows)
        for _ in range(HALVINGS):
            candidate = place.copy()
            candidate[:count] += step
            moved = taken(candidate)
            after = _misfit(found, candidate, moved)
            if after < before:
                break
            step = 0.5 * step
        else:
            return found
        place, rows = candidate, moved
        found = estimate(model, nominal, rows)
        if before - after < AGREED:
            break
    return found


def _misfit(found: Estimate, inertial: Array, rows: Sequence[Rows]) -> float:
    """Squared residual with these inertial parameters and the best friction, in units of `sigma`."""
    total, count = 0.0, inertial.size
    for own in rows:
        design = np.where(own.counted[:, :, None], design_of(own), 0.0) / found.sigma[:, None]
        target = np.where(own.counted, own.torque, 0.0) / found.sigma
        left = (target - design[:, :, : count - 3] @ inertial[:-3]).ravel()
        others = design[:, :, count:].reshape(left.size, -1)
        total += float(np.sum((left - others @ np.linalg.lstsq(others, left, rcond=None)[0]) ** 2))
    return total


def _dry(robot: Robot) -> Array:
    """Dry friction of each drive in the robot file: the largest level of its laws, shape (n,)."""
    found = np.zeros(len(robot.drives))
    for used in used_effects(robot):
        effect = used.effect
        if effect.is_friction_law:
            levels = [used.parameters[p.name] for p in effect.parameters if p.unit == "N m"]
            places = [k for k, drive in enumerate(robot.drives) if drive.name == used.at]
            found[places] = np.maximum(found[places], max(levels, default=0.0))
    return found


def _has_passive(robot: Robot, recordings: Sequence[Recording]) -> bool:
    return any(is_passive(robot, recording, joint.name) for recording in recordings for joint in robot.drives)


def _without(rows: Rows, windows: Windows) -> Rows:
    """`rows` without those inside `windows` [s]."""
    inside = np.zeros(rows.time.size, dtype=bool)
    for first, last in windows:
        inside |= (rows.time >= first) & (rows.time <= last)
    return replace(rows, counted=rows.counted & ~inside[:, None])


def as_robot(stripped: Robot, model: RobotModel, numbers: Mapping[str, float]) -> Robot:
    """The robot file with these parameters of the standard model.

    Args:
        stripped: the robot `without_friction`.
        model: its dynamics.
        numbers: parameter values by the names of the layout.
    """
    kept = [
        use
        for use, used in zip(stripped.effects, used_effects(stripped))
        if not isinstance(used.effect, BodyEffect)
    ]
    data = stripped.model_dump(mode="python")
    names = body_names(stripped)
    bodies = {"base": data["base"], **{link["name"]: link for link in data["links"]}}
    for body in names:
        if numbers[f"{body}.mass"] > 0.0:
            bodies[body].update(_body([numbers[f"{body}.{number}"] for number in BODY_NUMBERS]))
    for link in stripped.links:
        mine = {f"{link.name}.{number}": number for number in POSITIVE}
        beam = {mine[name]: _short(value) for name, value in numbers.items() if name in mine}
        if beam and link.beam is not None:
            bodies[link.name]["beam"].update(beam_with(link.beam, beam))
    own = [(joint["name"], joint["actuator"]) for joint in data["joints"] if joint["actuator"] is not None]
    own += [(motor["name"], motor) for one in data["transmissions"] for motor in one["motors"]]
    for name, motor in own:
        if name in model.joints:
            reflected = numbers[f"{name}.reflected_inertia"]
            motor["rotor_inertia"] = _short(reflected / motor["gear_ratio"] ** 2)
    data["gravity"] = tuple(_short(numbers[f"gravity.{axis}"]) for axis in "xyz")
    uses = [
        use_of(effect, joint, {key: sign * numbers[f"{joint}.{kind}"]})
        for joint in model.joints
        for kind in FRICTION
        for effect, key, sign in [EFFECTS[kind]]
    ]
    return Robot.model_validate(data).model_copy(update={"effects": (*kept, *uses)})


def _body(ten: Sequence[float]) -> dict[str, object]:
    """Mass, centre and central inertia from the ten parameters about the frame's origin."""
    mass, centre = ten[0], np.array(ten[1:4]) / ten[0]
    xx, yy, zz, xy, xz, yz = ten[4:]
    origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    central = origin - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return {
        "mass": _short(mass),
        "center_of_mass": tuple(_short(c) for c in centre),
        "inertia": tuple(_short(central[pair]) for pair in pairs),
    }


def use_of(effect: str, at: str, values: Mapping[str, float]) -> EffectUse:
    """An effect in a robot file, with its parameters rounded to `DIGITS` digits."""
    return EffectUse(effect=effect, at=at, **{name: _short(value) for name, value in values.items()})


def _short(value: float) -> float:
    return float(f"{float(value):.{DIGITS}g}")


def _product(inertial: Array, numbers: Array) -> Array:
    """Torque due to the inertial parameters, without the columns of gravity, shape (K, n)."""
    return np.asarray(inertial[:, :, :-3] @ numbers[:-3])


def _rms(parts: Sequence[Array]) -> float:
    values = np.concatenate([np.zeros(0), *parts])
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")

"""Contribution of a term to the recorded torques, and its derivatives by the term's parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.hypotheses.term import Term
from missing_physics.inference.kept import Kept
from missing_physics.inference.torques.coupled import behind_motors
from missing_physics.inference.torques.links import of_link
from missing_physics.inference.torques.pushes import on_body
from missing_physics.inference.torques.runs import Run
from missing_physics.inference.torques.yielding import of_yielding, torques_of_yielding
from missing_physics.unnamed.neighbours import OfNeighbour
from reference_model.dynamics.inertial import BODY_NUMBERS
from reference_model.effects.along import EffectAlong, GearAlong, SensorAlong
from reference_model.effects.base import BodyEffect, JointEffect, JointSignals, SensorEffect, YieldingGear
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.structure import StructureEffect
from reference_model.evaluation.model import RobotModel

__all__ = ["Columns", "KeptColumns", "added_to_bodies", "columns_of", "cut"]

Array = NDArray[np.float64]
Places = NDArray[np.int_]

#: Newton rounds for the torque with which an actuator compensates an effect: one on each side of zero and one
#: for rounding. The error of a lag is then of the fourth order in its phase.
SIDES = 3
#: Least fraction of an actuator's torque that remains when an effect takes its share.
LEAST = 0.05
#: Indices of torque and velocity among the signals of a joint.
TORQUE, VELOCITY = (JointSignals.CHANNELS.index(name) for name in ("torque", "velocity"))
#: Signals of a joint that follow from its recorded motion.
RECORDED = frozenset(("time", "position", "velocity", "acceleration", "temperature"))
#: A torque counts as saturated where at least this fraction is missing [-]: more than at its rounded corner.
CUT = 0.01


@dataclass(frozen=True)
class Columns:
    """Columns of a term along a recording at the joints it affects; zero where nothing is compared.

    Attributes:
        linear_values: of the parameters in the first column, zero for non-linear ones, shape (P,).
        active: the joints.
        values: the columns, shape (K, a, 1 + P).
    """

    linear_values: Array
    active: Places
    values: Array

    @property
    def size(self) -> int:
        """Number of cached values."""
        return self.values.size

    def moved(self, linear_values: Array) -> Columns:
        """The columns for other values of the linear parameters, where all parameters are linear."""
        found = self.values.copy()
        found[:, :, 0] += self.values[:, :, 1:] @ (linear_values - self.linear_values)
        return Columns(linear_values, self.active, found)


class KeptColumns:
    """Columns of terms along recordings; those of the terms used last are cached.

    Changes of linear parameters affect the first column only.

    Args:
        runs: the recordings.
        common: cache for all linearisations of these recordings: of columns that depend on the motion only.
    """

    def __init__(self, runs: Sequence[Run], common: Kept[Columns]) -> None:
        self._runs, self._common = runs, common
        self._own = Kept[Columns]()
        self._of_motion: dict[tuple[object, ...], bool] = {}

    def acting(self, term: Term, run: int) -> tuple[Places, Array]:
        """The joints that a term affects, and its columns there, zero where nothing is compared.

        Args:
            term: the effect.
            run: number of the recording.

        Returns:
            Shapes (a,) and (K, a, 1 + P), see `columns_of`.
        """
        kept = self._known(term, run)
        if kept is None:
            self.prepare([term], run)
            kept = self._cached(term, run)
            assert kept is not None
        return kept.active, kept.values

    def prepare(self, terms: Sequence[Term], run: int) -> None:
        """Cache the columns of several terms along one recording: cheaper than one at a time."""
        missing = {_key(term, run): term for term in terms if self._known(term, run) is None}
        made = _columns_of_each(tuple(missing.values()), self._runs[run], run)
        for (key, term), (active, values) in zip(missing.items(), made):
            counted = self._runs[run].rows.counted[:, active, None]
            self._cache(term, run).keep(
                key, Columns(_linear_values(term), active, np.where(counted, values, 0.0))
            )

    def contributed(self, terms: Sequence[Term], run: int) -> Array:
        """Sum of the torques of terms in one recording, zero where nothing is compared, shape (K, n)."""
        own, found = self._runs[run], np.zeros_like(self._runs[run].torque)
        fresh: list[Term] = []
        for term in terms:
            is_known = self._known(term, run) is not None
            if not is_known and isinstance(term.effect, StructureEffect) and term.effect.adds_coordinates:
                found += torques_of_yielding(term, term.effect, own)
                continue
            if not is_known and _is_at_joint(term, own) and not term.in_rows:
                fresh.append(term)
                continue
            active, values = self.acting(term, run)
            found[:, active] += values[:, :, 0]
        more = np.zeros_like(found)
        for k, values in _torques_of_each(fresh, own, run):
            more[:, k] += values
        found += own.rows.nuisance.removed(more)
        return np.where(own.rows.counted, found, 0.0)

    def _known(self, term: Term, run: int) -> Columns | None:
        """The columns of a term if they are cached or follow from cached columns."""
        kept = self._cached(term, run)
        if kept is None:
            return None
        linear_values = _linear_values(term)
        if np.array_equal(linear_values, kept.linear_values):
            return kept
        if not all(map(term.is_linear, term.free)):  # other derivatives scale with linear parameters
            return None
        return kept.moved(linear_values)

    def _cached(self, term: Term, run: int) -> Columns | None:
        return self._cache(term, run).get(_key(term, run))

    def _cache(self, term: Term, run: int) -> Kept[Columns]:
        key = _key(term, run)
        if key not in self._of_motion:
            self._of_motion[key] = _is_of_motion(term, self._runs[run])
        return self._common if self._of_motion[key] else self._own


def _is_of_motion(term: Term, run: Run) -> bool:
    """Whether columns depend on the recorded motion only, and so not on the linearisation."""
    if run.along.response is not None or run.along.inner is not None:  # the motion depends on the masses
        return False
    if not _is_at_joint(term, run):
        return isinstance(term.effect, BodyEffect | ForceEffect)
    if term.effect.cuts_torque:
        return False
    free = {p.name for p in term.free}
    zero = frozenset(name for name, value in term.parameters.items() if value == 0.0 and name not in free)
    return _along_joint(term, run, _place(run, term.at)).channels_without(zero) <= RECORDED


def _key(term: Term, run: int) -> tuple[object, ...]:
    """Cache key of the columns of a term in one recording."""
    return *term.shape, run


def _linear_values(term: Term) -> Array:
    """Linear parameters of a term, zero for the others, shape (P,)."""
    return np.array(term.linear_values)


def columns_of(term: Term, run: Run, number: int) -> Array:
    """Contribution of a term to the measured torques in the band, and its derivatives by its parameters.

    Args:
        term: the effect.
        run: the recording.
        number: of the recording; a term of another recording contributes nothing.

    Returns:
        Shape (K, n, 1 + P): the contribution, then one column for each estimated parameter.
    """
    effect = term.effect
    if term.run not in (None, number):
        return np.zeros((*run.torque.shape, 1 + len(term.free)))
    if isinstance(effect, JointEffect) and term.at not in run.model.joints:
        return behind_motors(term, effect, run)
    if isinstance(effect, JointEffect):
        return _at_joint(run, term.at, _joint(term, effect, run))
    if isinstance(effect, BodyEffect):
        return _body(term, effect, run)
    if isinstance(effect, SensorEffect):
        return _sensor(term, effect, run)
    if isinstance(effect, YieldingGear):
        return _gear(term, effect, run)
    if isinstance(effect, StructureEffect):
        return of_yielding(term, effect, run) if effect.adds_coordinates else of_link(term, effect, run)
    if isinstance(effect, ForceEffect):
        return on_body(term, effect, run)
    raise TypeError(f"{effect.id} has no columns along a motion")


def _is_at_joint(term: Term, run: Run) -> bool:
    """Whether a term is an effect at a joint whose torque is compared."""
    return isinstance(term.effect, JointEffect) and term.at in run.model.joints


def _columns_of_each(terms: Sequence[Term], run: Run, number: int) -> list[tuple[Places, Array]]:
    """Columns of several terms at the joints they affect; effects at joints are filtered together.

    Args:
        terms, run, number: see `columns_of`.

    Returns:
        For each term the joints, shape (a,), and the columns there, shape (K, a, 1 + P).
    """
    found: dict[int, tuple[Places, Array]] = {}
    full: dict[int, Array] = {}
    for i, term in enumerate(terms):
        if _is_at_joint(term, run) and term.run in (None, number):
            assert isinstance(term.effect, JointEffect)
            full[i] = _joint(term, term.effect, run)
            if term.in_rows:
                full[i][:, 0] = full[i][:, 1:] @ term.linear_values
            continue
        columns = columns_of(term, run, number)
        active = np.flatnonzero(columns.any(axis=(0, 2)))
        found[i] = active, columns[:, active]
    if full:
        joints = [_place(run, terms[i].at) for i in full]
        for i, k, own in zip(full, joints, run.reduce_each(joints, list(full.values()))):
            active = np.array([k] if own.any() else [], dtype=int)
            found[i] = active, own[:, None, :][:, : active.size]
    is_body = [isinstance(term.effect, BodyEffect | StructureEffect) for term in terms]  # whitened already
    return [found[i] if own else run.rows.nuisance.removed_at(*found[i]) for i, own in enumerate(is_body)]


def _torques_of_each(terms: Sequence[Term], run: Run, number: int) -> list[tuple[int, Array]]:
    """Joint and torque there, shape (K,), of effects at joints that are present in a recording."""
    own = [term for term in terms if term.run in (None, number)]
    joints = [_place(run, term.at) for term in own]
    full = [_force(term, run)[:, None] for term in own]
    return [(k, found[:, 0]) for k, found in zip(joints, run.reduce_each(joints, full))] if own else []


def _at_joint(run: Run, joint: str, full: Array) -> Array:
    """Columns of one joint's torque, shape (N, C), reduced to the band, shape (K, n, C)."""
    k = _place(run, joint)
    own = run.reduce_at(k, full)
    found = np.zeros((len(own), len(run.model.joints), own.shape[1]))
    found[:, k] = own
    return found


def _place(run: Run, joint: str) -> int:
    return run.model.joints.index(joint)


def _force(term: Term, run: Run) -> Array:
    """Torque of a joint's actuator that compensates an effect, shape (N,)."""
    assert isinstance(term.effect, JointEffect)
    k = _place(run, term.at)
    along = _along_joint(term, run, k)
    return -along.torque(_signals(term, term.effect, run, along, k)[0], term.parameters)


def _signals(
    term: Term, effect: JointEffect, run: Run, along: EffectAlong, k: int
) -> tuple[Array, Array | float]:
    """Signals of joint k, shape (N, C), and the factor by which the actuator's compensation scales it."""
    signals = run.signals(k)
    if isinstance(effect, OfNeighbour):
        signals = signals.copy()
        signals[:, VELOCITY] = run.motion.velocity[:, _place(run, effect.neighbour)]
    if effect.cuts_torque:
        signals = signals.copy()
        signals[:, TORQUE] = run.acting[:, k]
    if effect.states:
        own = signals[:, :-1]
        if term.is_compensated:
            own = own.copy()
            for _ in range(SIDES):
                own[:, TORQUE] = signals[:, TORQUE] - along.torque(own, term.parameters)
        return own, 1.0
    if term.is_compensated:
        return _compensated(term, signals, along)
    return signals, 1.0


def _compensated(term: Term, signals: Array, along: EffectAlong) -> tuple[Array, Array]:
    """Signals with the torque u of an actuator that compensates the effect T, and du/d(u + T).

    The motion needs u + T(u). T is linear in u on either side of zero, where Newton's method is exact.
    """
    needed, signals = signals[:, TORQUE].copy(), signals.copy()
    step = 1e-6 * max(float(np.abs(needed).max()), 1e-12)
    for _ in range(SIDES):
        own = along.torque(signals, term.parameters)
        shifted = signals.copy()
        shifted[:, TORQUE] += step
        grows = 1.0 / np.maximum(1.0 + (along.torque(shifted, term.parameters) - own) / step, LEAST)
        signals[:, TORQUE] -= (signals[:, TORQUE] + own - needed) * grows
    return signals, grows


def _joint(term: Term, effect: JointEffect, run: Run) -> Array:
    k = _place(run, term.at)
    along = _along_joint(term, run, k)
    signals, grows = _signals(term, effect, run, along, k)
    force, jacobian = along.evaluate(signals, term.parameters, [p.name for p in term.free])
    return -np.column_stack([force, (jacobian.T * grows).T])


def _along_joint(term: Term, run: Run, k: int) -> EffectAlong:
    """The effect of a term along joint k, driven by `Run.signals`; without the direction if it has states."""
    assert isinstance(term.effect, JointEffect)
    joint = run.model.robot.drives[k]
    bearing = joint.bearing
    return EffectAlong(
        term.effect,
        gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
        bearing_arms=(bearing.radial_arm, bearing.axial_arm) if bearing else (0.0, 0.0),
        transition=float(run.motion.transition[k]),
        directed=not term.effect.states,
    )


def cut(term: Term, run: Run, number: int) -> Array:
    """Instants at which a term saturates the recorded torque of a joint, zero or one, shape (K, n).

    Torque above the limit has no effect on the motion, so no hypothesis can predict it.
    """
    found, effect = np.zeros_like(run.torque), term.effect
    if isinstance(effect, JointEffect) and effect.cuts_torque and term.run in (None, number):
        k = _place(run, term.at)
        force = _joint(term, effect, run)[run.motion.kept][:, 0]
        found[:, k] = np.abs(force) > CUT * np.abs(run.acting[run.motion.kept][:, k])
    return found


def added_to_bodies(term: Term, effect: BodyEffect, model: RobotModel) -> tuple[Places, Array, Array]:
    """Change of a model's inertial parameters by a term.

    Returns:
        Indices of the parameters, shape (Q,); their changes, (Q,); and derivatives of these, (Q, P).
    """
    free = [p.name for p in term.free]
    symbols = {name: ca.SX.sym(name) for name in term.parameters}
    terms = effect.terms(symbols)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    ten = [
        terms.mass,
        *(terms.first_moment[k] for k in range(3)),
        *(terms.inertia[i, j] for i, j in pairs),
        *(terms.gravity[k] for k in range(3)),
    ]
    changes = ca.vertcat(*ten)
    parameters = ca.vertcat(*(symbols[name] for name in free))
    function = ca.Function("body", [*symbols.values()], [changes, ca.jacobian(changes, parameters)])
    value, jacobian = (np.array(ca.DM(one)) for one in function(*term.parameters.values()))
    names = [*(f"{term.at}.{number}" for number in BODY_NUMBERS), *(f"gravity.{axis}" for axis in "xyz")]
    known = model.inertial_names
    if f"{term.at}.tip_mass" in known and terms.place is not None:  # at the tip of a flexible link
        names = [f"{term.at}.tip_mass", *["" for _ in BODY_NUMBERS[1:]], *names[-3:]]
    places = np.array([known.index(name) if name in known else -1 for name in names])
    used = places >= 0
    return places[used], value.ravel()[used], jacobian[used]


def _body(term: Term, effect: BodyEffect, run: Run) -> Array:
    places, added, jacobian = added_to_bodies(term, effect, run.model)
    return np.asarray(run.rows.inertial[:, :, places] @ np.column_stack([added, jacobian]))


def _sensor(term: Term, effect: SensorEffect, run: Run) -> Array:
    joint, _, quantity = term.at.rpartition(".")
    k = _place(run, joint)
    time = run.motion.time
    free = [p.name for p in term.free]
    along = SensorAlong(effect)
    torque = quantity not in ("position", "motor_position")
    value = run.needed[:, k] if torque else run.motion.position[:, k]
    rate = _derivative(time, value) if torque else run.motion.velocity[:, k]
    since = time - time[0]
    error = along.error(since, value, rate, term.parameters)
    jacobian = along.jacobian(since, value, rate, term.parameters, free)
    each = np.column_stack([error, jacobian])
    if torque:
        return _at_joint(run, joint, each)
    return run.reduce(-run.moved(k, each))


def _gear(term: Term, effect: YieldingGear, run: Run) -> Array:
    """Columns of a gear behind the motor's encoder: joint position is motor position minus twist."""
    k, time = _place(run, term.at), run.motion.time
    rotor = float(run.along.inertial[run.model.inertial_names.index(f"{term.at}.reflected_inertia")])
    passed = run.needed[:, k] - rotor * run.motion.acceleration[:, k]
    every = GearAlong(effect).evaluate(passed, _derivative(time, passed), term.parameters)
    names = [p.name for p in effect.estimated]
    twist = every[:, [0, *(1 + names.index(p.name) for p in term.free)]]
    found = -run.moved(k, twist)
    found[:, k] += rotor * make_interp_spline(time, twist, k=5)(time, 2)  # the rotor moves as recorded
    return run.reduce(found)


def _derivative(time: Array, values: Array) -> Array:
    return np.asarray(make_interp_spline(time, values, k=3)(time, 1))

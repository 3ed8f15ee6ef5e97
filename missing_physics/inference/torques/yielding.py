"""Columns of a base or link that yields although the robot file calls it rigid.

The effect adds coordinates without encoders: six of the base, or modes of a link. They follow from the
joints' motion, to first order in their deflections u:

    M_pp a + (C + D_p) v + (K + G_p) u = -f,        joint torques: M_jp a + D_j v + G_j u,

where f is the force that the motion of the robot file needs there, G and D the derivatives of inverse
dynamics by deflections and rates (gravity, centrifugal and Coriolis forces), and K and C of the springs. This
is integrated with as many samples as the band requires. M, G and D change with the pose, which is slow: they
are computed on a coarser grid and interpolated. At the ends of a recording, smoothed accelerations are wrong:
until the first row the force is that of the first row. The vibration with which a recording begins is
estimated from the recording itself, with a prior as wide as the largest deflection under the forces of the
motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from missing_physics.evaluation.band import low_passed
from missing_physics.evaluation.response import newmark, vibrating
from missing_physics.hypotheses.term import Term
from missing_physics.inference.kept import step_of
from missing_physics.inference.torques.runs import Run
from missing_physics.standard.band import SAMPLES_PER_PERIOD
from reference_model.dynamics.inertial import inertial_names, nominal_inertial
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.pushing import BodySeries, ForceAlong
from reference_model.effects.structure import StructureEffect
from reference_model.evaluation.model import RobotModel
from reference_model.kinematics.spatial import quaternion_from_rpy, rotation_from_rpy
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from robot_model import Robot

__all__ = ["WIDER", "frequencies_of", "of_yielding", "rows_of_yielding", "torques_of_yielding"]

Array = NDArray[np.float64]
Values = Mapping[str, float]

#: Samples per period of the band's end: an integration step then has a phase error below a thousandth.
DENSER = 2 * SAMPLES_PER_PERIOD
#: Cut-off of the forces before their samples are thinned, in terms of the band's end.
WIDER = 2.0
#: Samples of an interpolation.
SIX = 6
#: Torque relative to the largest recorded one beyond which a deflection grows without bound [-].
FALLS = 1e3
#: Least weight of a joint's residual, relative to the largest one [-].
LEAST = 1e-6
#: Number of cached models of changed robots: one for every link of a large robot.
ROBOTS = 32
#: Step of finite differences in deflections and rates [m, rad or sqrt(kg) m, and per s]: inverse dynamics is
#: a polynomial of low degree in them, so that its error is this fraction of the change by a unit.
SMALL = 1e-4
#: A coupling or force below this fraction of the others is an error of these differences [-].
NONE = 0.1 * SMALL


@dataclass(frozen=True)
class _Yielding:
    """Dynamics of the added coordinates along one motion; T instants, n joints, p added coordinates.

    Attributes:
        time: evenly spaced instants [s], shape (T,).
        reached: those of the effect's coordinates that forces of the motion reach, the p considered here.
        force: that the motion needs at these coordinates, shape (T, p).
        mass, rate, place: M, D and G in the rows of the added coordinates, then of the joints, shape
            (T, p + n, p) each.
    """

    time: Array
    reached: NDArray[np.int_]
    force: Array
    mass: Array
    rate: Array
    place: Array

    def until(self, most: int | None) -> _Yielding:
        """The first instants, at most `most`."""
        parts = (self.force, self.mass, self.rate, self.place)
        return _Yielding(self.time[:most], self.reached, *(part[:most] for part in parts))

    def plus(self, factor: float, other: _Yielding) -> _Yielding:
        """The sum with `factor` times another one at the same instants."""
        own, theirs = ((d.force, d.mass, d.rate, d.place) for d in (self, other))
        return _Yielding(self.time, self.reached, *(a + factor * b for a, b in zip(own, theirs)))

    def times(self, factor: float) -> _Yielding:
        """The quantities multiplied by `factor`."""
        parts = (self.force, self.mass, self.rate, self.place)
        return _Yielding(self.time, self.reached, *(factor * part for part in parts))

    def only(self, reached: NDArray[np.int_]) -> _Yielding:
        """The dynamics of some of the coordinates."""
        count, total = self.force.shape[1], self.mass.shape[1]
        rows = np.r_[reached, count:total]
        parts = (part[:, rows][:, :, reached] for part in (self.mass, self.rate, self.place))
        return _Yielding(self.time, reached, self.force[:, reached], *parts)


def of_yielding(term: Term, effect: StructureEffect, run: Run) -> Array:
    """Columns of an effect that adds coordinates, see `columns.columns_of`."""
    return _columns(term, effect, run, {p.name: step_of(term, p) for p in term.free})


def torques_of_yielding(term: Term, effect: StructureEffect, run: Run) -> Array:
    """The first of these columns, the torques in the rows of the recording, shape (K, n)."""
    return _columns(term, effect, run, {})[:, :, 0]


def _columns(term: Term, effect: StructureEffect, run: Run, steps: Values) -> Array:
    trials: list[Values] = [term.parameters]
    trials += [{**term.parameters, name: term.parameters[name] + step} for name, step in steps.items()]
    found = np.zeros((*run.torque.shape, len(trials)))
    acting = [k for k, p in enumerate(trials) if _is_present(effect, p)]
    if acting:
        rows = rows_of_yielding(effect, term.at, run, [trials[k] for k in acting])
        found[:, :, acting] = _begun(run, run.rows.vibration.removed(rows))
    slopes = [(found[:, :, k + 1] - found[:, :, 0]) / step for k, step in enumerate(steps.values())]
    return np.stack([found[:, :, 0], *slopes], axis=2)


def rows_of_yielding(
    effect: StructureEffect, at: str, run: Run, trials: Sequence[Values], most: int | None = None
) -> Array:
    """Torques in the rows of a recording for V values of an effect's parameters, shape (K, n, V, 1 + S).

    Those due to the forces of the motion are followed by those of S free vibrations from the start, each with
    the largest deflection under these forces. A mount so soft that the robot would fall over has torques
    that no recording has.

    Args:
        effect, at, run: the effect, its place and the recording.
        trials: values of its parameters.
        most: instants of the integration, from the start; all when None. Later rows are left out.
    """
    motion = run.motion
    each = [_dynamics_of(effect, at, run, p).until(most) for p in trials]
    springs = [_springs_of(effect, run.model.robot, at, p, each[0].reached) for p in trials]
    time, full = each[0].time, _moved(each, springs, 2.0 * np.pi * WIDER * motion.cutoff)
    impossible = FALLS * float(np.abs(run.torque).max())
    falls = ~(np.abs(full) < impossible).all(axis=(0, 1, 3))
    full[:, :, falls] = 0.0
    full[:, :, falls, 0] = impossible
    nearest = np.searchsorted(motion.time, time).clip(0, motion.time.size - 1)
    weighted = full * run.rows.shares[nearest, :, None, None]
    smooth = low_passed(weighted, rate=1.0 / (time[1] - time[0]), cutoff=motion.cutoff)
    some = run.rows.time <= (time[-1] if most else np.inf)
    found = _interpolated(smooth, (run.rows.time[some] - time[0]) / (time[1] - time[0]))
    return found * run.rows.counted[some, :, None, None]


def _interpolated(values: Array, places: Array) -> Array:
    """Series at places between its samples, in samples, (T, ...) to (K, ...): Lagrange's polynomial of six.

    Its error is a thousandth at the band's end.
    """
    first = np.clip(np.floor(places).astype(int) - 2, 0, len(values) - SIX)
    apart = places - first
    found = np.zeros((places.size, *values.shape[1:]))
    for k in range(SIX):
        others = [m for m in range(SIX) if m != k]
        weight = np.prod([(apart - m) / (k - m) for m in others], axis=0)
        found += weight.reshape(-1, *[1] * (values.ndim - 1)) * values[first + k]
    return found


def frequencies_of(effect: StructureEffect, at: str, run: Run, p: Values) -> Array:
    """Frequencies of the added coordinates at the start of a recording, slowest first [rad/s]."""
    dynamics = _dynamics_of(effect, at, run, p)
    stiffness, _ = _springs_of(effect, run.model.robot, at, p, dynamics.reached)
    sprung = np.flatnonzero(np.diag(stiffness) > 0.0)
    block = np.ix_(sprung, sprung)
    return _modes(dynamics.mass[0][block], stiffness[block])[1]


def _begun(run: Run, rows: Array) -> Array:
    """Torques with the vibration from the start that explains the residual best, shape (K, n, V)."""
    left = run.residual
    size = np.sqrt(np.mean(left**2, axis=0))
    weight = 1.0 / np.maximum(size, max(LEAST * float(size.max()), np.finfo(float).eps))
    found = rows[..., 0].copy()
    for v in range(found.shape[2]):
        free = (rows[:, :, v, 1:] * weight[:, None]).reshape(left.size, -1)
        apart = ((left - found[:, :, v]) * weight).ravel()
        begins = np.linalg.solve(free.T @ free + np.eye(free.shape[1]), free.T @ apart)
        found[:, :, v] += rows[:, :, v, 1:] @ begins
    return found


def _is_present(effect: StructureEffect, p: Values) -> bool:
    """Whether an effect with these parameters changes the robot."""
    return all(p[name] != effect.parameter(name).absent for name in effect.essential)


def _moved(each: Sequence[_Yielding], springs: Sequence[tuple[Array, Array]], below: float) -> Array:
    """Torques at the joints due to the added coordinates of V robots, shape (T, n, V, 1 + S).

    Args:
        each: their dynamics.
        springs: stiffness and damping of their added coordinates, shape (p, p) each.
        below: frequency up to which free vibrations are wanted [rad/s].
    """
    count, step = each[0].force.shape[1], float(each[0].time[1] - each[0].time[0])
    stiffness = np.stack([one.place[:, :count] + own for one, (own, _) in zip(each, springs)], axis=1)
    damping = np.stack([one.rate[:, :count] + own for one, (_, own) in zip(each, springs)], axis=1)
    mass = np.stack([one.mass[:, :count] for one in each], axis=1)
    force = -np.stack([one.force for one in each], axis=1)
    held = np.stack([own for own, _ in springs])
    sprung = np.flatnonzero(np.diag(held[0]) > 0.0)
    blocks = np.ix_(np.arange(len(each)), sprung, sprung)
    start = np.zeros((2, len(each), count, 1))
    start[0][:, sprung] = np.linalg.solve(held[blocks], force[0][:, sprung, None])
    shapes, frequencies = _modes(mass[0][blocks], held[blocks])
    largest = np.abs(np.einsum("vpm,tvp->tvm", shapes, force[:, :, sprung])).max(axis=0) / frequencies**2
    some = np.flatnonzero((frequencies < below).any(axis=0))
    scale = (largest * (frequencies < below))[:, some]
    free = np.zeros((2, len(each), count, 2 * some.size))
    free[0][:, sprung, : some.size] = shapes[:, :, some] * scale[:, None]
    free[1][:, sprung, some.size :] = shapes[:, :, some] * (scale * frequencies[:, some])[:, None]
    start = np.concatenate([start, free], axis=3)
    forces = np.zeros((*force.shape, start.shape[3]))
    forces[..., 0] = force
    implicit = newmark(mass[len(mass) // 2], held, step)
    found = np.zeros((len(force), each[0].mass.shape[1] - count, len(each), start.shape[3]))
    with np.errstate(over="ignore", invalid="ignore"):  # deflections that grow without bound
        moved = vibrating(mass, stiffness, damping, forces, step, (start[0], start[1]), implicit)
        for v, one in enumerate(each):
            parts = zip((one.place, one.rate, one.mass), moved)
            found[:, :, v] = sum(part[:, count:] @ own[:, v] for part, own in parts)
    return found


def _modes(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """Shapes of mass one, (V, p, p), and frequencies, (V, p) [rad/s], slowest first."""
    root = np.linalg.cholesky(mass)
    across = np.linalg.solve(root, np.linalg.solve(root, stiffness).swapaxes(-1, -2))
    squared, modes = np.linalg.eigh(across)
    return np.linalg.solve(root.swapaxes(-1, -2), modes), np.sqrt(np.maximum(squared, np.finfo(float).tiny))


def _dynamics_of(effect: StructureEffect, at: str, run: Run, p: Values) -> _Yielding:
    """The dynamics of the coordinates that an effect adds, which are linear in masses; cached."""
    key = effect.id, at
    if key not in run.reshaped:
        run.reshaped[key] = _Masses.of(effect, at, run)
    found = run.reshaped[key]
    assert isinstance(found, _Masses)
    return found.at(p)


@dataclass(frozen=True)
class _Masses:
    """Dynamics of the added coordinates at typical masses, and their derivatives by each parameter."""

    typical: _Yielding
    values: Mapping[str, float]
    slopes: Mapping[str, _Yielding]

    @classmethod
    def of(cls, effect: StructureEffect, at: str, run: Run) -> _Masses:
        values = {name: effect.parameter(name).typical for name in effect.weighs}
        typical, slopes = _with_masses(effect, at, run, values), {}
        reached = _reached(typical, _springs_of(effect, run.model.robot, at, _typical(effect)))
        typical = typical.only(reached)
        for name, value in values.items():
            twice = _with_masses(effect, at, run, {**values, name: 2.0 * value}).only(reached)
            slopes[name] = twice.plus(-1.0, typical).times(1.0 / value)
        return cls(typical, values, slopes)

    def at(self, p: Values) -> _Yielding:
        """The dynamics for given parameters."""
        found = self.typical
        for name, slope in self.slopes.items():
            found = found.plus(p[name] - self.values[name], slope)
        return found


def _reached(dynamics: _Yielding, springs: tuple[Array, Array]) -> NDArray[np.int_]:
    """Coordinates that forces of the motion reach, directly or through coupling with others.

    In a plane these are three of the six of a base, and half of the modes of a link.
    """
    count = dynamics.force.shape[1]
    mass, rate, place = (
        np.abs(part[:, :count]).max(axis=0) for part in (dynamics.mass, dynamics.rate, dynamics.place)
    )
    heavy, stiff = (np.sqrt(np.outer(own, own)) for own in (np.diag(mass), np.diag(springs[0])))
    stiff = np.where(stiff > 0.0, stiff, heavy)  # a free base has no springs
    pairs = ((mass, heavy), (rate, np.sqrt(heavy * stiff)), (place, stiff), (np.abs(springs[0]), stiff))
    coupled = np.any([part > NONE * size for part, size in pairs], axis=0)
    pushes = np.abs(dynamics.force).max(axis=0)
    _, group = connected_components(csr_array(coupled | coupled.T), directed=False)
    pushed = set(group[pushes > NONE * pushes.max(initial=0.0)].tolist())
    found = np.flatnonzero([one in pushed for one in group])
    return found if found.size else np.arange(count)


def _with_masses(effect: StructureEffect, at: str, run: Run, weights: Values) -> _Yielding:
    """The dynamics for given values of the parameters that change masses."""
    robot = run.model.robot
    changed = effect.changed(robot, at, {**_typical(effect), **weights})
    apart = dict(zip(run.model.inertial_names, run.along.inertial - run.model.inertial))
    more = [apart.get(name, 0.0) for name in inertial_names(changed)]
    balanced = isinstance(effect, ForceEffect) and effect.carries_start
    return _made(run, _model(effect, robot, at), nominal_inertial(changed) + np.array(more), balanced)


def _made(run: Run, model: RobotModel, numbers: Array, balanced: bool) -> _Yielding:
    motion, joints = run.motion, len(model.joints)
    first = model.tree.offset
    added = np.r_[0:first, first + joints : model.rows]
    order = np.r_[added, first : first + joints]
    state = motion.position, motion.velocity, motion.acceleration
    base = _base(run, model)
    needed = model.inverse_dynamics(*state, base=base, inertial=numbers)[:, added]
    held = np.zeros(first)
    if balanced:
        rest, there = np.zeros((1, joints)), BaseMotion.at_rest(base.attitude[0]) if base else None
        still = model.inverse_dynamics(motion.position[:1], rest, rest, base=there, inertial=numbers)
        held = still[0, :first]
        needed[:, :first] -= held
    stride = max(1, int(motion.rate / (DENSER * motion.cutoff)))
    force = low_passed(needed, rate=motion.rate, cutoff=WIDER * motion.cutoff)
    force[: motion.kept.start] = force[motion.kept.start]
    grid = _Grid.of(run, model, base, numbers)
    place, rate = grid.by_place[:, order], grid.by_rate[:, order]
    for k in range(3 if first else 0):  # the force that balances the load keeps its direction
        place[:, :first, 3 + k] += np.cross(np.eye(3)[k], held.reshape(2, 3)).ravel()
    stiffness, damping = model.elasticity(numbers)
    modes = slice(added.size - len(stiffness), added.size)
    place[:, modes, modes] -= stiffness
    rate[:, modes, modes] -= damping
    coarse = np.stack([grid.mass[:, order][:, :, added], rate, place], axis=1)
    time = motion.time[::stride]
    mass, rate, place = make_interp_spline(grid.time, coarse, k=3)(time).transpose(1, 0, 2, 3)
    return _Yielding(time, np.arange(added.size), force[::stride], mass, rate, place)


def _base(run: Run, model: RobotModel) -> BaseMotion | None:
    """Motion of the base in the robot file; at rest if only the changed robot's base can move."""
    if run.along.base is not None or not model.free_base:
        return run.along.base
    return BaseMotion.at_rest(quaternion_from_rpy(model.robot.base.rpy), run.motion.time.size)


@dataclass(frozen=True)
class _Grid:
    """Quantities that change with the pose, on a coarse grid of G instants.

    Attributes:
        time: [s], shape (G,).
        mass: mass matrix, shape (G, rows, rows).
        by_place, by_rate: derivatives of inverse dynamics by deflections and rates of the added coordinates,
            shape (G, rows, p) each.
    """

    time: Array
    mass: Array
    by_place: Array
    by_rate: Array

    @classmethod
    def of(cls, run: Run, model: RobotModel, base: BaseMotion | None, numbers: Array) -> _Grid:
        motion = run.motion
        stride = max(1, int(motion.rate / (SAMPLES_PER_PERIOD * motion.cutoff)))
        some = np.unique(np.append(np.arange(0, motion.time.size, stride), motion.time.size - 1))
        quiet = low_passed(motion.acceleration, rate=motion.rate, cutoff=motion.cutoff)
        state = motion.position[some], motion.velocity[some], quiet[some]
        fixed = None if base is None else BaseMotion.from_stacked(base.stacked()[some])
        inner = InnerMotion.resting(model.tree, some.size)

        def forces(base: BaseMotion | None, inner: InnerMotion) -> Array:
            return model.inverse_dynamics(*state, base=base, inner=inner, inertial=numbers)

        before, by_place, by_rate = forces(fixed, inner), [], []
        if model.free_base:
            assert fixed is not None
            still = np.zeros_like(before)
            by_place += [still] * 3  # no force depends on the place of the base
            by_place += [forces(_turned(fixed, axis), inner) - before for axis in np.eye(3)]
            for name in ("linear_velocity", "angular_velocity"):
                for axis in np.eye(3):
                    faster = {name: getattr(fixed, name) + SMALL * axis}
                    by_rate.append(forces(replace(fixed, **faster), inner) - before)
        for k in range(model.tree.modal):
            step = np.zeros_like(inner.modal)
            step[:, k] = SMALL
            by_place.append(forces(fixed, replace(inner, modal=step)) - before)
            by_rate.append(forces(fixed, replace(inner, modal_rates=step)) - before)
        mass = model.mass_matrix(state[0], base=fixed, inner=inner, inertial=numbers)
        places, rates = (np.stack(each, axis=2) / SMALL for each in (by_place, by_rate))
        return cls(motion.time[some], mass, places, rates)


def _turned(base: BaseMotion, axis: Array) -> BaseMotion:
    """The base turned by `SMALL` about an axis in its own axes."""
    before = Rotation.from_quat(np.roll(base.attitude, -1, axis=1))
    after = (before * Rotation.from_rotvec(SMALL * axis)).as_quat()
    return replace(base, attitude=np.roll(after, 1, axis=1))


def _springs_of(
    effect: StructureEffect, robot: Robot, at: str, p: Values, reached: NDArray[np.int_] | None = None
) -> tuple[Array, Array]:
    """Stiffness and damping of the coordinates that an effect adds, or of some of them, shape (p, p) each."""
    model = _model(effect, robot, at)
    first, count = model.tree.offset, model.rows - len(model.joints)
    stiffness, damping = np.zeros((2, count, count))
    for whole, own, factor in zip(
        (stiffness, damping), model.elasticity(), effect.stiffened(p, _typical(effect))
    ):
        whole[first:, first:] = factor * own
    if isinstance(effect, ForceEffect):
        base = model.robot.base
        home, turn = np.asarray(base.position, dtype=float), rotation_from_rpy(base.rpy)
        steps = SMALL * np.vstack([np.zeros((1, 6)), np.eye(6), np.zeros((6, 6))])
        turned = turn @ Rotation.from_rotvec(steps[:, 3:]).as_matrix()
        series = BodySeries(
            np.zeros(len(steps)), home + steps[:, :3] @ turn.T, turned, np.roll(steps, 6, axis=0)
        )
        wrench = ForceAlong(effect, model.robot).wrench(series, p)
        change = (wrench[:1] - wrench[1:]).T / SMALL
        stiffness[:first, :first], damping[:first, :first] = change[:, :6], change[:, 6:]
    if reached is None:
        return stiffness, damping
    return stiffness[np.ix_(reached, reached)], damping[np.ix_(reached, reached)]


def _typical(effect: StructureEffect) -> dict[str, float]:
    return {p.name: p.typical for p in effect.parameters}


@lru_cache(maxsize=ROBOTS)
def _model(effect: StructureEffect, robot: Robot, at: str) -> RobotModel:
    """The robot with a typical effect; parameters enter by inertial parameters and springs."""
    return RobotModel(effect.changed(robot, at, _typical(effect)))

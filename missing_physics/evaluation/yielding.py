"""Motion of a base or link that yields although the robot file calls it rigid.

The effect adds coordinates without encoders: six of the base, or modes of a link. They follow from the
joints' motion, to first order in their deflections u:

    M_pp a + (C + D_p) v + (K + G_p) u = -f,        joint torques: M_jp a + D_j v + G_j u,

where f is the force that the motion of the robot file needs there, G and D the derivatives of inverse
dynamics by deflections and rates (gravity, centrifugal and Coriolis forces), and K and C of the springs. This
is integrated with as many samples as the band requires. M, G and D change with the pose, which is slow: they
are computed on a coarser grid and interpolated. At the ends of a recording, smoothed accelerations are wrong:
until the first compared sample the force is that of this sample.
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
from missing_physics.evaluation.vibration.newmark import newmark, pushed
from reference_model.dynamics.inertial import inertial_names, nominal_inertial
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.pushing import BodySeries, ForceAlong
from reference_model.effects.structure import StructureEffect
from reference_model.evaluation.model import RobotModel
from reference_model.kinematics.spatial import quaternion_from_rpy, rotation_from_rpy
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from robot_model import Robot

__all__ = ["WIDER", "Moving", "Yielding", "Yields", "modes_of", "moved_by", "springs_of"]

Array = NDArray[np.float64]
Values = Mapping[str, float]

#: Samples per period of the band's end: of the integration, whose steps then have a phase error below a
#: thousandth, and of what changes with the pose.
DENSER, SLOWER = 8, 4
#: Cut-off of the forces before their samples are thinned, and of free vibrations, in terms of the band's end.
WIDER = 2.0
#: Quantities of the dynamics that depend on masses.
QUANTITIES = ("force", "mass", "rate", "place")
#: Number of cached models of changed robots: one for every link of a large robot.
ROBOTS = 32
#: Step of finite differences in deflections and rates [m, rad or sqrt(kg) m, and per s]: inverse dynamics is
#: a polynomial of low degree in them, so that its error is this fraction of the change by a unit.
SMALL = 1e-4
#: A coupling or force below this fraction of the others is an error of these differences [-].
NONE = 0.1 * SMALL


@dataclass(frozen=True)
class Moving:
    """Motion of a robot's joints; N samples, n joints.

    Attributes:
        robot: of rigid links.
        time: evenly spaced [s], shape (N,).
        position, velocity, acceleration: shape (N, n).
        base: of a free base that follows the joints, None for a fixed one.
        cutoff: end of the band in which torques are compared [Hz].
        first: number of the first sample that is compared.
        apart: inertial parameters that differ from the robot's, by name, as differences.
    """

    robot: Robot
    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    base: BaseMotion | None
    cutoff: float
    first: int
    apart: Values

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return float(1.0 / (self.time[1] - self.time[0]))

    @property
    def stride(self) -> int:
        """Samples between the instants at which the added coordinates are computed."""
        return max(1, int(self.rate / (DENSER * self.cutoff)))


@dataclass(frozen=True)
class Yielding:
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

    def within(self, first: float, last: float) -> Yielding:
        """The instants between two times [s]."""
        some = slice(*np.searchsorted(self.time, (first, last)))
        parts = (self.force, self.mass, self.rate, self.place)
        return Yielding(self.time[some], self.reached, *(part[some] for part in parts))

    def plus(self, factor: float, other: Yielding) -> Yielding:
        """The sum with `factor` times another one at the same instants."""
        own, theirs = ((d.force, d.mass, d.rate, d.place) for d in (self, other))
        return Yielding(self.time, self.reached, *(a + factor * b for a, b in zip(own, theirs)))

    def times(self, factor: float) -> Yielding:
        """The quantities multiplied by `factor`."""
        parts = (self.force, self.mass, self.rate, self.place)
        return Yielding(self.time, self.reached, *(factor * part for part in parts))

    def only(self, reached: NDArray[np.int_]) -> Yielding:
        """The dynamics of some of the coordinates."""
        count, total = self.force.shape[1], self.mass.shape[1]
        rows = np.r_[reached, count:total]
        parts = (part[:, rows][:, :, reached] for part in (self.mass, self.rate, self.place))
        return Yielding(self.time, reached, self.force[:, reached], *parts)


@dataclass(frozen=True)
class Yields:
    """Dynamics of the added coordinates for any masses, which enter linearly.

    Attributes:
        typical: for typical values of the parameters that change masses.
        values: these values.
        slopes: derivatives by each of them.
    """

    typical: Yielding
    values: Values
    slopes: Mapping[str, Yielding]

    @classmethod
    def of(cls, effect: StructureEffect, at: str, moving: Moving) -> Yields:
        """The coordinates that an effect adds at a place, driven by a motion of the joints."""
        values = {name: effect.parameter(name).typical for name in effect.weighs}
        typical, slopes = _with_masses(effect, at, moving, values), {}
        reached = _reached(typical, springs_of(effect, moving.robot, at, _typical(effect)))
        typical = typical.only(reached)
        for name, value in values.items():
            twice = _with_masses(effect, at, moving, {**values, name: 2.0 * value}).only(reached)
            slopes[name] = twice.plus(-1.0, typical).times(1.0 / value)
        return cls(typical, values, slopes)

    def at(self, p: Values) -> Yielding:
        """The dynamics for given parameters."""
        found = {name: getattr(self.typical, name) for name in QUANTITIES}
        for name, slope in self.slopes.items():
            change = p[name] - self.values[name]
            for quantity in QUANTITIES if change else ():
                step = change * getattr(slope, quantity)
                if np.abs(step).max(initial=0.0) > NONE * np.abs(found[quantity]).max(initial=0.0):
                    found[quantity] = found[quantity] + step
        return Yielding(self.typical.time, self.typical.reached, **found)


def moved_by(
    each: Sequence[Yielding],
    springs: Sequence[tuple[Array, Array]],
    below: float,
    begins: Array | None = None,
) -> Array:
    """Torques at the joints due to the added coordinates of V robots, shape (T, n, V, 1 + S).

    Args:
        each: their dynamics.
        springs: stiffness and damping of their added coordinates, shape (p, p) each.
        below: frequency up to which free vibrations are wanted [rad/s].
        begins: amplitudes of the first robot's free vibrations; all robots start with these, and no free
            vibration is returned.
    """
    count, step = each[0].force.shape[1], float(each[0].time[1] - each[0].time[0])
    mass = np.stack([one.mass[:, :count] for one in each], axis=1)
    force = -np.stack([one.force for one in each], axis=1)
    held = np.stack([own for own, _ in springs])
    sprung = np.flatnonzero(np.diag(held[0]) > 0.0)
    blocks = np.ix_(np.arange(len(each)), sprung, sprung)
    start = np.zeros((2, len(each), count, 1))
    start[0][:, sprung] = np.linalg.solve(held[blocks], force[0][:, sprung, None])
    shapes, frequencies = modes_of(mass[0][blocks], held[blocks])
    largest = np.abs(np.einsum("vpm,tvp->tvm", shapes, force[:, :, sprung])).max(axis=0) / frequencies**2
    slow = (
        frequencies < below if begins is None else np.broadcast_to(frequencies[:1] < below, frequencies.shape)
    )
    some = np.flatnonzero(slow.any(axis=0)) if begins is None or begins.size else np.zeros(0, dtype=int)
    scale = (largest * slow)[:, some]
    free = np.zeros((2, len(each), count, 2 * some.size))
    free[0][:, sprung, : some.size] = shapes[:, :, some] * scale[:, None]
    free[1][:, sprung, some.size :] = shapes[:, :, some] * (scale * frequencies[:, some])[:, None]
    start = np.concatenate([start, free], axis=3) if begins is None else start + free @ begins[:, None]
    implicit = newmark(mass[len(mass) // 2], held, step)
    masses, rates, places = ([getattr(one, name) for one in each] for name in ("mass", "rate", "place"))
    with np.errstate(over="ignore", invalid="ignore"):  # deflections that grow without bound
        forces = [-one.force for one in each]
        return pushed(masses, rates, places, forces, springs, start, step, implicit)


def modes_of(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """Shapes of mass one, (V, p, p), and frequencies, (V, p) [rad/s], slowest first."""
    root = np.linalg.cholesky(mass)
    across = np.linalg.solve(root, np.linalg.solve(root, stiffness).swapaxes(-1, -2))
    squared, modes = np.linalg.eigh(across)
    return np.linalg.solve(root.swapaxes(-1, -2), modes), np.sqrt(np.maximum(squared, np.finfo(float).tiny))


def _reached(dynamics: Yielding, springs: tuple[Array, Array]) -> NDArray[np.int_]:
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


def _with_masses(effect: StructureEffect, at: str, moving: Moving, weights: Values) -> Yielding:
    """The dynamics for given values of the parameters that change masses."""
    robot = moving.robot
    changed = effect.changed(robot, at, {**_typical(effect), **weights})
    more = [moving.apart.get(name, 0.0) for name in inertial_names(changed)]
    balanced = isinstance(effect, ForceEffect) and effect.carries_start
    return _made(moving, _model(effect, robot, at), nominal_inertial(changed) + np.array(more), balanced)


def _made(moving: Moving, model: RobotModel, numbers: Array, balanced: bool) -> Yielding:
    motion, joints = moving, len(model.joints)
    first = model.tree.offset
    added = np.r_[0:first, first + joints : model.rows]
    order = np.r_[added, first : first + joints]
    state = motion.position, motion.velocity, motion.acceleration
    base = _base(moving, model)
    needed = model.inverse_dynamics(*state, base=base, inertial=numbers)[:, added]
    held = np.zeros(first)
    if balanced:
        rest, there = np.zeros((1, joints)), BaseMotion.at_rest(base.attitude[0]) if base else None
        still = model.inverse_dynamics(motion.position[:1], rest, rest, base=there, inertial=numbers)
        held = still[0, :first]
        needed[:, :first] -= held
    stride = motion.stride
    force = low_passed(needed, rate=motion.rate, cutoff=WIDER * motion.cutoff)
    force[: motion.first] = force[motion.first]
    grid = _Grid.of(moving, model, base, numbers)
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
    return Yielding(time, np.arange(added.size), force[::stride], mass, rate, place)


def _base(moving: Moving, model: RobotModel) -> BaseMotion | None:
    """Motion of the base in the robot file; at rest if only the changed robot's base can move."""
    if moving.base is not None or not model.free_base:
        return moving.base
    return BaseMotion.at_rest(quaternion_from_rpy(model.robot.base.rpy), moving.time.size)


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
    def of(cls, moving: Moving, model: RobotModel, base: BaseMotion | None, numbers: Array) -> _Grid:
        motion = moving
        stride = max(1, int(motion.rate / (SLOWER * motion.cutoff)))
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


def springs_of(
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

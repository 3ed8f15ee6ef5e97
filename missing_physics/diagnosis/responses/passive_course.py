"""How base and flexible links of a robot answer small changes of the robot, along one recorded joint motion.

The joints move as they were recorded, whatever is missing. A free base and the modes of links that bend move
otherwise where something on them was left out. With v the deviation of the base's twist (in its axes) and of
the modes' rates, x that of the modes, all about the motion that the description foretells, to first order

    Z v' + G v + H x + w = 0,        from rest where the description puts it,

w what the change adds to the generalised forces that the foretold motion needs. Z, G, H and w depend on the
numbers of the change; matrices hold for a pose, w is linear between samples, so that transitions are exact
exponentials. What the joints have to give then follows without any such approximation, from the equations of
motion at the deviating twist, rates and shapes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.modal.courses import march, transitions
from reference_model.dynamics.symbolic import SymbolicRobot
from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion

__all__ = ["Deviation", "Equations", "PassiveCourse", "skew"]

Array = NDArray[np.float64]

#: Poses along a recording at which matrices are taken.
POSES = 128


@dataclass(frozen=True)
class Equations:
    """Z, G, H at Q poses, shapes (Q, p, p), (Q, p, p), (Q, p, d), and w, shape (N, p).

    The p velocities are those of the base (6, where it is free) and of d coordinates: modes, and whatever
    else a change adds behind them.
    """

    inertia: Array
    lossy: Array
    elastic: Array
    force: Array

    def less(self, other: Equations, step: float) -> Equations:
        """Difference quotient."""
        return Equations(*((a - b) / step for a, b in zip(vars(self).values(), vars(other).values())))


@dataclass(frozen=True)
class Deviation:
    """v and x at every sample, shapes (N, p) and (N, d)."""

    rates: Array
    shapes: Array

    def plus(self, other: Deviation, step: float) -> Deviation:
        """This one and so much of another."""
        return Deviation(self.rates + step * other.rates, self.shapes + step * other.shapes)


class PassiveCourse:
    """Base and modes of a robot along the motion that is foretold of the described one.

    Attributes:
        along: dynamics of the described robot there.
        model: the robot: the described one, or another with the same coordinates and inertial numbers.
        free: 6 where the base is free, else 0.
        modes: number s of modal coordinates.
    """

    def __init__(self, along: MotionDynamics, model: RobotModel | None = None) -> None:
        self.along, self.model = along, model or along.model
        self.free = 0 if along.base is None else 6
        self.modes = self.model.tree.modal
        samples = along.motion.time.size
        count = min(POSES, samples)
        self.pose = np.arange(samples) * count // samples
        self.at = np.searchsorted(self.pose, np.arange(count)) + samples // count // 2
        self.at = np.minimum(self.at, samples - 1)
        last = self.model.rows
        self.rows = np.r_[0 : self.free, last - self.modes : last]
        self.joints = slice(self.free, self.free + len(self.model.joints))

    @property
    def size(self) -> int:
        """Number of velocities that follow."""
        return self.free + self.modes

    @cached_property
    def twist(self) -> Array:
        """Foretold [linear; angular] velocity of the base in its axes, shape (N, 6)."""
        base = self.along.base
        assert base is not None
        return np.hstack([base.linear_velocity, base.angular_velocity])

    @cached_property
    def mass(self) -> Array:
        """Mass matrix of all rows along the foretold motion, shape (N, rows, rows)."""
        along = self.along
        return self.model.mass_matrix(
            along.state[0], base=along.base, inner=along.inner, inertial=along.about
        )

    @cached_property
    def still(self) -> Equations:
        """Of the described robot, without any force."""
        along, p = self.along, self.size
        passive = along.passive_at(self.at)
        state = tuple(part[self.at] for part in along.state)
        given = passive["base"], passive["inner"], along.about
        build = _by_passive_free if self.free else _by_passive_fixed
        flat = self.model.evaluate(build, (state[0], state[1], state[2]), given)
        by = [part.reshape(len(part), -1, self.model.rows).transpose(0, 2, 1)[:, self.rows] for part in flat]
        inertia = self.model.mass_matrix(state[0], base=given[0], inner=given[1], inertial=given[2])
        inertia = inertia[:, self.rows][:, :, self.rows]
        lossy, elastic = by[0], by[1]
        if self.free:  # the acceleration of the base is the rate of its twist, and what turns with it
            linear, angular = self.twist[self.at, :3], self.twist[self.at, 3:]
            turning = np.zeros((len(self.at), p, p))
            turning[:, :3, :3], turning[:, :3, 3:6] = skew(angular), -skew(linear)
            lossy = lossy + inertia @ turning
        return Equations(inertia, lossy, elastic, np.zeros((along.motion.time.size, p)))

    def needed(self, moved: Deviation) -> Array:
        """All rows at the deviating motion, base and modes without acceleration, shape (N, rows)."""
        base, inner = self.along.base, self.along.inner
        count = len(moved.rates)
        if base is not None:
            none = np.zeros((count, 3))
            base = BaseMotion(
                base.attitude,
                base.angular_velocity + moved.rates[:, 3:6],
                base.linear_velocity + moved.rates[:, :3],
                none,
                none,
            )
        if inner is not None:
            s, f = self.modes, self.free
            inner = replace(
                inner,
                modal=inner.modal + moved.shapes[:, :s],
                modal_rates=inner.modal_rates + moved.rates[:, f : f + s],
                modal_accelerations=np.zeros((count, s)),
            )
        return np.asarray(
            self.model.inverse_dynamics(*self.along.state, base=base, inner=inner, inertial=self.along.about)
        )

    def follow(self, equations: Equations) -> tuple[Deviation, tuple[Array, Array, Array]]:
        """The deviation, and the transitions with which others of the same matrices follow."""
        p, d = equations.inertia.shape[1], equations.elastic.shape[2]
        inverse = np.linalg.inv(equations.inertia)
        a = np.zeros((len(inverse), p + d, p + d))
        a[:, :p, :p] = -inverse @ equations.lossy
        a[:, :p, p:] = -inverse @ equations.elastic
        a[:, p:, p - d : p] = np.eye(d)
        b = np.zeros((len(inverse), p + d, p))
        b[:, :p] = -inverse
        moves = transitions(a, b, self.along.step)
        return self.driven(moves, equations.force[:, :, None])[0], moves

    def driven(self, moves: tuple[Array, Array, Array], forces: Array) -> list[Deviation]:
        """The deviations under forces (N, p, k)."""
        size, p = moves[0].shape[1], forces.shape[1]
        states = march(moves, self.pose, forces, np.zeros((size, forces.shape[2])))
        return [Deviation(states[:, :p, k], states[:, p:, k]) for k in range(forces.shape[2])]


def _by_passive_free(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Derivatives of inverse dynamics by [twist; modal rates] and by the modes, column-major."""
    motion, rows = robot.motion, robot.inverse_dynamics
    rates = ca.horzcat(ca.jacobian(rows, motion.base_velocity), ca.jacobian(rows, motion.modal_rates))
    return [rates, ca.jacobian(rows, motion.modal)]


def _by_passive_fixed(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    motion, rows = robot.motion, robot.inverse_dynamics
    return [ca.jacobian(rows, motion.modal_rates), ca.jacobian(rows, motion.modal)]


def skew(vectors: Array) -> Array:
    """Matrices of the cross product from the left, shape (..., 3) to (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
    o = np.zeros_like(x)
    rows = [np.stack(row, axis=-1) for row in ((o, -z, y), (z, o, -x), (-y, x, o))]
    return np.stack(rows, axis=-2)

"""A base that gives way although it is described as fixed, as six coordinates that the description lacks.

To first order in the base's displacement and turn x, in its axes, the rows of the base in the equations of
motion are those of `responses/hidden_modes.py`, f what the ground must give beyond what its preload carries,
K and C of the springs between them. The preload stays in inertial axes while the base turns, which adds to H.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.motion.estimate import Motion
from missing_physics.diagnosis.responses.hidden_modes import Constants, HiddenModes, oscillators
from reference_model.dynamics.symbolic import SymbolicRobot
from reference_model.evaluation.model import RobotModel
from reference_model.kinematics.spatial import quaternion_from_rpy
from reference_model.passive.base_motion import BaseMotion
from robot_model import Robot

__all__ = ["GivingBase"]

Array = NDArray[np.float64]

#: Displacements, and turns, among the six coordinates.
MOVED, TURNED = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])

#: Joints that move in this time [s] by less than this part of their travel are at rest.
REST, STANDSTILL = 0.05, 1e-3


class GivingBase(HiddenModes):
    """The coordinates of a base on springs."""

    names = ("compliance", "arm", "damping", "mass", "inertia")
    sizes = ("mass", "inertia")

    def __init__(self, loose: Robot, values: tuple[float, ...], along: MotionDynamics) -> None:
        """Evaluate the matrices.

        Args:
            loose: the robot with a free base that is as heavy as these `values` of `names` make it.
            along: the described robot's dynamics along the motion.
        """
        model = RobotModel(loose)
        self._carried = values[3] * MOVED + values[4] * TURNED
        self._attitude = quaternion_from_rpy(loose.base.rpy)
        first = along.state[0][:1]
        still = np.zeros_like(first)
        held = model.inverse_dynamics(first, still, still, base=self._at_rest(1))[0, :6]
        self._held, self._turned = held, np.zeros((6, 6))
        self._turned[:3, 3:], self._turned[3:, 3:] = _skew(held[:3]), _skew(held[3:])
        super().__init__(model, along, values)
        if _at_rest(along.motion):
            self.slowest = self.slowest[:, :0]

    @property
    def _count(self) -> int:
        return 6

    def _at_rest(self, samples: int) -> BaseMotion:
        return BaseMotion.at_rest(self._attitude, samples)

    def _all_constants(self, values: tuple[float, ...]) -> tuple[Constants, tuple[Constants, ...]]:
        compliance, arm, damping, mass, inertia = values
        elastic, by_arm = (MOVED + arm**2 * TURNED) / compliance, 2 * arm * TURNED / compliance
        none = np.zeros((6, 6))
        derived = (
            (-elastic / compliance, -damping * elastic / compliance, none),
            (by_arm, damping * by_arm, none),
            (none, elastic, none),
            (none, none, MOVED),
            (none, none, TURNED),
        )
        heavier = mass * MOVED + inertia * TURNED - self._carried
        return (elastic, damping * elastic, heavier), derived

    def _evaluate(
        self, rows: NDArray[np.int_] | slice, kept: NDArray[np.bool_]
    ) -> tuple[list[Array], list[Array], Array]:
        q, qd, qdd = (part[rows] for part in self._along.state)
        given = self._at_rest(len(q)), None, None
        needed, *derivatives = self._model.evaluate(_about_rest, (q, qd, qdd), given)
        parts = [part.reshape(len(part), 6, -1).transpose(0, 2, 1) for part in derivatives]
        own = [part[:, :6] for part in parts]
        own[0] = own[0] - self._turned
        force = needed[:, :6] - self._held
        return (
            [part[:, kept][:, :, kept] for part in own],
            [part[:, 6:][:, :, kept] for part in parts],
            force[:, kept],
        )

    def scan(self, periods: Array, damping: float) -> tuple[Array, Array]:
        """Torques by a base of unit mass and one of unit inertia that move as oscillators, for many periods.

        Each coordinate by itself and the motion through the filter of all torques beforehand, at the kept
        samples only: good enough to find where to look. Where the base need not start at rest, what a start
        of each coordinate adds follows.

        Args:
            periods: [s], shape (P,).
            damping: ratio.

        Returns:
            Of displacements and of turns, shape (M, n, P, c) each.
        """
        motion, course = self._along.motion, self._coarse
        kept = motion.low_pass.kept(motion.time.size)
        shown = self._shown_at_poses[self._pose[course.samples]]
        turn = np.full(len(course.samples), 2 * np.pi)
        poles = complex(-damping, np.sqrt(1 - damping**2)) * 2 * np.pi / periods
        rings = np.exp(poles * (course.samples * self._along.step)[:, None])
        forced = [np.zeros((len(turn), shown.shape[1], periods.size, 1)) for _ in range(2)]
        rung: list[list[Array]] = [[], []]
        for k, place in enumerate(np.flatnonzero(self._kept)):
            group, seen = int(place >= 3), shown[:, :, k, None]
            moved = oscillators(turn, -course.force[:, k], periods, damping, course.step)
            forced[group][..., 0] += seen * moved[:, None, :]
            if self.slowest.shape[1]:
                rung[group] += [(seen * part[:, None, :])[..., None] for part in (rings.real, rings.imag)]
        one, other = (
            np.concatenate([part, *more], axis=3)[kept.start // kept.step :]
            for part, more in zip(forced, rung)
        )
        return one, other

    def mean_inertia(self) -> tuple[float, float]:
        """What arm and described base add to mass [kg] and moment of inertia [kg m^2] of the mount."""
        inertia = np.mean(self._at_poses[2], axis=0) - self._carried[np.ix_(self._kept, self._kept)]
        turns = np.flatnonzero(self._kept) >= 3
        own = np.diagonal(inertia)
        one, other = (float(own[part].mean()) if part.any() else 0.0 for part in (~turns, turns))
        return one, other


def _at_rest(motion: Motion) -> bool:
    """Whether the joints rest when the recording begins, so that a base on springs does."""
    soon = np.searchsorted(motion.time, motion.time[0] + REST)
    moved = np.ptp(motion.position[: max(soon, 2)], axis=0)
    allowed = np.maximum(STANDSTILL * np.ptp(motion.position, axis=0), 5.0 * motion.position_noise)
    return bool(np.all(moved <= allowed))


def _about_rest(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Inverse dynamics; its derivatives by place and turn of the base, their rates, their accelerations."""
    motion, rows = robot.motion, robot.inverse_dynamics
    w, x, y, z = ca.vertsplit(motion.attitude)
    turning = ca.vertcat(
        ca.horzcat(-x, -y, -z), ca.horzcat(w, -z, y), ca.horzcat(z, w, -x), ca.horzcat(-y, x, w)
    )
    by_turn = ca.jacobian(rows, motion.attitude) @ turning / 2
    by_place = ca.horzcat(ca.SX(rows.shape[0], 3), by_turn)
    by = (ca.jacobian(rows, moved) for moved in (motion.base_velocity, motion.base_acceleration))
    return [rows, by_place, *by]


def _skew(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])

"""What a force on a body does to the joints along a recorded motion, by the effect's own equations.

The wrench of a `ForceEffect` without states is a function of how its point moves, and the point's motion
follows from that of the joints where the base is fixed. What it adds to the torques that the motion needs is
-J^T w, J the velocity of the point by those of the joints: linear in the wrench, whatever else acts.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.terms.term import Term
from reference_model.dynamics.outside import Outside
from reference_model.dynamics.symbolic import SymbolicRobot
from reference_model.effects.body_force import BodySignals, ForceEffect
from reference_model.evaluation.evaluator import Build
from reference_model.kinematics.spatial import rotation_from_rpy
from reference_model.plant.body_forces import point_on

__all__ = ["Pushes"]

Array = NDArray[np.float64]
Point = tuple[float, float, float]


class Pushes:
    """Forces on bodies along the motion of one recording.

    Args:
        dynamics: of the nominal robot, whose base is fixed, along the motion.
        reduce: filters and decimates predictions of shape (N, m, k).
    """

    def __init__(self, dynamics: MotionDynamics, reduce: Callable[[Array], Array]) -> None:
        self._dynamics, self._reduce = dynamics, reduce
        self._builds: dict[tuple[str, str, Point], Build] = {}
        self._paths: dict[tuple[str, Point], tuple[Array, Array]] = {}

    def contribution(self, term: Term) -> tuple[Array, Array]:
        """What `term` adds to the predictions, shape (M, m), and its derivatives, shape (M, m, k)."""
        effect = term.effect
        assert isinstance(effect, ForceEffect)
        key = (effect.id, term.at, effect.point(term.parameters))
        if key not in self._builds:
            self._builds[key] = _generalised(effect, term.at, key[2])
        time = self._dynamics.motion.time
        values = np.array([term.parameters[p.name] for p in effect.parameters])
        extra = np.column_stack([time, np.tile(values, (time.size, 1))])
        (flat,) = self._evaluate(self._builds[key], extra)
        rows = flat.reshape(time.size, 1 + len(effect.estimated), -1).transpose(0, 2, 1)
        outputs = self._reduce(self._dynamics.response(rows))
        names = [p.name for p in effect.estimated]
        return outputs[:, :, 0], outputs[:, :, [1 + names.index(name) for name in term.free]]

    def path(self, link: str, point: Point) -> tuple[Array, Array]:
        """How a point of a link moves, and what unit forces on it add to the torques, at the kept samples.

        Returns:
            Position in the inertial frame [m], shape (M, 3); change of the torques by a force in inertial
            axes [m or -], shape (M, n, 3).
        """
        key = (link, point)
        if key not in self._paths:
            motion = self._dynamics.motion
            kept = motion.low_pass.kept(motion.time.size)
            where, flat = self._evaluate(_path(link, point), motion.time[:, None])
            lever = flat.reshape(motion.time.size, 3, -1).transpose(0, 2, 1)
            self._paths[key] = where[kept], self._dynamics.response(lever)[kept]
        return self._paths[key]

    def _evaluate(self, build: Build, extra: Array) -> tuple[Array, ...]:
        along = self._dynamics
        return along.model.evaluate(build, along.state, (along.base, along.inner, None), extra)


def _at(robot: SymbolicRobot, link: str, point: Point, time: ca.SX) -> tuple[BodySignals, ca.SX]:
    """How the point moves, and what a wrench at it, in its axes, adds to inverse dynamics, rows x 6."""
    body = robot.tree.index(link)
    column = ca.SX.sym("f", robot.mechanism.states[body].velocity.shape[0])
    outside = Outside(columns={body: column})
    pushed = SymbolicRobot(
        robot.robot, robot.motion, robot.inertial, tree=robot.tree, outside=lambda mechanism: outside
    )
    base = robot.robot.base
    home = np.asarray(base.position, dtype=float), rotation_from_rpy(base.rpy)
    signals, spread = point_on(robot.mechanism, body, np.asarray(point, dtype=float), time, home)
    return signals, ca.jacobian(pushed.inverse_dynamics, column) @ spread.T


def _generalised(effect: ForceEffect, link: str, point: Point) -> Build:
    """Change of inverse dynamics by the effect, and its derivatives by what is estimated."""

    def build(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
        values = {p.name: extra[1 + k] for k, p in enumerate(effect.parameters)}
        signals, lever = _at(robot, link, point, extra[0])
        rows = lever @ effect.wrench(signals, values, ca.SX(0, 1))
        by = ca.jacobian(rows, ca.vertcat(*(values[p.name] for p in effect.estimated)))
        return [ca.horzcat(rows, by)]

    return build


def _path(link: str, point: Point) -> Build:
    def build(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
        signals, lever = _at(robot, link, point, extra[0])
        return [signals.position, lever[:, :3] @ signals.rotation.T]

    return build

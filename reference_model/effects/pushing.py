"""Wrench of a force effect along a known motion of its body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import Batched
from reference_model.effects.body_force import BodySignals, ForceEffect
from reference_model.kinematics.spatial import rotation_from_rpy
from robot_model import Robot

__all__ = ["BodySeries", "ForceAlong"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BodySeries:
    """Motion of a rigid body, N samples.

    Attributes:
        time: [s], shape (N,).
        position: of the body's frame in the inertial one [m], shape (N, 3).
        rotation: body to inertial axes, shape (N, 3, 3).
        velocity: inertial, [linear; angular] in body axes [m/s, rad/s], shape (N, 6).
    """

    time: Array
    position: Array
    rotation: Array
    velocity: Array

    @property
    def rows(self) -> Array:
        """Side by side, rotations column by column, shape (N, 19)."""
        flat = self.rotation.transpose(0, 2, 1).reshape(len(self.time), 9)
        return np.column_stack([self.time, self.position, flat, self.velocity])


class ForceAlong:
    """A force effect at a rigid body, along a known motion of the body.

    Args:
        effect: catalogue entry; its equations are built once for each place of a base and kept.
        robot: to which the body belongs.
    """

    def __init__(self, effect: ForceEffect, robot: Robot) -> None:
        self.effect = effect
        home = (*robot.base.position, *rotation_from_rpy(robot.base.rpy).ravel())
        self._force, self._slopes, self._step = _formulas(effect, tuple(map(float, home)))

    def wrench(self, signals: BodySeries, parameters: Mapping[str, float]) -> Array:
        """[force; moment] on the body about its frame's origin, body axes [N, N m], shape (N, 6).

        States of the effect are integrated by the classical Runge-Kutta method, with signals linear between
        samples.
        """
        p = {**self.effect.defaults(), **parameters}
        if not self.effect.acts(p):
            return np.zeros((len(signals.time), 6))
        constants, rows = self._constants(p), signals.rows
        states = np.zeros((len(rows), 0))
        if self.effect.states:
            first, steps = np.array(self.effect.initial_state(p), dtype=float), len(rows) - 1
            spans = np.hstack([rows[:-1], rows[1:]]).T
            march = self._step.mapaccum(steps)
            rest = march(first, spans, np.tile(constants[:, None], steps)).full().T
            states = np.vstack([first[None], rest])
        return np.asarray(self._force(rows, states, constants)[0])

    def slopes(self, signals: BodySeries, parameters: Mapping[str, float], names: Sequence[str]) -> Array:
        """Derivatives of the wrench with respect to parameters, for an effect without states, (N, 6, P)."""
        p = {**self.effect.defaults(), **parameters}
        constants = self._constants(p)
        flat = self._slopes(signals.rows, np.zeros((len(signals.time), 0)), constants)[0]
        places = [[q.name for q in self.effect.parameters].index(name) for name in names]
        return np.asarray(flat.reshape(len(flat), constants.size, 6).transpose(0, 2, 1)[:, :, places])

    def _constants(self, p: Mapping[str, float]) -> Array:
        return np.array([p[parameter.name] for parameter in self.effect.parameters], dtype=float)


@lru_cache(maxsize=16)
def _formulas(effect: ForceEffect, home: tuple[float, ...]) -> tuple[Batched, Batched, ca.Function]:
    """Functions of row, states and constants: the wrench, and its derivatives with respect to constants.

    The third is a function of state, rows at both ends and constants: the state one interval later.
    """
    count = len(effect.parameters)
    row, states, constants = ca.SX.sym("s", 19), ca.SX.sym("z", effect.states), ca.SX.sym("c", count)
    p = {parameter.name: constants[k] for k, parameter in enumerate(effect.parameters)}
    arm, frame = ca.vertcat(*effect.point(p)), (np.array(home[:3]), np.array(home[3:]).reshape(3, 3))

    def signals(of: ca.SX) -> BodySignals:
        time, position, flat, linear, angular = ca.vertsplit(of, [0, 1, 4, 13, 16, 19])
        rotation = ca.reshape(flat, 3, 3)
        moved = ca.vertcat(linear + ca.cross(angular, arm), angular)
        return BodySignals(time, position + rotation @ arm, rotation, moved, *frame)

    pushed = effect.wrench(signals(row), p, states)
    about = ca.vertcat(pushed[:3], pushed[3:] + ca.cross(arm, pushed[:3]))
    inputs = [row, states, constants]
    force = ca.Function("wrench", inputs, [ca.densify(about)], {"cse": True})
    by_each = ca.vec(ca.densify(ca.jacobian(about, constants)))
    slopes = ca.Function("slopes", inputs, [by_each], {"cse": True})
    ends = ca.SX.sym("e", 38)
    first, last = ca.vertsplit(ends, 19)
    h, middle = last[0] - first[0], (first + last) / 2

    def rate(at: ca.SX, z: ca.SX) -> ca.SX:
        return effect.state_rate(signals(at), p, z)

    k1 = rate(first, states)
    k2 = rate(middle, states + h / 2 * k1)
    k3 = rate(middle, states + h / 2 * k2)
    k4 = rate(last, states + h * k3)
    later = ca.densify(states + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return (
        Batched(force),
        Batched(slopes),
        ca.Function("step", [states, ends, constants], [later], {"cse": True}),
    )

"""The closed loop of a robot as expressions in which its numbers are symbols.

The engine's own `Plant` has the numbers built in and smooths dry friction for a variable-step integrator.
Here the same effects, controllers and recursion are put together for time stepping with exact stick and for
derivatives by any of the robot's numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from missing_physics.diagnosis.free_run.numbers import PAIRS, REFERENCE_DELAY, adjustables
from reference_model.control.laws import Goal, command, drive, has_integral, sample_time
from reference_model.dynamics.balance import LOADS
from reference_model.dynamics.inertial import BODY_NUMBERS, inertial_names, nominal_inertial
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.effects.base import BodyEffect, GearEffect, JointSignals, SensorEffect, SensorSignals
from reference_model.effects.catalogue import UsedEffect, used_effects
from reference_model.plant.acting import JointForces, Signals
from robot_model import InputError, Robot, VoltageServo

__all__ = ["LoopModel", "Row", "State"]

#: A direction s reaches the friction laws through the transition speed w = v s / SURE: tanh(v/w) is s to
#: rounding, whatever the speed.
SURE = 40.0
#: Stands for a speed of zero where laws divide by it [rad/s or m/s].
STANDSTILL = 1e-30


@dataclass(frozen=True)
class Row:
    """What a free run is told at one instant.

    Attributes:
        time: [s].
        reference, rate, acceleration: of the controller's reference, n x 1.
        temperature: of the joints [K], n x 1.
        on: 1 where the drive is on, else 0: the winding is open and gives no torque.
        supply: supply voltage as a multiple of the controller's.
        tick: 1 where a sampled controller acts.
    """

    time: ca.SX
    reference: ca.SX
    rate: ca.SX
    acceleration: ca.SX
    temperature: ca.SX
    on: ca.SX
    supply: ca.SX
    tick: ca.SX

    @classmethod
    def ends(cls, joints: int) -> list[int]:
        """Where the parts of a row's column end, from 0."""
        return np.cumsum([0, 1, joints, joints, joints, joints, 1, 1, 1]).tolist()

    @classmethod
    def of(cls, column: ca.SX, joints: int) -> Row:
        """The parts of a column."""
        return cls(*ca.vertsplit(column, cls.ends(joints)))


@dataclass(frozen=True)
class State:
    """The state of a free run: positions, velocities, states of the effects, integrated position errors,
    commands that a sampled controller holds, and the largest error of the steps' solution so far."""

    position: ca.SX
    velocity: ca.SX
    effects: ca.SX
    integral: ca.SX
    held: ca.SX
    worst: ca.SX

    @property
    def column(self) -> ca.SX:
        """All of it."""
        parts = self.position, self.velocity, self.effects, self.integral, self.held, self.worst
        return ca.densify(ca.vertcat(*parts))


class _DirectedForces(JointForces):
    """A robot's effects while its joints slide in given directions, at recorded temperatures."""

    direction: ca.SX
    temperature: ca.SX

    def _view(self, signals: Signals, k: int, friction: ca.SX) -> JointSignals:
        return replace(
            super()._view(signals, k, friction),
            temperature=self.temperature[k],
            transition=signals.velocity[k] * self.direction[k] / SURE,
        )


class LoopModel:
    """A robot with a fixed base, its effects and its controller.

    Attributes:
        names: of all numbers, in the order of `constants`.
        symbols: name to symbol.
        constants: all symbols in one column.
        joints: number n of moving joints.
        sizes: rows of the parts of `State`.
        sampled: the controller acts at instants and holds its command between them.

    Raises:
        InputError: a free base, or a motor that moves by itself.
    """

    def __init__(self, robot: Robot) -> None:
        if robot.base.kind == "free":
            raise InputError(f"robot '{robot.name}' floats; free runs are made for robots with a fixed base.")
        geared = [used.at for used in used_effects(robot) if isinstance(used.effect, GearEffect)]
        if geared:
            raise InputError(
                f"robot '{robot.name}': the motor of {geared[0]} moves by itself; free runs are made for "
                "stiff gears without play."
            )
        self.robot = robot
        self.names = tuple(adjustables(robot))
        self.symbols = {name: ca.SX.sym(name) for name in self.names}
        self.constants = ca.vertcat(*self.symbols.values())
        self.joints = len(robot.moving_joints)
        self._used = tuple(self._symbolic(used) for used in used_effects(robot))
        self._forces = _DirectedForces(robot, self._used)
        self._inertial = self._mass_properties()
        self.sampled = sample_time(robot) > 0
        self._integrates = has_integral(robot)
        n = self.joints
        self.sizes = (n, n, self._forces.states, n * self._integrates, n * self.sampled, 1)

    def state(self, column: ca.SX) -> State:
        """The parts of a state's column."""
        return State(*ca.vertsplit(column, np.cumsum([0, *self.sizes]).tolist()))

    def _symbolic(self, used: UsedEffect) -> UsedEffect:
        start = f"{used.effect.id}@{used.at}."
        symbols: Any = MappingProxyType({key: self.symbols[start + key] for key in used.parameters})
        return replace(used, parameters=symbols)

    def _mass_properties(self) -> ca.SX:
        """The numbers of `inertial_names` made of the symbols, with the body effects added, P x 1."""
        robot, symbols = self.robot, self.symbols
        reflected = []
        for joint in robot.moving_joints:
            motor = joint.actuator
            ratio = motor.gear_ratio if motor else 0.0
            reflected.append(symbols[f"{joint.name}.rotor_inertia"] * ratio**2 if motor else ca.SX(0.0))
        gravity = [symbols[f"gravity.{axis}"] for axis in "xyz"]
        numbers = ca.vertcat(*(self._ten(link.name) for link in robot.links), *reflected, *gravity)
        names = inertial_names(robot)
        for used in self._used:
            if not isinstance(used.effect, BodyEffect):
                continue
            terms = used.effect.terms(used.parameters)
            numbers[-3:] += terms.gravity
            if f"{used.at}.mass" in names:  # a fixed base has no mass that matters
                start = names.index(f"{used.at}.mass")
                ten = ca.vertcat(terms.mass, terms.first_moment, *_entries(ca.SX(terms.inertia)))
                numbers[start : start + len(BODY_NUMBERS)] += ten
        return ca.densify(numbers)

    def _ten(self, link: str) -> ca.SX:
        """Mass, first moment and inertia about the link's origin, of its mass, centre and central inertia."""
        mass = self.symbols[f"{link}.mass"]
        centre = ca.vertcat(*(self.symbols[f"{link}.center_of_mass.{axis}"] for axis in "xyz"))
        central = ca.vertcat(*(self.symbols[f"{link}.inertia.{pair}"] for pair in PAIRS))
        steiner = mass * (ca.dot(centre, centre) * ca.SX.eye(3) - centre @ centre.T)
        return ca.vertcat(mass, mass * centre, central + ca.vertcat(*_entries(steiner)))

    def mechanism(self, q: ca.SX, v: ca.SX, a: ca.SX) -> SymbolicRobot:
        """The rigid robot in motion, with its true mass properties."""
        motion = Motion(q, v, a, **SymbolicRobot.still_base(self.robot))
        return SymbolicRobot(self.robot, motion, self._inertial)

    def command(self, row: Row, q: ca.SX, v: ca.SX, integral: ca.SX) -> ca.SX:
        """The controller's command, n x 1; the delay of its reference counts to first order."""
        late = self.symbols[REFERENCE_DELAY]
        reference = row.reference - late * row.rate
        if isinstance(self.robot.controller, VoltageServo):
            gains = [self.symbols[f"controller.gain.{joint.name}"] for joint in self.robot.moving_joints]
            duty = ca.fmax(-1, ca.fmin(1, ca.vertcat(*gains) * (reference - q)))
            return self.symbols["controller.supply"] * row.supply * duty
        goal = Goal(reference, row.rate - late * row.acceleration, row.acceleration, integral)
        motion = Motion(q, v, ca.SX(self.joints, 1), **SymbolicRobot.still_base(self.robot))
        return command(self.robot, motion, goal, nominal_inertial(self.robot))

    def torque(self, row: Row, commanded: ca.SX, v: ca.SX) -> ca.SX:
        """Actuator torque at the joints, n x 1; none while the drive is off.

        Raises:
            InputError: a voltage servo without torque constant or resistance.
        """
        if not isinstance(self.robot.controller, VoltageServo):
            return row.on * drive(self.robot, commanded, v)
        drive(self.robot, commanded, v)  # complains about what is missing
        torques = []
        for k, joint in enumerate(self.robot.moving_joints):
            if joint.actuator is None:
                torques.append(ca.SX(0.0))
                continue
            constant = joint.actuator.gear_ratio * self.symbols[f"{joint.name}.torque_constant"]
            back_emf = constant * v[k]
            torque = constant * (commanded[k] - back_emf) / self.symbols[f"{joint.name}.resistance"]
            limit = joint.actuator.torque_limit
            torques.append(torque if limit is None else ca.fmax(-limit, ca.fmin(limit, torque)))
        return row.on * ca.vertcat(*torques)

    def commanded(self) -> ca.Function:
        """(q, v, integrated position errors, row, constants) -> torque that the controller commands there."""
        n = self.joints
        q, v, integral = (ca.SX.sym(name, n) for name in ("q", "v", "integral"))
        column = ca.SX.sym("row", Row.ends(n)[-1])
        row = Row.of(column, n)
        torque = self.torque(row, self.command(row, q, v, integral), v)
        return ca.Function("commanded", [q, v, integral, column, self.constants], [ca.densify(torque)])

    def act(self, row: Row, signals: Signals, states: ca.SX, direction: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Forces of all effects on the joints, n x 1, and the rates of their states."""
        still = ca.fabs(signals.velocity) < STANDSTILL
        moving = replace(signals, velocity=ca.if_else(still, STANDSTILL, signals.velocity))
        self._forces.direction, self._forces.temperature = direction, row.temperature
        total, rates, _ = self._forces.act(moving, states)
        return total, rates

    def settled(self, row: Row, q: ca.SX, v: ca.SX) -> ca.SX:
        """States of the effects at the start, under the first commanded torque."""
        torque = self.torque(row, self.command(row, q, v, ca.SX(self.joints, 1)), v)
        still, loads = ca.SX(self.joints, 1), ca.SX(len(LOADS), self.joints)
        moving = ca.if_else(ca.fabs(v) < STANDSTILL, STANDSTILL, v)
        self._forces.direction, self._forces.temperature = ca.sign(v), row.temperature
        return self._forces.initial(Signals(row.time, q, moving, still, torque, loads))

    def measured(self, row: Row, q: ca.SX, v: ca.SX) -> ca.SX:
        """What the position sensors say, n x 1, with their errors to first order."""
        values = []
        for k, joint in enumerate(self.robot.moving_joints):
            value = q[k]
            for used in self._used:
                if isinstance(used.effect, SensorEffect) and used.at == f"{joint.name}.position":
                    value += used.effect.error(SensorSignals(row.time, value, v[k]), used.parameters)
            values.append(value)
        return ca.vertcat(*values)


def _entries(matrix: ca.SX) -> list[ca.SX]:
    """The entries of a symmetric 3 x 3 matrix in the order of `PAIRS`."""
    return [matrix["xyz".index(pair[0]), "xyz".index(pair[1])] for pair in PAIRS]

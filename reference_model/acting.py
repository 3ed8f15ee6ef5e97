"""All effects of a robot gathered into one function of the joints' signals."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.balance import LOADS
from reference_model.effects.base import BodyEffect, BodyTerms, JointEffect, JointSignals, SensorEffect
from reference_model.effects.catalogue import UsedEffect
from reference_model.effects.signals import smooth_sign
from reference_model.effects.structure import StructureEffect
from reference_model.flexible import FlexibleBody
from reference_model.flexible.attached import attached
from reference_model.inertial import BODY_NUMBERS, inertial_names
from reference_model.joint.clearance import Bearings
from reference_model.joint.temperature import AMBIENT_TEMPERATURE, Temperatures
from reference_model.tree import flexible_bodies
from robot_model import InputError, Robot

__all__ = [
    "AMBIENT_TEMPERATURE",
    "TRANSITION",
    "JointForces",
    "Signals",
    "bodies_with",
    "inertial_with",
    "sensor_effects",
]

#: Speed over which a discontinuous friction law is smoothed [rad/s or m/s]. A smoothed joint creeps under
#: load at about this speed, 0.1 mrad in a second, below what encoders resolve over a motion.
TRANSITION = 1e-4


@dataclass(frozen=True)
class Signals:
    """What effects at joints see, for all moving joints at once.

    Attributes:
        time: [s].
        position, velocity, acceleration: n x 1.
        torque: commanded actuator torque at the joint, n x 1.
        loads: of the bearings, rows `balance.LOADS`, 4 x n.
        direction: in which joints slide, -1, 0 or 1, n x 1; None smooths the sign of the velocity.
        motor_position, motor_velocity: of the motors at the joint side, n x 1; None where all move with their
            joints.
        temperature: of the joints [K], n x 1; None where `JointForces` is to say it.
    """

    time: ca.SX
    position: ca.SX
    velocity: ca.SX
    acceleration: ca.SX
    torque: ca.SX
    loads: ca.SX
    direction: ca.SX | None = None
    motor_position: ca.SX | None = None
    motor_velocity: ca.SX | None = None
    temperature: ca.SX | None = None

    @property
    def sign(self) -> ca.SX:
        """sgn(velocity) of every joint, smoothed unless the direction is given, n x 1."""
        return smooth_sign(self.velocity, TRANSITION) if self.direction is None else self.direction


class JointForces:
    """The effects that act on joints, with their parameters.

    Args:
        robot: the description.
        effects: checked effects; those of other kinds are passed over.
        geared: places of the joints whose motor moves by itself (see `gears`); effects of their actuators act
            on the motor and see its motion.

    Attributes:
        states: number of internal states of all of them.
        bristles: joint name and place of the state, for friction laws with one internal state.
        temperatures: of the joints; their states come behind those of effects.
        bearings: with clearance; their states come last.
    """

    def __init__(self, robot: Robot, effects: Sequence[UsedEffect], geared: Collection[int] = ()) -> None:
        self._robot, self._geared = robot, frozenset(geared)
        self._places: list[tuple[int, UsedEffect, JointEffect, slice]] = []
        self.states = 0
        names = [joint.name for joint in robot.moving_joints]
        for used in effects:
            if not isinstance(used.effect, JointEffect):
                continue
            if used.at not in names:
                raise InputError(
                    f"robot '{robot.name}', effect '{used.effect.id}' at '{used.at}': "
                    "the reference engine simulates it at moving joints only."
                )
            rows = slice(self.states, self.states + used.effect.states)
            self._places.append((names.index(used.at), used, used.effect, rows))
            self.states = rows.stop
        self.temperatures = Temperatures(robot)
        self._warm = slice(self.states, self.states + self.temperatures.states)
        self.bearings = Bearings(robot)
        self._struck = slice(self._warm.stop, self._warm.stop + self.bearings.states)
        self.states = self._struck.stop
        self.bristles = tuple(
            (names[k], rows.start)
            for k, _, effect, rows in self._places
            if effect.is_friction_law and effect.states == 1
        )

    def act(self, signals: Signals, states: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Sum of all forces on the joints (n x 1), rates of the states, and the friction among the forces.

        What acts on a motor that moves by itself is not among the forces; see `on_motors`.
        """
        count = signals.position.shape[0]
        signals = self._tempered(signals, states)
        views = [self._view(signals, k, ca.SX(0.0)) for k in range(count)]
        law = [ca.SX(0.0)] * count
        for k, used, effect, rows in self._places:
            if effect.is_friction_law:
                law[k] += effect.torque(views[k], used.parameters, states[rows])
        views = [self._view(signals, k, law[k]) for k in range(count)]
        friction, total = list(law), list(law)
        rates = ca.SX(self.states, 1)
        for k, used, effect, rows in self._places:
            apart = self._on_motor(k, effect)
            if effect.states:
                view = self._motor_view(signals, k) if apart else views[k]
                rates[rows] = effect.state_rate(view, used.parameters, states[rows])
            if not effect.is_friction_law and not apart:
                force = effect.torque(views[k], used.parameters, states[rows])
                total[k] += force
                friction[k] += force if effect.is_modifier else 0
        where = signals.position, signals.velocity, states[self._struck]
        contact, rubbing = self.bearings.forces(*where)
        rates[self._struck] = self.bearings.rates(*where)
        taken = ca.vertcat(*friction) + rubbing
        inside = self._in_motors(signals.velocity, signals.sign, apart=False)
        taken, contact = taken + inside, contact + inside
        rates[self._warm] = self.temperatures.rates(states[self._warm], taken, signals.velocity)
        return ca.vertcat(*total) + contact, ca.densify(rates), taken

    def on_motors(self, signals: Signals, states: ca.SX) -> ca.SX:
        """Sum of what effects of actuators add on motors that move by themselves, n x 1, zero elsewhere."""
        total, signals = [ca.SX(0.0)] * signals.position.shape[0], self._tempered(signals, states)
        turning = signals.velocity if signals.motor_velocity is None else signals.motor_velocity
        own = self._in_motors(turning, smooth_sign(turning, TRANSITION), apart=True)
        total = [part + own[k] for k, part in enumerate(total)]
        for k, used, effect, rows in self._places:
            if self._on_motor(k, effect):
                total[k] += effect.torque(self._motor_view(signals, k), used.parameters, states[rows])
        return ca.vertcat(*total)

    def _in_motors(self, velocity: ca.SX, sign: ca.SX, *, apart: bool) -> ca.SX:
        """Friction of motors, n x 1: of those that move by themselves (`apart`) or of all others."""
        found = [ca.SX(0.0)] * velocity.shape[0]
        for k, joint in enumerate(self._robot.moving_joints):
            motor = joint.actuator
            if motor is not None and (k in self._geared) == apart:
                dry, wet = motor.coulomb_friction, motor.viscous_friction
                found[k] = -(dry * sign[k] + wet * velocity[k]) if dry or wet else ca.SX(0.0)
        return ca.vertcat(*found)

    def _on_motor(self, k: int, effect: JointEffect) -> bool:
        return k in self._geared and effect.place == "actuator"

    def _motor_view(self, signals: Signals, k: int) -> JointSignals:
        position, velocity = signals.motor_position, signals.motor_velocity
        if position is not None and velocity is not None:
            signals = replace(signals, position=position, velocity=velocity)
        return self._view(signals, k, ca.SX(0.0))

    def initial(self, signals: Signals) -> ca.SX:
        """The states at the first instant."""
        states = ca.SX(self.states, 1)
        states[self._warm] = self.temperatures.initial
        states[self._struck] = self.bearings.initial
        signals = self._tempered(signals, states)
        for k, used, effect, rows in self._places:
            if effect.states:
                view = self._view(signals, k, ca.SX(0.0))
                states[rows] = effect.initial_state(view, used.parameters)
        return ca.densify(states)

    def warmth(self, time: ca.SX, states: ca.SX) -> ca.SX:
        """Of the joints [K], n x 1."""
        return self.temperatures.at(time, states[self._warm])

    def contact_forces(self, position: ca.SX, velocity: ca.SX, states: ca.SX) -> ca.SX:
        """Normal forces in the bearings with clearance [N]."""
        return self.bearings.normal_forces(position, velocity, states[self._struck])

    def _tempered(self, signals: Signals, states: ca.SX) -> Signals:
        return replace(signals, temperature=self.warmth(signals.time, states))

    def needs_solving(self) -> bool:
        """Whether a force depends on what it changes: accelerations or bearing loads."""
        count = len(self._robot.moving_joints)
        q, qd, qdd, u = (ca.SX.sym(name, count) for name in ("q", "qd", "qdd", "u"))
        loads = ca.SX.sym("loads", len(LOADS), count)
        signals = Signals(ca.SX.sym("t"), q, qd, qdd, u, loads)
        total = self.act(signals, ca.SX.sym("z", self.states))[0]
        return bool(ca.depends_on(total, ca.vertcat(qdd, ca.vec(loads))))

    def _view(self, signals: Signals, k: int, friction: ca.SX) -> JointSignals:
        joint = self._robot.moving_joints[k]
        bearing = joint.bearing
        return JointSignals(
            time=signals.time,
            position=signals.position[k],
            velocity=signals.velocity[k],
            acceleration=signals.acceleration[k],
            torque=signals.torque[k],
            friction=friction,
            radial_force=signals.loads[0, k],
            axial_force=signals.loads[1, k],
            bending_moment=signals.loads[2, k],
            radial_sum=signals.loads[3, k],
            temperature=ca.SX(AMBIENT_TEMPERATURE) if signals.temperature is None else signals.temperature[k],
            gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
            bearing_arms=(bearing.radial_arm, bearing.axial_arm) if bearing else (0.0, 0.0),
            transition=TRANSITION,
            direction=None if signals.direction is None else signals.direction[k],
            **self._thermal(k),
        )

    def _thermal(self, k: int) -> dict[str, Any]:
        thermal = self._robot.moving_joints[k].thermal
        if thermal is None:
            return {}
        rates = thermal.static_rate, thermal.kinetic_rate
        return {"thermal_rates": rates, "reference_temperature": thermal.reference}


def inertial_with(
    robot: Robot,
    nominal: NDArray[np.float64],
    effects: Sequence[UsedEffect],
    geared: Collection[int] = (),
) -> NDArray[np.float64]:
    """The inertial numbers with the body effects added, shape (P,).

    What a point of a flexible link carries is not among them; see `bodies_with`. Nor are the rotors of
    `geared` joints, whose motors move by themselves.
    """
    names = inertial_names(robot)
    numbers = nominal.copy()
    for k in geared:
        numbers[names.index(f"{robot.moving_joints[k].name}.reflected_inertia")] = 0.0
    for used in effects:
        if not isinstance(used.effect, BodyEffect):
            continue
        terms = used.effect.terms(used.parameters)
        numbers[-3:] += _constants(terms.gravity)
        if f"{used.at}.mass" in names and not _deforms(
            robot, used, terms
        ):  # a fixed base has no mass that matters
            start = names.index(f"{used.at}.mass")
            numbers[start : start + len(BODY_NUMBERS)] += _ten(terms)
    return numbers


def bodies_with(robot: Robot, effects: Sequence[UsedEffect]) -> dict[str, FlexibleBody]:
    """The flexible links' constants with what effects at them change, by name."""
    bodies = flexible_bodies(robot)
    for used in effects:
        if isinstance(used.effect, StructureEffect) and used.at in bodies:
            bodies[used.at] = used.effect.reshaped(bodies[used.at], used.parameters)
    for used in effects:
        if not isinstance(used.effect, BodyEffect):
            continue
        terms = used.effect.terms(used.parameters)
        if not _deforms(robot, used, terms):
            continue
        assert terms.place is not None
        body, place = bodies[used.at], _constants(terms.place)
        node = int(np.linalg.norm(body.nodes - place, axis=1).argmin())
        mass = float(_constants(ca.SX(terms.mass))[0])
        about_origin = _constants(terms.inertia).reshape(3, 3)
        central = about_origin - mass * (place @ place * np.eye(3) - np.outer(place, place))  # Steiner
        bodies[used.at] = attached(body, node, mass, place - body.nodes[node], central)
    return bodies


def _deforms(robot: Robot, used: UsedEffect, terms: BodyTerms) -> bool:
    """Whether what the effect adds takes part in the deformation of a link."""
    return terms.place is not None and any(link.name == used.at for link in robot.flexible_links)


def sensor_effects(effects: Sequence[UsedEffect]) -> tuple[tuple[SensorEffect, UsedEffect], ...]:
    """The effects that falsify channels, in the order of the robot file."""
    return tuple((used.effect, used) for used in effects if isinstance(used.effect, SensorEffect))


def _ten(terms: BodyTerms) -> NDArray[np.float64]:
    inertia = ca.SX(terms.inertia)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return _constants(ca.vertcat(terms.mass, terms.first_moment, *(inertia[pair] for pair in pairs)))


def _constants(expression: ca.SX) -> NDArray[np.float64]:
    return ca.evalf(ca.densify(ca.SX(expression))).full().ravel()

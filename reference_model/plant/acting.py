"""All joint effects of a robot combined into one function of the joints' signals."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.dynamics.balance import LOADS
from reference_model.dynamics.inertial import BODY_NUMBERS, inertial_names
from reference_model.dynamics.tree import flexible_bodies
from reference_model.effects.base import BodyEffect, BodyTerms, JointEffect, JointSignals, SensorEffect
from reference_model.effects.catalogue import UsedEffect
from reference_model.effects.signals import smooth_sign
from reference_model.effects.structure import StructureEffect
from reference_model.flexible import FlexibleBody
from reference_model.flexible.attached import attached
from reference_model.joint.clearance import Bearings
from reference_model.joint.temperature import AMBIENT_TEMPERATURE, Temperatures
from reference_model.kinematics.coupling import Coupling
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
    """Signals of effects at joints, for all moving joints at once.

    Attributes:
        time: [s].
        position, velocity, acceleration: n x 1.
        torque: commanded torque of the actuators at the joints, n x 1.
        loads: of the bearings, rows `balance.LOADS`, 4 x n.
        direction: sliding direction of the joints, -1, 0 or 1, n x 1; None smooths the sign of the velocity.
        motor_position, motor_velocity: of the drives' motors at the joint side, n x 1; None where all move
            with their joints.
        temperature: of the joints [K], n x 1; None if `JointForces` computes it.
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
    """The effects that act on joints and on motors of transmissions, with their parameters.

    Rows are the n joints and then the n drives; drives of transmissions have effects of their own, which
    depend on the motor's motion and torque, and act on the joints through the transmission.

    Args:
        robot: the description.
        effects: checked effects; those of other kinds are ignored.
        geared: indices of the drives with a separate motor coordinate (see `gears`); effects of their
            actuators, and all at a motor of a transmission, act on the motor and depend on its motion.

    Attributes:
        states: total number of internal states.
        bristles: name of joint or motor and index of the state, for friction laws with one internal state.
        temperatures: of the joints; their states follow those of effects.
        bearings: with clearance; their states come last.
    """

    def __init__(self, robot: Robot, effects: Sequence[UsedEffect], geared: Collection[int] = ()) -> None:
        self._robot, self._geared = robot, frozenset(geared)
        self._places: list[tuple[int, UsedEffect, JointEffect, slice]] = []
        self.states = 0
        self.coupling = Coupling(robot)
        joints = {joint.name: k for k, joint in enumerate(robot.moving_joints)}
        behind = {name: len(joints) + k for name, k in self.coupling.motors.items()}
        places = {**joints, **behind}
        for used in effects:
            if not isinstance(used.effect, JointEffect):
                continue
            if used.at not in places:
                raise InputError(
                    f"robot '{robot.name}', effect '{used.effect.id}' at '{used.at}': "
                    "the reference engine simulates it at moving joints and motors only."
                )
            rows = slice(self.states, self.states + used.effect.states)
            self._places.append((places[used.at], used, used.effect, rows))
            self.states = rows.stop
        self.temperatures = Temperatures(robot)
        self._warm = slice(self.states, self.states + self.temperatures.states)
        self.bearings = Bearings(robot)
        self._struck = slice(self._warm.stop, self._warm.stop + self.bearings.states)
        self.states = self._struck.stop
        self.bristles = tuple(
            (used.at, rows.start)
            for _, used, effect, rows in self._places
            if effect.is_friction_law and effect.states == 1
        )

    def act(self, signals: Signals, states: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Sum of all forces on the joints (n x 1), rates of the states, and the friction among the forces.

        Forces on motors with their own coordinate are not included; see `on_motors`.
        """
        count = signals.position.shape[0]
        signals = self._tempered(signals, states)
        total, friction = self._forces(signals, states, apart=False)
        rates = ca.SX(self.states, 1)
        for k, used, effect, rows in self._places:
            if effect.states:
                view = self._seen(signals, k, effect)
                rates[rows] = effect.state_rate(view, used.parameters, states[rows])
        where = signals.position, signals.velocity, states[self._struck]
        contact, rubbing = self.bearings.forces(*where)
        rates[self._struck] = self.bearings.rates(*where)
        inside = self._in_motors(*self._turning(signals), apart=False)
        own = [
            value if k not in self._coupled else ca.SX(0.0) for k, value in enumerate(ca.vertsplit(inside))
        ]
        taken, contact = (
            friction[:count] + rubbing + ca.vertcat(*own),
            contact + self.coupling.on_joints(inside),
        )
        rates[self._warm] = self.temperatures.rates(states[self._warm], taken, signals.velocity)
        force = total[:count] + self.coupling.on_joints(total[count:]) + contact
        if self._coupled:
            shared = [ca.SX(0.0) if k not in self._coupled else inside[k] for k in range(count)]
            taken = taken + self.coupling.on_joints(friction[count:] + ca.vertcat(*shared))
        return force, ca.densify(rates), taken

    def _forces(self, signals: Signals, states: ca.SX, *, apart: bool) -> tuple[ca.SX, ca.SX]:
        """Sum of all effects at joints and drives, and the friction among them, 2 n x 1 each [N m or N].

        Either of those on motors with their own coordinate (`apart`), or of all others.
        """
        count = 2 * signals.position.shape[0]
        chosen = [place for place in self._places if self._on_motor(place[0], place[2]) == apart]
        law = [ca.SX(0.0)] * count
        for k, used, effect, rows in chosen:
            if effect.is_friction_law:
                law[k] += effect.torque(self._seen(signals, k, effect), used.parameters, states[rows])
        friction, total = list(law), list(law)
        for k, used, effect, rows in chosen:
            if not effect.is_friction_law:
                view = replace(self._seen(signals, k, effect), friction=law[k])
                force = effect.torque(view, used.parameters, states[rows])
                total[k] += force
                friction[k] += force if effect.is_modifier else 0
        return ca.vertcat(*total), ca.vertcat(*friction)

    def on_motors(self, signals: Signals, states: ca.SX) -> ca.SX:
        """Sum of effects on motors with their own coordinate, n x 1, zero at other drives."""
        count, signals = signals.position.shape[0], self._tempered(signals, states)
        turning = self._turning(signals)[0] if signals.motor_velocity is None else signals.motor_velocity
        own = self._in_motors(turning, smooth_sign(turning, TRANSITION), apart=True)
        total = self._forces(signals, states, apart=True)[0]
        return own + total[:count] + total[count:]

    def _turning(self, signals: Signals) -> tuple[ca.SX, ca.SX]:
        """Velocity behind the drives' gears, and its sign, n x 1 each."""
        velocity = self.coupling.drives(signals.velocity)
        sign = [
            smooth_sign(velocity[k], TRANSITION) if k in self._coupled else value
            for k, value in enumerate(ca.vertsplit(signals.sign))
        ]
        return velocity, ca.vertcat(*sign)

    @property
    def _coupled(self) -> Collection[int]:
        """Indices of the motors of transmissions among the drives."""
        return self.coupling.motors.values()

    def _in_motors(self, velocity: ca.SX, sign: ca.SX, *, apart: bool) -> ca.SX:
        """Friction of motors, n x 1: of those with their own coordinate (`apart`) or of all others."""
        found = [ca.SX(0.0)] * velocity.shape[0]
        for k, drive in enumerate(self._robot.drives):
            motor = drive.actuator
            if motor is not None and (k in self._geared) == apart:
                dry, wet = motor.coulomb_friction, motor.viscous_friction
                found[k] = -(dry * sign[k] + wet * velocity[k]) if dry or wet else ca.SX(0.0)
        return ca.vertcat(*found)

    def _on_motor(self, k: int, effect: JointEffect) -> bool:
        count = len(self._robot.moving_joints)
        return k - count in self._geared if k >= count else k in self._geared and effect.place == "actuator"

    def _seen(self, signals: Signals, k: int, effect: JointEffect) -> JointSignals:
        """Signals of an effect in row k, without the friction that it may change."""
        count, apart = signals.position.shape[0], self._on_motor(k, effect)
        if k >= count:
            return self._of_drive(signals, k - count, apart=apart)
        position, velocity = signals.motor_position, signals.motor_velocity
        if apart and position is not None and velocity is not None:
            signals = replace(signals, position=position, velocity=velocity)
        return self._view(signals, k, ca.SX(0.0))

    def _of_drive(self, signals: Signals, k: int, *, apart: bool = False) -> JointSignals:
        """Signals of effects at a motor of a transmission."""
        coupling = self.coupling
        motion = [coupling.drives(part) for part in (signals.position, signals.velocity)]
        if apart and signals.motor_position is not None and signals.motor_velocity is not None:
            motion = [signals.motor_position, signals.motor_velocity]
        return JointSignals(
            time=signals.time,
            position=motion[0][k],
            velocity=motion[1][k],
            acceleration=coupling.drives(signals.acceleration)[k],
            torque=coupling.on_drives(signals.torque)[k],
            friction=ca.SX(0.0),
            radial_force=ca.SX(0.0),
            axial_force=ca.SX(0.0),
            bending_moment=ca.SX(0.0),
            radial_sum=ca.SX(0.0),
            temperature=ca.SX(AMBIENT_TEMPERATURE),
            gear_ratio=self._robot.drives[k].gear_ratio,
            transition=TRANSITION,
        )

    def initial(self, signals: Signals) -> ca.SX:
        """The states at the first instant."""
        states = ca.SX(self.states, 1)
        states[self._warm] = self.temperatures.initial
        states[self._struck] = self.bearings.initial
        signals = self._tempered(signals, states)
        for k, used, effect, rows in self._places:
            if effect.states:
                count = signals.position.shape[0]
                at_joint = k < count
                view = self._view(signals, k, ca.SX(0.0)) if at_joint else self._of_drive(signals, k - count)
                states[rows] = effect.initial_state(view, used.parameters)
        return ca.densify(states)

    def warmth(self, time: ca.SX, states: ca.SX) -> ca.SX:
        """Temperatures of the joints [K], n x 1."""
        return self.temperatures.at(time, states[self._warm])

    @property
    def dry_motors(self) -> tuple[str, ...]:
        """Motors of transmissions whose friction jumps at a reversal."""
        drives = self._robot.drives
        names = [
            drives[k].name for k in self._coupled if (motor := drives[k].actuator) and motor.coulomb_friction
        ]
        signals, column = JointSignals.symbols(directed=True)
        for k, used, effect, _ in self._places:
            force = effect.torque(signals, used.parameters, ca.SX.sym("z", effect.states))
            if k >= len(drives) and ca.depends_on(force, column[-1]):
                names.append(used.at)
        return tuple(dict.fromkeys(names))

    def contact_forces(self, position: ca.SX, velocity: ca.SX, states: ca.SX) -> ca.SX:
        """Normal forces in the bearings with clearance [N]."""
        return self.bearings.normal_forces(position, velocity, states[self._struck])

    def _tempered(self, signals: Signals, states: ca.SX) -> Signals:
        return replace(signals, temperature=self.warmth(signals.time, states))

    def needs_solving(self) -> bool:
        """Whether a force depends on accelerations or bearing loads, which it changes."""
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
    """The inertial parameters with the body effects added, shape (P,).

    Masses at a point of a flexible link are not included; see `bodies_with`. Nor are the rotors of `geared`
    drives, whose motors have their own coordinate.
    """
    names = inertial_names(robot)
    numbers = nominal.copy()
    for k in geared:
        numbers[names.index(f"{robot.drives[k].name}.reflected_inertia")] = 0.0
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
    """The flexible links' constants changed by effects at them, by name."""
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
    """Whether the added mass of the effect moves with the deformation of a link."""
    return terms.place is not None and any(link.name == used.at for link in robot.flexible_links)


def sensor_effects(effects: Sequence[UsedEffect]) -> tuple[tuple[SensorEffect, UsedEffect], ...]:
    """The sensor effects, in the order of the robot file."""
    return tuple((used.effect, used) for used in effects if isinstance(used.effect, SensorEffect))


def _ten(terms: BodyTerms) -> NDArray[np.float64]:
    inertia = ca.SX(terms.inertia)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return _constants(ca.vertcat(terms.mass, terms.first_moment, *(inertia[pair] for pair in pairs)))


def _constants(expression: ca.SX) -> NDArray[np.float64]:
    return ca.evalf(ca.densify(ca.SX(expression))).full().ravel()

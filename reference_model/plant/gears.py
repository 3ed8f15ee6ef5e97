"""Gears with a separate motor coordinate: transmitted torque, stored energy and loss.

A joint with one of the effects `joint_elasticity`, `backlash` or `gear_hysteresis` has the motor's position
at the joint side of the gear as an additional coordinate, with the reflected inertia of the rotor, which then
no longer belongs to the joint. Effects of the actuator act on the motor and depend on its motion; all other
effects at the joint, including friction, act on the joint itself, where its bearings are. A motor of a
transmission has its gear between motor and transmission, and all effects at the motor act on the motor.

There is one spring in a gear. So one of the effects at a joint states stiffness and damping, and the others
use it: backlash is in series with the spring, hysteresis in parallel. Hysteresis in series with play would
need the flanks' position as one more coordinate, and is rejected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from reference_model.effects.base import GearEffect, GearSignals
from reference_model.effects.catalogue import UsedEffect
from reference_model.kinematics.coupling import Coupling
from robot_model import Drive, InputError, NoController, Robot, Transmission
from robot_model.description.mobility import idle_coordinate

__all__ = ["Gears", "Transmitted", "reads_motor"]

Array = NDArray[np.float64]

#: A gear with play starts on a flank under a torque that winds it by this fraction of the play, or of this
#: value [N m or N] if that is less: far above errors due to accelerations of a motion's table, far below
#: torques that cause motion. Without torque it starts in the middle.
WOUND, PRELOAD = 1e-3, 1e-2
#: A spring alone twists by torque over stiffness, where rounding may take away from its torque.
BEYOND = 1.0 + 1e-9


@dataclass(frozen=True)
class Transmitted:
    """Output of the gears, one row for each joint with a separate motor coordinate.

    Attributes:
        torque: on the joint, and against the motor [N m or N], m x 1.
        rates: of the gears' states.
        stored: energy of all gears [J].
        loss: power dissipated in all gears [W].
    """

    torque: ca.SX
    rates: ca.SX
    stored: ca.SX
    loss: ca.SX


@dataclass(frozen=True)
class _Gear:
    """The effects in one gear, with the indices of their states."""

    parts: tuple[tuple[GearEffect, Mapping[str, float], slice], ...]

    def transmit(self, twist: ca.SX, rate: ca.SX, states: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Torque, energy and loss."""
        seen = self._behind(twist, rate)
        torque, stored, loss = ca.SX(0.0), ca.SX(0.0), ca.SX(0.0)
        for effect, p, rows in self.parts:
            torque += effect.elastic(seen, p, states[rows]) + effect.viscous(seen, p)
            stored += effect.stored(seen, p, states[rows])
            loss += effect.loss(seen, p, states[rows])
        if not self.plays:
            return torque, stored, loss
        side = ca.sign(seen.twist)
        pushing = side * ca.fmax(side * torque, 0)  # flanks never pull
        return pushing, stored, loss + (pushing - torque) * rate

    def rates(self, twist: ca.SX, rate: ca.SX, states: ca.SX) -> list[tuple[slice, ca.SX]]:
        seen = self._behind(twist, rate)
        return [(rows, effect.state_rate(seen, p, states[rows])) for effect, p, rows in self.parts]

    @property
    def plays(self) -> bool:
        """Whether its flanks can be apart."""
        return any(type(effect).behind is not GearEffect.behind for effect, _, _ in self.parts)

    def at_rest(self, torque: float) -> tuple[float, list[tuple[slice, Array]]]:
        """Twist [rad or m] and states of the gear loaded monotonically to a torque [N m or N]."""
        size = abs(torque)
        stiffness = sum(p["stiffness"] for _, p, _ in self.parts)
        at = ca.SX.sym("d")
        seen, count = GearSignals(at, ca.SX(0.0)), sum(effect.states for effect, _, _ in self.parts)
        fresh = ca.vertcat(*(effect.first_loading(seen, p) for effect, p, _ in self.parts))
        places = np.cumsum([0, *(effect.states for effect, _, _ in self.parts)])
        held = sum(
            (e.elastic(seen, p, fresh[a:b]) for (e, p, _), a, b in zip(self.parts, places, places[1:])),
            start=ca.SX(0.0),
        )
        law = ca.Function("law", [at], [held, fresh])
        most = BEYOND * size / stiffness
        depth = brentq(lambda d: float(law(d)[0]) - size, 0.0, most) if size > 0 else 0.0
        depth = float(np.copysign(depth, torque))
        found = np.asarray(law(depth)[1]).ravel() if count else np.zeros(0)
        states = [(rows, found[a:b]) for (_, _, rows), a, b in zip(self.parts, places, places[1:])]
        play = sum(p.get("half_width", 0.0) for _, p, _ in self.parts)
        preload = min(WOUND * stiffness * play, PRELOAD)
        return depth + (play * float(np.tanh(torque / preload)) if preload > 0 else 0.0), states

    def _behind(self, twist: ca.SX, rate: ca.SX) -> GearSignals:
        seen = GearSignals(twist, rate)
        for effect, p, _ in self.parts:
            seen = effect.behind(seen, p)
        return seen


class Gears:
    """The gears of a robot with separate motor coordinates.

    Args:
        robot: the description.
        effects: checked effects; those of other kinds are ignored.

    Attributes:
        drives: indices of their motors among the robot's drives, increasing; m of them.
        coupling: the robot's transmissions.
        inertia: of each rotor at the joint side, gear_ratio^2 rotor_inertia [kg m^2 or kg], shape (m,).
        states: number of internal states.

    Raises:
        InputError: no rotor that could move, effects that do not go together, or a link that moves no inertia
            without the rotor.
    """

    def __init__(self, robot: Robot, effects: Sequence[UsedEffect]) -> None:
        names = [drive.name for drive in robot.drives]
        self.coupling = Coupling(robot)
        own: dict[int, list[UsedEffect]] = {}
        for used in effects:
            if isinstance(used.effect, GearEffect):
                own.setdefault(names.index(used.at), []).append(used)
        self.drives = tuple(sorted(own))
        self._gears: list[_Gear] = []
        self.states = 0
        for place in self.drives:
            _check_together(robot, robot.drives[place], own[place])
            self._gears.append(self._gear(own[place]))
        self.inertia = np.array([robot.drives[k].reflected_inertia for k in self.drives])
        _check_movable(robot, self.drives)

    def _gear(self, used: Sequence[UsedEffect]) -> _Gear:
        parts = []
        for one in used:
            assert isinstance(one.effect, GearEffect)
            rows = slice(self.states, self.states + one.effect.states)
            parts.append((one.effect, one.parameters, rows))
            self.states = rows.stop
        return _Gear(tuple(parts))

    def act(self, twist: ca.SX, rate: ca.SX, states: ca.SX) -> Transmitted:
        """Output of the gears at twists and their rates, m x 1 each."""
        torques, stored, loss = [ca.SX(0, 1)], ca.SX(1, 1), ca.SX(1, 1)
        rates = ca.SX(self.states, 1)
        for k, gear in enumerate(self._gears):
            torque, energy, power = gear.transmit(twist[k], rate[k], states)
            torques.append(torque)
            stored, loss = stored + energy, loss + power
            for rows, change in gear.rates(twist[k], rate[k], states):
                if rows.stop > rows.start:
                    rates[rows] = change
        return Transmitted(ca.vertcat(*torques), ca.densify(rates), stored, loss)

    def at_rest(self, torque: Array) -> tuple[Array, Array]:
        """Twists, shape (m,), and states of gears at rest under the torques of all drives, shape (n,)."""
        twists, states = np.zeros(len(self.drives)), np.zeros(self.states)
        for k, (place, gear) in enumerate(zip(self.drives, self._gears)):
            twists[k], found = gear.at_rest(float(torque[place]))
            for rows, values in found:
                states[rows] = values
        return twists, states

    def rows(self, column: ca.SX) -> ca.SX:
        """The rows of these motors in a column of all drives, m x 1."""
        return ca.vertcat(ca.SX(0, 1), *(column[place] for place in self.drives))

    def shafts(self, joints: ca.SX) -> ca.SX:
        """Motion behind the gears from that of all joints, m x 1."""
        return self.rows(self.coupling.drives(joints))

    def replaced(self, drives: ca.SX, motors: ca.SX) -> ca.SX:
        """A column of all drives, n x 1, with the rows of these motors filled in."""
        column = ca.SX(drives)
        for k, place in enumerate(self.drives):
            column[place] = motors[k]
        return column

    def motion(self, joints: ca.SX, motors: ca.SX) -> ca.SX:
        """Motion of all motors, n x 1, from that of all joints and of the separate motor coordinates."""
        return self.replaced(self.coupling.drives(joints), motors)

    def seen(self, joints: ca.SX, motors: ca.SX) -> ca.SX:
        """Motion of the joints as measured by encoders at the motors, n x 1."""
        return self.coupling.joints(self.motion(joints, motors)) if self.drives else joints


def reads_motor(robot: Robot) -> bool:
    """Whether the controller reads the encoders at the motors."""
    return not isinstance(robot.controller, NoController) and robot.controller.feedback == "motor"


def _check_together(robot: Robot, drive: Drive, used: Sequence[UsedEffect]) -> None:
    """Raise `InputError` for effects that cannot be in one gear."""
    where = f"robot '{robot.name}', {'joint' if drive.joint else 'motor'} '{drive.name}'"
    ids = [one.effect.id for one in used]
    if drive.reflected_inertia <= 0:
        whose = "give the joint's actuator a rotor_inertia" if drive.joint else "give it a rotor_inertia"
        raise InputError(f"{where}: {ids[0]} lets the motor move by itself; {whose}.")
    for effect_id in ids:
        if ids.count(effect_id) > 1:
            raise InputError(f"{where}: {effect_id} is listed twice; a gear has one.")
    if {"backlash", "gear_hysteresis"} <= set(ids):
        raise InputError(
            f"{where}: backlash and gear_hysteresis in one gear are not simulated, because hysteresis behind "
            "a play needs the position of the flanks; keep one of them."
        )
    stated = [one.effect.id for one in used if one.parameters["stiffness"] > 0]
    if not stated:
        raise InputError(
            f"{where}: {' and '.join(ids)} without any stiffness; give it one, or add joint_elasticity."
        )
    for one in used:
        own = one.parameters["stiffness"] or one.parameters["damping"]
        if "joint_elasticity" in ids and one.effect.id != "joint_elasticity" and own:
            raise InputError(
                f"{where}: there is one spring in a gear, and joint_elasticity states it; remove stiffness "
                f"and damping from {one.effect.id}."
            )


def _check_movable(robot: Robot, drives: Sequence[int]) -> None:
    """Raise `InputError` where a link has no inertia once the rotor has its own coordinate."""
    names = [robot.drives[k].name for k in drives]
    bare = tuple(j.model_copy(update={"actuator": None}) if j.name in names else j for j in robot.joints)
    light = tuple(_without_rotors(transmission, names) for transmission in robot.transmissions)
    change = {"joints": bare, "transmissions": light}
    idle = idle_coordinate(robot.model_copy(update=change)) if names else None
    if idle is not None:
        raise InputError(
            f"robot '{robot.name}', joint '{idle}': with the motor on a spring nothing but the rotor had an "
            "inertia there; give its link a mass and inertia."
        )


def _without_rotors(transmission: Transmission, names: Sequence[str]) -> Transmission:
    motors = (
        motor.model_copy(update={"rotor_inertia": 0.0}) if motor.name in names else motor
        for motor in transmission.motors
    )
    return transmission.model_copy(update={"motors": tuple(motors)})

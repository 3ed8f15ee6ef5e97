"""Passive coordinates of a robot with its effects, for a prescribed motion of the joints.

Base (where it moves), modal coordinates and the states of force effects on bodies follow from the joints'
motion alone; torque, friction, control and all other effects at joints only change the required actuator
torque. Effects without regressors along a recorded motion are compared with data in this way: the same joint
motion, the robot with the effect at trial values, and the resulting readings of gyro, strain gauges, tip and
torque sensors.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag, eigh

from reference_model.codegen.batched import BLOCK, Batched
from reference_model.codegen.kept import kept
from reference_model.dynamics.balance import momentum
from reference_model.dynamics.equations import solve_spd
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.flexible import FlexibleBody
from reference_model.kinematics.quintic import between
from reference_model.kinematics.spatial import quaternion_from_rpy, quaternion_rate, rotation_from_quaternion
from reference_model.passive.marching import FASTER, Marching
from reference_model.plant.truth import truth_of
from robot_model import InputError, Recording, Robot

__all__ = ["prescribed"]

Array = NDArray[np.float64]


def prescribed(
    robot: Robot, time: ArrayLike, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike
) -> Recording:
    """Motion of the robot with its effects for a prescribed joint motion, after a start from rest.

    Included are effects that change bodies, gravity or structure, and force effects on bodies.
    Between samples the joints follow a quintic; the passive coordinates are integrated by the
    classical Runge-Kutta method of order four with steps that follow the fastest mode.

    Args:
        robot: the description, without spherical joints.
        time: [s], shape (N,), rising.
        position, velocity, acceleration: of the moving joints, shape (N, n) [rad or m, per s and s^2].

    Returns:
        True channels, named as those of `simulation.simulate`: per joint `position`, `velocity`,
        `acceleration` and `torque`, the required sum of actuator and joint effects; for a moving base
        `base.*`; for flexible links `tip_deflection`, `tip_acceleration`, `strain.N`,
        `modal_coordinate.N`; `robot.energy` and momenta.

    Raises:
        InputError: lengths differ, the robot has spherical joints, or it cannot have one of its effects.
    """
    instants = np.asarray(time, dtype=float)
    joints = [np.atleast_2d(np.asarray(a, dtype=float)) for a in (position, velocity, acceleration)]
    count = len(robot.moving_joints)
    for what, array in zip(("position", "velocity", "acceleration"), joints):
        if array.shape != (len(instants), count):
            raise InputError(
                f"{what} has shape {array.shape}, but {len(instants)} instants of robot '{robot.name}' need "
                f"({len(instants)}, {count})."
            )
    if robot.spherical_joints:
        raise InputError(
            f"robot '{robot.name}': the motion of spherical joint '{robot.spherical_joints[0].name}' does "
            "not follow from that of the other joints."
        )
    return _passive(robot).recording(instants, np.hstack(joints))


@kept
def _passive(robot: Robot) -> _Passive:
    return _Passive(robot)


class _Passive:
    """State [base position, attitude, twist (where the base moves); x; xd; z] under moving joints."""

    def __init__(self, robot: Robot) -> None:
        self.truth = truth_of(robot)
        tree = self.tree = self.truth.tree
        self.free, self.modes, self.count = tree.free_base, tree.modal, len(tree.joints)
        sizes = [3, 4, 6] if self.free else [0, 0, 0]
        sizes += [self.modes, self.modes, self.truth.forces.states]
        self.edges = np.cumsum([0, *sizes]).tolist()
        self._time, self._state = ca.SX.sym("t"), ca.SX.sym("y", self.edges[-1])
        self._joint = [ca.SX.sym(name, self.count) for name in ("q", "qd", "qdd")]
        inputs = [self._time, self._state, ca.vertcat(*self._joint)]
        rate, watched = self._equations()
        self._rate = ca.Function("rate", inputs, [ca.densify(rate)], {"cse": True})
        self._blocks = Marching(self._rate, self._interval, BLOCK)
        self._watch = Batched(ca.Function("watch", inputs, watched, {"cse": True}))

    def _motion(self, parts: list[ca.SX], base: ca.SX, inner: ca.SX) -> Motion:
        """The motion in a state, at accelerations of base and modes."""
        fixed: dict[str, Any] = SymbolicRobot.still_base(self.truth.robot)
        if self.free:
            fixed = {"base_position": parts[0], "attitude": parts[1], "base_velocity": parts[2]}
            fixed["base_acceleration"] = base
        fixed |= {"modal": parts[3], "modal_rates": parts[4], "inner_acceleration": inner}
        q, qd, qdd = self._joint
        return Motion(q, qd, qdd, **fixed)

    def _equations(self) -> tuple[ca.SX, list[ca.SX]]:
        """Rate of the state, and the columns of `_names`."""
        parts = ca.vertsplit(self._state, self.edges)
        still = self._motion(parts, ca.SX(6, 1), ca.SX(self.modes, 1))
        model = self.truth.symbolic(still, self._time, parts[5])
        rows = [*range(6 * self.free), *range(self.tree.rows - self.modes, self.tree.rows)]
        found = ca.SX(0, 1)
        if rows:
            found = solve_spd(model.mass_matrix[rows, rows], -model.inverse_dynamics[rows])
        base, inner = found[: 6 * self.free], found[6 * self.free :]
        outside = model.mechanism.outside
        rates = [parts[4], inner, outside.rates]
        if self.free:
            linear, omega = parts[2][:3], parts[2][3:]
            apparent = ca.vertcat(ca.cross(omega, linear), ca.SX(3, 1))
            turning = quaternion_rate(parts[1], omega)
            moving = rotation_from_quaternion(parts[1]) @ linear
            rates = [moving, turning, base - apparent, *rates]
        moved = self.truth.symbolic(self._motion(parts, base, inner), self._time, parts[5])
        torque = moved.inverse_dynamics[6 * self.free : 6 * self.free + self.count]
        linear = base[:3] if self.free else base
        columns = [torque, linear, self._tips(moved), moved.energy, *momentum(moved.mechanism)]
        return ca.vertcat(*rates), [ca.vec(ca.densify(column)) for column in columns]

    def _tips(self, robot: SymbolicRobot) -> ca.SX:
        """Deflection and acceleration of the tip of each flexible link, 6 x (number of them)."""
        columns = [ca.SX(6, 0)]
        for index, body in enumerate(self.tree.bodies):
            if body.flexible is not None:
                place, _, _, moved = robot.node(index, body.flexible.tip)
                columns.append(ca.vertcat(place - ca.SX(body.flexible.nodes[body.flexible.tip]), moved[:3]))
        return ca.horzcat(*columns)

    def recording(self, time: Array, joints: Array) -> Recording:
        """All channels."""
        states = self._march(time, joints)
        torque, linear, tips, energy, *momenta = self._watch(time[:, None], states, joints)
        parts = np.split(states, self.edges[1:-1], axis=1)
        found: dict[str, Array] = {}
        for k, name in enumerate(self.tree.joints):
            columns = {"position": k, "velocity": self.count + k, "acceleration": 2 * self.count + k}
            found |= {f"{name}.{what}": joints[:, column] for what, column in columns.items()}
            found[f"{name}.torque"] = torque[:, k]
        if self.free:
            found |= _axes("base.position", parts[0]) | _axes("base.attitude", parts[1], "wxyz")
            found |= _axes("base.linear_velocity", parts[2][:, :3])
            found |= _axes("base.angular_velocity", parts[2][:, 3:])
            found |= _axes("base.linear_acceleration", linear)
        found |= self._link_channels(parts[3], tips)
        found["robot.energy"] = energy[:, 0]
        for what, columns_of in zip(("linear", "angular"), momenta):
            found |= _axes(f"robot.{what}_momentum", columns_of)
        return Recording(time, found, f"prescribed joint motion, robot '{self.truth.nominal.name}'")

    def _link_channels(self, modal: Array, tips: Array) -> dict[str, Array]:
        found: dict[str, Array] = {}
        bodies = [body for body in self.tree.bodies if body.flexible is not None]
        for k, body in enumerate(bodies):
            assert body.flexible is not None
            x = modal[:, body.modal : body.modal + body.modes]
            strain = x @ body.flexible.strain.T
            found |= _axes(f"{body.name}.tip_deflection", tips[:, 6 * k : 6 * k + 3])
            found |= _axes(f"{body.name}.tip_acceleration", tips[:, 6 * k + 3 : 6 * k + 6])
            found |= {f"{body.name}.strain.{g + 1}": strain[:, g] for g in range(strain.shape[1])}
            found |= {f"{body.name}.modal_coordinate.{a + 1}": x[:, a] for a in range(body.modes)}
        return found

    def _start(self, joints: Array) -> Array:
        """Undeformed; a base described as floating has the twist at which its bodies have no momentum."""
        state = np.zeros(self.edges[-1])
        robot = self.truth.robot
        if self.free:
            state[:3], state[3:7] = robot.base.position, quaternion_from_rpy(robot.base.rpy)
        state[self.edges[5] :] = self.truth.forces.initial
        if self.truth.nominal.base.kind == "free":
            coupled, speeds = self._mass(joints), joints[self.count : 2 * self.count]
            columns = coupled[:6, 6 : 6 + self.count]
            state[7:13] = -np.linalg.solve(coupled[:6, :6], columns @ speeds)
        return state

    def _march(self, time: Array, joints: Array) -> Array:
        """States at all instants, shape (N, rows)."""
        found = [self._start(joints[0])[None]]
        steps = len(time) - 1
        if steps < 1 or not self.edges[-1]:
            return np.repeat(found[0], len(time), axis=0)
        fastest = self._fastest(joints[0])
        march = self._blocks.over(float(np.diff(time).max()) * fastest, steps)
        padding = -steps % BLOCK
        ends = np.pad(np.hstack([joints[:-1], joints[1:]]), ((0, padding), (0, 0)), mode="edge")
        spans = np.column_stack([time[:-1], np.diff(time)])
        spans = np.pad(spans, ((0, padding), (0, 0)))
        spans[steps:, 0] = time[-1]  # a step of zero length changes nothing
        for first in range(0, steps, BLOCK):
            rows = slice(first, first + BLOCK)
            found.append(march(found[-1][-1], spans[rows].T, ends[rows].T).full().T)
        return np.vstack(found)[: len(time)]

    def _interval(self, rate: ca.Function, parts: int) -> ca.Function:
        """State, [start; length], both ends' joint motion -> state one interval later."""
        state, span = ca.MX.sym("y", self.edges[-1]), ca.MX.sym("t", 2)
        ends = ca.MX.sym("e", 6 * self.count)
        joint = between(ends, span[1], self.count)
        h, now = span[1] / parts, state
        for k in range(parts):
            instants = [span[0] + (k + part) * h for part in (0.0, 0.5, 1.0)]
            seen = [ca.vertcat(*joint((k + part) / parts)) for part in (0.0, 0.5, 1.0)]
            k1 = rate(instants[0], now, seen[0])
            k2 = rate(instants[1], now + h / 2 * k1, seen[1])
            k3 = rate(instants[1], now + h / 2 * k2, seen[1])
            k4 = rate(instants[2], now + h * k3, seen[2])
            now = now + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if self.free:
            now = ca.vertcat(now[:3], now[3:7] / ca.norm_2(now[3:7]), now[7:])
        return ca.Function("interval", [state, span, ends], [now])

    def _fastest(self, start: Array) -> float:
        """Upper bound of the natural frequencies [rad/s], from a first sample of the joints."""
        robot = self.truth.robot
        masses = {index: robot.link(body.name).mass for index, body in enumerate(self.tree.bodies) if index}
        masses[0] = robot.base.mass
        forced = self.truth.forces.fastest(masses)
        if not self.modes:
            return forced
        rows = [*range(6 * self.free), *range(self.tree.rows - self.modes, self.tree.rows)]
        matrix = self._mass(start)[np.ix_(rows, rows)]
        stiffness = block_diag(
            np.zeros((6 * self.free, 6 * self.free)),
            *(body.stiffness for body in self._bending()),
        )
        square = float(eigh(stiffness, matrix, eigvals_only=True)[-1])
        return max(FASTER * square**0.5, forced)

    def _bending(self) -> list[FlexibleBody]:
        """Constants of the deformable bodies, in the order of the modal coordinates."""
        found = {body.modal: body.flexible for body in self.tree.bodies if body.flexible is not None}
        return [found[first] for first in sorted(found)]

    def _mass(self, joints: Array) -> Array:
        """Z of the undeformed robot at the described base pose, shape (rows, rows)."""
        state = np.zeros(self.edges[-1])
        robot = self.truth.robot
        if self.free:
            state[:3], state[3:7] = robot.base.position, quaternion_from_rpy(robot.base.rpy)
        parts = [ca.SX(part) for part in np.split(state, self.edges[1:-1])]
        motion = self._motion(parts, ca.SX(6, 1), ca.SX(self.modes, 1))
        matrix = self.truth.symbolic(motion, ca.SX(0.0), parts[5]).mass_matrix
        found: Array = ca.Function("mass", [self._joint[0]], [matrix])(joints[: self.count]).full()
        return found


def _axes(name: str, columns: Array, axes: str = "xyz") -> dict[str, Array]:
    return {f"{name}.{axis}": columns[:, k] for k, axis in enumerate(axes)}

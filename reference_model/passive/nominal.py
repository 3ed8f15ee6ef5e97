"""The motion of passive coordinates for a prescribed motion of the joints.

Base (where it is free) and modal coordinates follow from the joints alone: the base's twist from momentum
(see `free_base`), the modal coordinates from their own equations of motion, in which the joints' motion is a
known excitation. Forces at the joints, known or not, do not change them: torque, friction and control only
appear in the torque required by the motion.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from reference_model.codegen.batched import Batched
from reference_model.dynamics.balance import centre_of_mass
from reference_model.dynamics.equations import solve_spd
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.dynamics.tree import Tree
from reference_model.kinematics.quintic import between
from reference_model.kinematics.spatial import quaternion_rate, rotation_from_quaternion
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from reference_model.passive.marching import FASTER, Marching
from robot_model import InputError, Robot

__all__ = ["PassiveMotion"]

Array = NDArray[np.float64]

#: Samples per call of the accumulated step.
BLOCK = 256


class PassiveMotion:
    """State [attitude (free base); x; xd] of a robot whose joints move as prescribed.

    Args:
        robot: the description, without spherical joints.
        tree: of the robot, with the constants of its flexible links.
        numbers: number of inertial parameters.

    Raises:
        InputError: the robot has spherical joints, whose motion no joint recording contains.
    """

    def __init__(self, robot: Robot, tree: Tree, numbers: int) -> None:
        if robot.spherical_joints:
            raise InputError(
                f"robot '{robot.name}': the motion of spherical joint '{robot.spherical_joints[0].name}' "
                "does not follow from that of the other joints."
            )
        self.robot = robot
        self.free = robot.base.kind == "free"
        self.tree = tree
        self.modes, self.count = self.tree.modal, len(self.tree.joints)
        self._elapsed, self._state = ca.SX.sym("t"), ca.SX.sym("y", 4 * self.free + 2 * self.modes)
        self._joint = [ca.SX.sym(name, self.count) for name in ("q", "qd", "qdd")]
        self._constants = ca.SX.sym("c", 6 + numbers)
        inputs = [self._elapsed, self._state, *self._joint, self._constants]
        rate, twist, acceleration = self._equations()
        outputs = [ca.densify(value) for value in (twist, acceleration)]
        self._rate = ca.Function("rate", inputs, [ca.densify(rate)], {"cse": True})
        self._result = Batched(ca.Function("result", inputs, outputs, {"cse": True}))
        self._blocks = Marching(self._rate, self._interval, BLOCK)

    def along(
        self,
        time: Array,
        joints: tuple[Array, Array, Array],
        *,
        attitude: Array,
        momentum: tuple[Array, Array],
        inertial: Array,
    ) -> tuple[BaseMotion | None, InnerMotion]:
        """Motion of a free base and of flexible links that are undeformed and at rest at the first instant.

        Args:
            time: [s], shape (N,).
            joints: position, velocity, acceleration, shape (N, n) each.
            attitude: of the base at the first instant, shape (4,).
            momentum: linear [N s] and angular momentum about the centre of mass [N m s] at the first instant,
                inertial axes, shape (3,) each; of a free base.
            inertial: the inertial numbers, shape (P,).
        """
        constants = np.concatenate([*momentum, inertial])
        states = self._march(time, np.hstack(joints), attitude, constants)
        return self._motions(time, states, joints, constants)

    def _motion(self, twist: ca.SX) -> Motion:
        q, qd, qdd = self._joint
        base = SymbolicRobot.still_base(self.robot)
        if self.free:
            base |= {"attitude": self._state[:4], "base_velocity": twist}
        start = 4 * self.free
        base["modal"] = self._state[start : start + self.modes]
        base["modal_rates"] = self._state[start + self.modes :]
        base["inner_acceleration"] = ca.SX(self.modes, 1)
        return Motion(q, qd, qdd, **base)

    def _twist(self) -> ca.SX:
        """[linear; angular] velocity of the base in its axes from momentum, 6 x 1."""
        if not self.free:
            return ca.SX(6, 1)
        numbers = self._constants[6:]
        still = self._motion(ca.SX(6, 1))
        model = SymbolicRobot(self.robot, still, numbers, tree=self.tree)
        mass, centre = centre_of_mass(model.mechanism)
        turn = rotation_from_quaternion(still.attitude).T
        linear = turn @ (self._constants[:3] + mass * numbers[-3:] * self._elapsed)
        angular = turn @ self._constants[3:6] + ca.cross(turn @ centre, linear)
        matrix = model.mass_matrix
        moving = ca.vertcat(still.velocity, still.modal_rates)
        return solve_spd(matrix[:6, :6], ca.vertcat(linear, angular) - matrix[:6, 6:] @ moving)

    def _equations(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Rate of the state, twist of the base, accelerations of base and modes."""
        twist = self._twist()
        motion = self._motion(twist)
        model = SymbolicRobot(self.robot, motion, self._constants[6:], tree=self.tree)
        base = list(range(6 * self.free))
        modal = list(range(self.tree.rows - self.modes, self.tree.rows))
        rows = [*base, *modal]
        matrix = model.mass_matrix[rows, rows]
        acceleration = solve_spd(matrix, -model.inverse_dynamics[rows])
        turning = [quaternion_rate(motion.attitude, twist[3:])] if self.free else []
        self._mass = ca.Function("mass", [self._state, self._joint[0], self._constants], [matrix])
        return ca.vertcat(*turning, motion.modal_rates, acceleration[6 * self.free :]), twist, acceleration

    def _march(self, time: Array, joints: Array, attitude: Array, constants: Array) -> Array:
        """States at all instants, shape (N, rows), by the classical fourth-order Runge-Kutta method."""
        start = np.zeros(self._state.shape[0])
        if self.free:
            start[:4] = attitude / np.linalg.norm(attitude)
        steps = len(time) - 1
        if steps < 1:
            return start[None]
        fastest = self._fastest(start, joints[0], constants)
        march = self._blocks.over(float(np.diff(time).max()) * fastest, steps)
        blocks = -(-steps // BLOCK)
        padded = np.pad(joints, ((0, blocks * BLOCK - steps), (0, 0)), mode="edge")
        lengths = np.pad(np.diff(time), (0, blocks * BLOCK - steps))  # a step of zero length changes nothing
        elapsed = np.pad(time[:-1] - time[0], (0, blocks * BLOCK - steps), mode="edge")
        found, state = [start[None]], start
        for block in range(blocks):
            rows = slice(block * BLOCK, (block + 1) * BLOCK)
            ends = np.hstack([padded[:-1][rows], padded[1:][rows]])
            times = np.column_stack([elapsed[rows], lengths[rows]])
            moved = march(state, times.T, ends.T, np.tile(constants[:, None], BLOCK)).full().T
            found.append(moved)
            state = moved[-1]
        return np.vstack(found)[: len(time)]

    def _fastest(self, state: Array, joints: Array, constants: Array) -> float:
        """Upper bound of the natural frequencies [rad/s], from those at a first pose."""
        matrix = self._mass(state, joints[: self.count], constants).full()
        count, base = len(self.tree.beam_names), 6 * self.free
        beams = constants[constants.size - 3 - count : constants.size - 3]
        stiffness = np.zeros_like(matrix)
        stiffness[base:, base:] = self.tree.elasticity(beams)[0]
        return FASTER * float(np.sqrt(max(eigh(stiffness, matrix, eigvals_only=True)[-1], 0.0)))

    def _interval(self, rate: ca.Function, parts: int) -> ca.Function:
        """State, [elapsed; length], both ends' joint motion, constants -> state one interval later."""
        state, times = ca.MX.sym("y", self._state.shape[0]), ca.MX.sym("t", 2)
        ends, constants = ca.MX.sym("e", 6 * self.count), ca.MX.sym("c", self._constants.shape[0])
        joint = between(ends, times[1], self.count)
        h, now = times[1] / parts, state
        for k in range(parts):
            instants = [times[0] + (k + part) * h for part in (0.0, 0.5, 1.0)]
            seen = [joint((k + part) / parts) for part in (0.0, 0.5, 1.0)]
            k1 = rate(instants[0], now, *seen[0], constants)
            k2 = rate(instants[1], now + h / 2 * k1, *seen[1], constants)
            k3 = rate(instants[1], now + h / 2 * k2, *seen[1], constants)
            k4 = rate(instants[2], now + h * k3, *seen[2], constants)
            now = now + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if self.free:
            now = ca.vertcat(now[:4] / ca.norm_2(now[:4]), now[4:])
        return ca.Function("interval", [state, times, ends, constants], [now])

    def _motions(
        self, time: Array, states: Array, joints: tuple[Array, Array, Array], constants: Array
    ) -> tuple[BaseMotion | None, InnerMotion]:
        """Base and inner motion from the states."""
        elapsed = (time - time[:1])[:, None]
        twist, acceleration = self._result(elapsed, states, *joints, constants)
        start, empty = 4 * self.free, np.zeros((len(time), 0))
        inner = InnerMotion(
            empty,
            empty,
            empty,
            states[:, start : start + self.modes],
            states[:, start + self.modes :],
            acceleration[:, 6 * self.free :],
        )
        if not self.free:
            return None, inner
        return BaseMotion.from_stacked(np.hstack([states[:, :4], twist, acceleration[:, :6]])), inner

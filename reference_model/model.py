"""`RobotModel`: the dynamics of a robot evaluated over whole recordings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_model.balance import LOADS, momentum
from reference_model.base_motion import BASE_NUMBERS, BaseMotion
from reference_model.batched import Batched
from reference_model.free_base import reconstruct
from reference_model.inertial import inertial_names, nominal_inertial
from reference_model.inner_motion import InnerMotion, inner_numbers
from reference_model.passive import reconstruct_passive
from reference_model.spatial import quaternion_from_rpy
from reference_model.symbolic import Motion, SymbolicRobot
from reference_model.tree import tree_of
from robot_model import InputError, Robot

__all__ = ["RobotModel"]

Array = NDArray[np.float64]


class RobotModel:
    """Dynamics of a robot; pure functions of arrays, compiled on first use.

    Every method takes ``position, velocity, acceleration`` of the moving joints in file order, shape (N, n)
    [rad or m, and per s and s^2], or (n,) for one sample. Results have `rows` in the order of `tree.Tree`: of
    a free base first six, ``[force; moment]`` (or ``[linear; angular]``) at the base frame's origin in base
    axes; then the joints; then the inner coordinates, three of each spherical joint and the modal ones.

    `inner` is the motion of spherical joints and flexible links; robots that have any rest undeformed where
    it is left out.

    `base` is needed for a free base. For a fixed base it may be given too: then the base is carried along
    that motion, and the result still has n rows. `inertial` replaces the nominal numbers.

    Attributes:
        robot: the description.
        joints: names of the moving joints.
        free_base: the base has six coordinates.
        inertial_names: names of the P numbers (see `reference_model.inertial`).
        inertial: their nominal values, shape (P,).
        tree: bodies, coordinates and their order.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.joints = tuple(joint.name for joint in robot.moving_joints)
        self.free_base = robot.base.kind == "free"
        self.inertial_names = inertial_names(robot)
        self.inertial = nominal_inertial(robot)
        self.tree = tree_of(robot)
        self.rows = self.tree.rows
        self._functions: dict[tuple[str, bool], Batched] = {}

    def inverse_dynamics(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Generalised force that the motion needs [N m or N; base: N, N m], shape (N, rows)."""
        return self._run("inverse", _inverse, (position, velocity, acceleration), base, inner, inertial)[0]

    def regressor(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Exact derivative of `inverse_dynamics` by the inertial numbers, shape (N, rows, P).

        The gravity columns hold at the masses of `inertial`, the others at its gravity; so the product with
        `inertial`, the gravity columns left out, is the inverse dynamics itself.
        """
        flat = self._run("regressor", _regressor, (position, velocity, acceleration), base, inner, inertial)[
            0
        ]
        return flat.reshape(len(flat), self.rows, -1)

    def motion_jacobians(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:
        """Derivatives of `inverse_dynamics` by joint position, velocity, acceleration: (N, rows, n) each."""
        found = self._run("jacobians", _jacobians, (position, velocity, acceleration), base, inner, inertial)
        first, second, third = (flat.reshape(len(flat), self.rows, -1) for flat in found)
        return first, second, third

    def joint_wrenches(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Force [N] and moment [N m] by the inboard on the outboard body at moving joints, (N, n, 3) each.

        About the origin of the child's frame and in the child's axes. The moment along the axis is the
        joint torque less the rotor's share.
        """
        flat = self._run("wrenches", _wrenches, (position, velocity, acceleration), base, inner, inertial)[0]
        both = flat.reshape(len(flat), len(self.joints), 6)
        return both[:, :, :3], both[:, :, 3:]

    def bearing_loads(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Bearing loads of each moving joint, shape (N, n, 4), in the order of `balance.LOADS`.

        Radial force [N], axial force [N], bending moment [N m], and what the radial arm multiplies [N].
        """
        flat = self._run("loads", _loads, (position, velocity, acceleration), base, inner, inertial)[0]
        return flat.reshape(len(flat), len(self.joints), len(LOADS))

    def forward_dynamics(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        torque: ArrayLike,
        *,
        base: BaseMotion | None = None,
        base_wrench: ArrayLike | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Accelerations under joint torques [N m or N], shape (N, rows).

        The accelerations of `inner` are taken for forces on the inner coordinates: zero in free motion.

        Args:
            position, velocity, torque: shape (N, n).
            base: attitude and rates of a free base; its accelerations are not used.
            base_wrench: external force [N] and moment [N m] on a free base at its origin, base axes, (N, 6).
            inertial: replaces the nominal numbers.
        """
        wrench = np.zeros(6) if base_wrench is None else np.asarray(base_wrench, dtype=float)
        return self._run("forward", _forward, (position, velocity, torque), base, inner, inertial, wrench)[0]

    def mass_matrix(
        self,
        position: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Z of ``Z ydd = z + f``, symmetric, shape (N, rows, rows)."""
        still = np.zeros_like(np.asarray(position, dtype=float))
        flat = self._run("mass", _mass_matrix, (position, still, still), base, inner, inertial)[0]
        return flat.reshape(len(flat), self.rows, self.rows)

    def momentum(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Linear [N s] and angular momentum about the centre of mass [N m s], inertial axes, (N, 3) each."""
        still = np.zeros_like(np.asarray(position, dtype=float))
        found = self._run("momentum", _momentum, (position, velocity, still), base, inner, inertial)
        return found[0], found[1]

    def energy(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        *,
        base: BaseMotion | None = None,
        base_position: ArrayLike | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Kinetic plus gravitational potential energy [J], shape (N,); potential is zero at the origin.

        `base_position` [m], shape (N, 3) or (3,), is the description's when left out.
        """
        still = np.zeros_like(np.asarray(position, dtype=float))
        where = self.robot.base.position if base_position is None else base_position
        place = np.asarray(where, dtype=float)
        return self._run("energy", _energy, (position, velocity, still), base, inner, inertial, place)[0][
            :, 0
        ]

    def reconstruct_base(
        self,
        time: ArrayLike,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        initial: BaseMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> BaseMotion:
        """The motion of a free base without external wrench, from the joint motion and momentum.

        Args:
            time: [s], shape (N,).
            position, velocity, acceleration: of the joints, shape (N, n).
            initial: its first sample gives attitude and twist at the first instant; left out, the attitude
                is the description's and the momentum is zero, as after a start from rest.
            inertial: replaces the nominal numbers.

        Raises:
            InputError: the base is fixed, or lengths differ.
        """
        numbers = self.inertial if inertial is None else np.asarray(inertial, dtype=float)
        q, qd, qdd = (np.atleast_2d(np.asarray(a, dtype=float)) for a in (position, velocity, acceleration))
        start, momentum = initial, (np.zeros(3), np.zeros(3))
        if start is None:
            start = BaseMotion.at_rest(quaternion_from_rpy(self.robot.base.rpy))
        else:
            first = BaseMotion.from_stacked(start.stacked()[:1])
            linear, angular = self.momentum(q[:1], qd[:1], base=first, inertial=numbers)
            momentum = (linear[0], angular[0])
        instants = np.asarray(time, dtype=float)
        return reconstruct(
            self.robot, instants, (q, qd, qdd), initial=start, momentum=momentum, inertial=numbers
        )

    def reconstruct_passive(
        self, time: ArrayLike, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike
    ) -> tuple[BaseMotion | None, InnerMotion | None]:
        """Motion of a free base and of flexible links, from the joint motion, after a start from rest.

        Args:
            time: [s], shape (N,).
            position, velocity, acceleration: of the joints, shape (N, n).

        Returns:
            The base's motion, None when it is fixed; the inner motion, None for a robot without any.

        Raises:
            InputError: lengths differ, or the robot has spherical joints.
        """
        if not self.tree.inner:
            motion = (position, velocity, acceleration)
            return (self.reconstruct_base(time, *motion) if self.free_base else None), None
        joints = [np.atleast_2d(np.asarray(a, dtype=float)) for a in (position, velocity, acceleration)]
        return reconstruct_passive(
            self.robot,
            np.asarray(time, dtype=float),
            (joints[0], joints[1], joints[2]),
            attitude=quaternion_from_rpy(self.robot.base.rpy),
            momentum=(np.zeros(3), np.zeros(3)),
            inertial=self.inertial,
        )

    def _run(
        self,
        name: str,
        build: Callable[[SymbolicRobot, ca.SX], list[ca.SX]],
        motion: tuple[ArrayLike, ArrayLike, ArrayLike],
        base: BaseMotion | None,
        inner: InnerMotion | None,
        inertial: ArrayLike | None,
        extra: Array | None = None,
    ) -> tuple[Array, ...]:
        if self.free_base and base is None:
            raise InputError(
                f"robot '{self.robot.name}' has a free base: give its motion (`base`); "
                "`reconstruct_base` makes it from the joint motion."
            )
        extras = 0 if extra is None else extra.shape[-1]
        key = (name, base is not None)
        if key not in self._functions:
            self._functions[key] = Batched(self._function(name, build, base is not None, extras))
        joints = [np.atleast_2d(np.asarray(column, dtype=float)) for column in motion]
        numbers = self.inertial if inertial is None else np.asarray(inertial, dtype=float)
        if inner is None:
            inner = InnerMotion.at_rest(self.robot)
        inner.check(self.robot)
        inputs = [
            *joints,
            numbers,
            inner.stacked() if len(inner.modal) > 1 else inner.stacked()[0],
            *([] if base is None else [base.stacked()]),
            *([] if extra is None else [extra]),
        ]
        self._check(inputs)
        return self._functions[key](*inputs)

    def _check(self, inputs: list[Array]) -> None:
        for what, array in zip(("position", "velocity", "acceleration or torque"), inputs):
            if array.ndim != 2 or array.shape[1] != len(self.joints):
                raise InputError(
                    f"{what} has shape {array.shape}; "
                    f"robot '{self.robot.name}' has {len(self.joints)} moving joints."
                )
        lengths = {len(array) for array in inputs if array.ndim == 2}
        if len(lengths) > 1:
            raise InputError(f"arrays of a motion differ in length: {sorted(lengths)}.")
        if inputs[3].shape != self.inertial.shape:
            raise InputError(f"inertial has shape {inputs[3].shape}, not {self.inertial.shape}.")

    def _function(
        self, name: str, build: Callable[[SymbolicRobot, ca.SX], list[ca.SX]], moving_base: bool, extras: int
    ) -> ca.Function:
        count = len(self.joints)
        q, qd, qdd = (ca.SX.sym(symbol, count) for symbol in ("q", "qd", "qdd"))
        numbers = ca.SX.sym("inertial", len(self.inertial))
        base = ca.SX.sym("base", BASE_NUMBERS)
        inner = ca.SX.sym("inner", sum(inner_numbers(self.tree)))
        extra = ca.SX.sym("extra", extras)
        fixed: dict[str, Any] = SymbolicRobot.still_base(self.robot)
        if moving_base:
            fixed |= {"attitude": base[:4], "base_velocity": base[4:10], "base_acceleration": base[10:16]}
        if name == "energy":
            fixed["base_position"] = extra
        parts = ca.vertsplit(inner, np.cumsum([0, *inner_numbers(self.tree)]).tolist())
        names = ("balls", "ball_rates", "modal", "modal_rates", "inner_acceleration")
        fixed |= dict(zip(names, parts))
        robot = SymbolicRobot(self.robot, Motion(q, qd, qdd, **fixed), numbers)
        outputs = [ca.vec(ca.densify(result)) for result in build(robot, extra)]
        inputs = [q, qd, qdd, numbers, inner, *([base] if moving_base else []), *([extra] if extras else [])]
        return ca.Function(name, inputs, outputs, {"cse": True})


def _rows_first(matrix: ca.SX) -> ca.SX:
    """A matrix whose column-major order is the row-major order of the given one."""
    return ca.densify(matrix).T


def _inverse(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    return [robot.inverse_dynamics]


def _regressor(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    return [_rows_first(ca.jacobian(robot.inverse_dynamics, robot.inertial))]


def _jacobians(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    motion = robot.motion
    by = (motion.position, motion.velocity, motion.acceleration)
    return [_rows_first(ca.jacobian(robot.inverse_dynamics, variable)) for variable in by]


def _wrenches(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    return [robot.joint_wrenches]


def _loads(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    return [robot.bearing_loads(robot.joint_wrenches)]


def _mass_matrix(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    return [robot.mass_matrix]


def _forward(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    base = [extra] if robot.tree.free_base else []
    force = ca.vertcat(*base, robot.motion.acceleration, robot.motion.inner_acceleration)
    return [robot.forward_dynamics(force)]


def _momentum(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    return list(momentum(robot.mechanism))


def _energy(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    return [robot.energy]

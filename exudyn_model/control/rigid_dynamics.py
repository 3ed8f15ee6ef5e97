"""Inverse dynamics of the mechanism for controllers: their nominal model.

Recursive Newton-Euler in the members' own axes (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 5;
Luh, Walker, Paul 1980), written down once per robot as a CasADi expression: Exudyn calls the controller
several times a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import Mass, Mechanism, Member

__all__ = ["BaseState", "Inner", "InverseDynamics", "Needed"]

Array = NDArray[np.float64]
#: Acceleration of a frame's origin, angular acceleration, angular velocity, in its own axes.
Motion = tuple[ca.SX, ca.SX, ca.SX]


@dataclass(frozen=True)
class BaseState:
    """State of the base as measured by a controller.

    Attributes:
        rotation: base to inertial axes, shape (3, 3).
        angular_velocity: in base axes [rad/s], shape (3,).
        position, velocity: of its origin in the inertial frame [m, m/s], shape (3,); only a controller that
            holds the base needs them.
    """

    rotation: Array
    angular_velocity: Array
    position: Array | None = None
    velocity: Array | None = None


@dataclass(frozen=True)
class Inner:
    """State of spherical joints and flexible links as measured by a controller.

    Attributes:
        balls: attitude of each spherical joint, child to joint axes, shape (3, 3).
        ball_rates: of each, child against parent in the child's axes [rad/s], shape (3 k,).
        modal, modal_rates: of the flexible links in the controller's model, in the order of the file, (s,).
    """

    balls: Sequence[Array]
    ball_rates: Array
    modal: Array
    modal_rates: Array


@dataclass(frozen=True)
class Needed:
    """Forces required by a motion.

    Attributes:
        torques: of the actuators [N m or N], in the order of the robot file.
        wrench: on the base, force and moment about its origin in base axes [N, N m].
        joints: force on what each joint carries and moment about its origin, in axes whose z is the joint's.
    """

    torques: list[float]
    wrench: list[float]
    joints: Sequence[tuple[Array, Array]]


def _pose(member: Member, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Axes and origin of the member's frame in its parent's at joint position `q`."""
    rotation, origin = ca.SX(ca.DM(member.rotation)), ca.SX(ca.DM(member.origin))
    if not member.revolute:
        return rotation, origin + rotation[:, 2] * q
    s, c = ca.sin(q), ca.cos(q)
    x, y, z = ca.horzsplit(rotation)
    return ca.horzcat(x * c + y * s, y * c - x * s, z), origin


def _wrench(mass: Mass, motion: Motion) -> tuple[ca.SX, ca.SX]:
    """Force and moment about the origin required by this motion of a body."""
    acceleration, alpha, omega = motion
    h, inertia = ca.DM(mass.first_moment), ca.DM(mass.inertia)
    force = mass.mass * acceleration + ca.cross(alpha, h) + ca.cross(omega, ca.cross(omega, h))
    moment = inertia @ alpha + ca.cross(omega, inertia @ omega) + ca.cross(h, acceleration)
    return force, moment


def _outward(
    revolute: bool, pose: tuple[ca.SX, ca.SX], outer: Motion, *, rate: ca.SX, acceleration: ca.SX
) -> Motion:
    """The member's motion from its parent's."""
    (rotation, origin), (a, alpha, omega) = pose, outer
    a = rotation.T @ (a + ca.cross(alpha, origin) + ca.cross(omega, ca.cross(omega, origin)))
    alpha, omega = rotation.T @ alpha, rotation.T @ omega
    axis = ca.DM([0, 0, 1])
    across = ca.cross(omega, axis) * rate
    if revolute:
        return a, alpha + across + axis * acceleration, omega + axis * rate
    return a + 2 * across + axis * acceleration, alpha, omega


def _inward(pose: tuple[ca.SX, ca.SX], force: ca.SX, moment: ca.SX) -> tuple[ca.SX, ca.SX]:
    """A wrench about the member's origin as one about the parent's, in the parent's axes."""
    rotation, origin = pose
    turned = rotation @ force
    return turned, rotation @ moment + ca.cross(origin, turned)


class _Evaluated:
    """A function of one column, evaluated in place."""

    def __init__(self, function: ca.Function) -> None:
        self._given, self._found = np.zeros(function.size1_in(0)), np.zeros(function.size1_out(0))
        self._buffer, self._run = function.buffer()
        self._buffer.set_arg(0, memoryview(self._given))  # type: ignore[call-arg, arg-type]
        self._buffer.set_res(0, memoryview(self._found))  # type: ignore[call-arg, arg-type]

    def __call__(self, given: Sequence[float]) -> Array:
        """The result; overwritten by the next call."""
        self._given[:] = given
        self._run()
        return self._found


class InverseDynamics:
    """``tau = Z(q) qdd - z(q, qd)`` of a mechanism, joint vectors in the order of the robot file."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self.coordinate = mechanism.coordinate
        self.base_rotation, self.base_position = mechanism.base_rotation, mechanism.base_position
        #: Names of the links whose bending it knows: none.
        self.bent_links: tuple[str, ...] = ()
        self._count = len(mechanism.members)

    def __call__(
        self,
        q: Sequence[float],
        qd: Sequence[float],
        qdd: Sequence[float],
        *,
        base: BaseState | None = None,
        inner: Inner | None = None,
    ) -> list[float]:
        """Actuator torques [N m or N] that give joint accelerations `qdd` against nothing but gravity.

        A free base reacts to the torques. `base` is its state, by default at rest in its initial attitude; it
        is ignored for a fixed base. `inner` is ignored: links are rigid here.
        """
        return self._forces(q, qd, qdd, base, None)[: self._count].tolist()

    def needed(
        self,
        q: Sequence[float],
        qd: Sequence[float],
        qdd: Sequence[float],
        *,
        base: BaseState | None = None,
        held: Array | None = None,
        inner: Inner | None = None,
    ) -> Needed:
        """Forces required by the motion with a base that is accelerated by `held`, or else reacts.

        Args:
            q, qd, qdd: of the joints.
            base: its state, as above.
            held: inertial acceleration of a free base's origin and angular acceleration in base axes, shape
                (6,); if omitted, the reaction to the joints.
            inner: ignored.
        """
        found, n = self._forces(q, qd, qdd, base, held), self._count
        joints = found[n + 6 :].copy().reshape(n, 2, 3)
        return Needed(found[:n].tolist(), found[n : n + 6].tolist(), [(f, m) for f, m in joints])

    def mass_matrix(self, q: Sequence[float]) -> Array:
        """Z(q) of the joints with the base held, shape (n, n) [kg m^2, kg m or kg]."""
        n, nothing = self._count, [0.0] * 9
        columns = [self._driven([*q, *[0.0] * n, *unit.tolist(), *nothing])[:n].copy() for unit in np.eye(n)]
        return np.array(columns).T.reshape(n, n)

    def _forces(
        self,
        q: Sequence[float],
        qd: Sequence[float],
        qdd: Sequence[float],
        base: BaseState | None,
        held: Array | None,
    ) -> Array:
        """Torques, wrench on the base and wrenches of the joints, shape (7 n + 6,)."""
        if base is None or not self.mechanism.free:
            base = BaseState(self.base_rotation, np.zeros(3))
        lift, alpha = -(base.rotation.T @ self.mechanism.gravity), [0.0, 0.0, 0.0]
        if held is not None:
            lift, alpha = lift + held[:3], held[3:].tolist()
        left_alone = self.mechanism.free and held is None
        evaluate = self._reacting if left_alone else self._driven
        return evaluate([*q, *qd, *qdd, *base.angular_velocity.tolist(), *lift.tolist(), *alpha])

    @cached_property
    def _driven(self) -> _Evaluated:
        """Forces of joints and base from q, qd, qdd, the base's rate, its acceleration minus gravity, its
        angular acceleration: weights need no term of their own."""
        given, _, forces = self._recursion()
        return _evaluated(given, forces)

    @cached_property
    def _reacting(self) -> _Evaluated:
        """The same where nothing acts on the base: forces are linear in its accelerations."""
        given, accelerations, forces = self._recursion()
        slope = ca.jacobian(forces, accelerations)
        wrench = slice(self._count, self._count + 6)
        reaction = -ca.solve(slope[wrench, :], forces[wrench])
        return _evaluated(given, forces + slope @ reaction)

    def _recursion(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Tip to base, after base to tip: what is given, the base's accelerations in it, the forces."""
        members, n = self.mechanism.members, self._count
        q, qd, qdd = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd"))
        omega, accelerations = ca.SX.sym("omega", 3), ca.SX.sym("acceleration", 6)
        base = accelerations[:3], accelerations[3:], omega
        poses: list[tuple[ca.SX, ca.SX]] = []
        motions: list[Motion] = []
        for member, k in zip(members, self.coordinate):
            pose = _pose(member, q[k])
            outer = motions[member.parent] if member.parent >= 0 else base
            motions.append(_outward(member.revolute, pose, outer, rate=qd[k], acceleration=qdd[k]))
            poses.append(pose)
        wrenches = [_wrench(member.body, motion) for member, motion in zip(members, motions)]
        torques, total = ca.SX.zeros(n), _wrench(self.mechanism.base, base)
        for index in range(n - 1, -1, -1):
            member, k, (force, moment) = members[index], self.coordinate[index], wrenches[index]
            torques[k] = (moment if member.revolute else force)[2] + float(member.rotor) * qdd[k]
            carried = _inward(poses[index], force, moment)
            inner = wrenches[member.parent] if member.parent >= 0 else total
            both = inner[0] + carried[0], inner[1] + carried[1]
            if member.parent >= 0:
                wrenches[member.parent] = both
            else:
                total = both
        if self.mechanism.coupled is not None:
            torques += ca.DM(self.mechanism.coupled) @ qdd
        joints = [part for wrench in wrenches for part in wrench]
        return (
            ca.vertcat(q, qd, qdd, omega, accelerations),
            accelerations,
            ca.vertcat(torques, *total, *joints),
        )


def _evaluated(given: ca.SX, forces: ca.SX) -> _Evaluated:
    return _Evaluated(ca.Function("forces", [given], [ca.densify(forces)], {"cse": True}))

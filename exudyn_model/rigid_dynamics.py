"""Inverse dynamics of the mechanism, written for controllers: the nominal model they carry.

Recursive Newton-Euler in the members' own axes (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 5;
Luh, Walker, Paul 1980). Scalars instead of arrays: for a handful of bodies a Python float costs less than
a call into NumPy, and Exudyn calls the controller several times a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from exudyn_model.mechanism import Mass, Mechanism, Member

__all__ = ["BaseState", "Inner", "InverseDynamics", "Needed"]

Array = NDArray[np.float64]
Triple = tuple[float, float, float]
Rows = tuple[Triple, Triple, Triple]
ZERO: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class BaseState:
    """The base as a controller knows it.

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
    """Spherical joints and bent links as a controller knows them.

    Attributes:
        balls: attitude of each spherical joint, child to joint axes, shape (3, 3).
        ball_rates: of each, child against parent in the child's axes [rad/s], shape (3 k,).
        modal, modal_rates: of the flexible links that the controller knows, in the order of the file, (s,).
    """

    balls: Sequence[Array]
    ball_rates: Array
    modal: Array
    modal_rates: Array


@dataclass(frozen=True)
class Needed:
    """Forces that a motion needs.

    Attributes:
        torques: of the actuators [N m or N], in the order of the robot file.
        wrench: on the base, force and moment about its origin in base axes [N, N m].
        joints: force on what each joint carries and moment about its origin, in axes whose z is the joint's.
    """

    torques: list[float]
    wrench: list[float]
    joints: Sequence[tuple[Triple | Array, Triple | Array]]


def _cross(a: Triple, b: Triple) -> Triple:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _add(a: Triple, b: Triple) -> Triple:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _times(m: Rows, a: Triple) -> Triple:
    (p, q, r), (x, y, z) = m, a
    return (
        p[0] * x + p[1] * y + p[2] * z,
        q[0] * x + q[1] * y + q[2] * z,
        r[0] * x + r[1] * y + r[2] * z,
    )


def _transposed_times(m: Rows, a: Triple) -> Triple:
    (p, q, r), (x, y, z) = m, a
    return (
        p[0] * x + q[0] * y + r[0] * z,
        p[1] * x + q[1] * y + r[1] * z,
        p[2] * x + q[2] * y + r[2] * z,
    )


def _triple(values: Sequence[float] | Array) -> Triple:
    x, y, z = values
    return (float(x), float(y), float(z))


def _rows(matrix: Array) -> Rows:
    return (_triple(matrix[0]), _triple(matrix[1]), _triple(matrix[2]))


class _Body:
    """Constants of one body as plain numbers."""

    __slots__ = ("inertia", "mass", "moment", "origin", "parent", "revolute", "rotation", "rotor")

    def __init__(self, mass: Mass, member: Member | None = None) -> None:
        self.mass, self.moment = float(mass.mass), _triple(mass.first_moment)
        self.inertia = _rows(mass.inertia)
        if member is not None:
            self.parent, self.revolute, self.rotor = member.parent, member.revolute, float(member.rotor)
            self.rotation, self.origin = _rows(member.rotation), _triple(member.origin)

    def pose(self, q: float) -> tuple[Rows, Triple]:
        """Axes and origin of the member's frame in its parent's at joint position `q`."""
        if not self.revolute:
            x, y, z = self.rotation
            o = self.origin
            return self.rotation, (o[0] + x[2] * q, o[1] + y[2] * q, o[2] + z[2] * q)
        s, c = sin(q), cos(q)
        r0, r1, r2 = self.rotation
        turned = (
            (r0[0] * c + r0[1] * s, r0[1] * c - r0[0] * s, r0[2]),
            (r1[0] * c + r1[1] * s, r1[1] * c - r1[0] * s, r1[2]),
            (r2[0] * c + r2[1] * s, r2[1] * c - r2[0] * s, r2[2]),
        )
        return turned, self.origin

    def wrench(self, acceleration: Triple, alpha: Triple, omega: Triple) -> tuple[Triple, Triple]:
        """Force and moment about the origin that this motion of the body needs."""
        h, m = self.moment, self.mass
        force = _add(_cross(alpha, h), _cross(omega, _cross(omega, h)))
        force = _add(force, (m * acceleration[0], m * acceleration[1], m * acceleration[2]))
        moment = _add(_times(self.inertia, alpha), _cross(omega, _times(self.inertia, omega)))
        return force, _add(moment, _cross(h, acceleration))


class InverseDynamics:
    """``tau = Z(q) qdd - z(q, qd)`` of a mechanism, joint vectors in the order of the robot file."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._bodies = [_Body(member.body, member) for member in mechanism.members]
        self._base = _Body(mechanism.base)
        self._order = self.coordinate = mechanism.coordinate
        self.base_rotation, self.base_position = mechanism.base_rotation, mechanism.base_position
        #: Names of the links whose bending it knows: none.
        self.bent_links: tuple[str, ...] = ()
        members = mechanism.members
        self._spatial = np.array([member.body.spatial for member in members]).reshape(-1, 6, 6)
        self._columns = list(mechanism.coordinate)
        self._base_spatial = mechanism.base.spatial
        self._turns = np.array([member.revolute for member in members], dtype=bool)
        self._carries = np.eye(len(members))  # row i marks i and all bodies outboard of it
        for index in range(len(members) - 1, -1, -1):
            if members[index].parent >= 0:
                self._carries[members[index].parent] += self._carries[index]

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

        A free base moves as the torques make it move: its accelerations are eliminated,
        by solving that the wrench on the base vanishes. `base` is its state; left out, it is at rest in
        its initial attitude. On a fixed base it is ignored. `inner` is not looked at: links are rigid here.
        """
        if not self.mechanism.free:
            return self.needed(q, qd, qdd, base=base).torques
        found = self.needed(q, qd, qdd, base=base, held=np.zeros(6))
        coupling, whole = self._composite(q)
        reaction = np.linalg.solve(whole, found.wrench)  # minus the accelerations of the base
        return (np.array(found.torques) - coupling @ reaction).tolist()

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
        """What the motion needs with a base that is accelerated by `held`, or else left to itself.

        Args:
            q, qd, qdd: of the joints.
            base: its state, as above.
            held: inertial acceleration of a free base's origin and angular acceleration in base axes, shape
                (6,); left out, that which the joints give it.
            inner: not looked at.
        """
        state = base if base is not None and self.mechanism.free else self._still()
        gravity = state.rotation.T @ self.mechanism.gravity
        omega = _triple(state.angular_velocity)
        given = np.zeros(6) if held is None else held
        found = self._recursion(
            q, qd, qdd, lift=_triple(given[:3] - gravity), alpha=_triple(given[3:]), omega=omega
        )
        if held is None and self.mechanism.free:
            free: Array = -np.asarray(np.linalg.solve(self._composite(q)[1], found.wrench), dtype=np.float64)
            return self._recursion(
                q, qd, qdd, lift=_triple(free[:3] - gravity), alpha=_triple(free[3:]), omega=omega
            )
        return found

    def _composite(self, q: Sequence[float]) -> tuple[Array, Array]:
        """Z_mp, shape (n, 6), and Z_pp, shape (6, 6): joints and base against the base's accelerations.

        Composite rigid bodies (Featherstone, ch. 6) in base axes about the base's origin: with X_i from
        accelerations of the base to those of body i, and S_i the same of joint i's unit acceleration,
        ``Z_pp = M_0 + sum X_i^T M_i X_i`` and ``row i of Z_mp = S_i^T sum over what i carries``.
        """
        rotations, origins = self._placed(q)
        turned = rotations.transpose(0, 2, 1)
        count = len(origins)
        lever = np.zeros((count, 3, 3))
        x, y, z = origins.T
        lever[:, 0, 1], lever[:, 0, 2], lever[:, 1, 2] = -z, y, -x
        lever[:, 1, 0], lever[:, 2, 0], lever[:, 2, 1] = z, -y, x
        transfer = np.zeros((count, 6, 6))
        transfer[:, :3, :3] = transfer[:, 3:, 3:] = turned
        transfer[:, :3, 3:] = -turned @ lever
        bodies = transfer.transpose(0, 2, 1) @ self._spatial @ transfer
        unit = np.zeros((count, 6))
        axes = rotations[:, :, 2]
        unit[:, :3] = np.where(self._turns[:, None], (lever @ axes[:, :, None])[:, :, 0], axes)
        unit[:, 3:] = axes * self._turns[:, None]
        carried = (self._carries @ bodies.reshape(count, 36)).reshape(count, 6, 6)
        coupling = np.empty((count, 6))
        coupling[self._columns] = (carried @ unit[:, :, None])[:, :, 0]
        return coupling, self._base_spatial + bodies.sum(axis=0)

    def _placed(self, q: Sequence[float]) -> tuple[Array, Array]:
        """Axes (n, 3, 3) and origins (n, 3) of the members in the base's frame."""
        rotations, origins = np.empty((len(self._bodies), 3, 3)), np.empty((len(self._bodies), 3))
        for index, (body, k) in enumerate(zip(self._bodies, self._order)):
            turn, offset = body.pose(q[k])
            if body.parent < 0:
                rotations[index], origins[index] = turn, offset
            else:
                outer = rotations[body.parent]
                rotations[index], origins[index] = outer @ turn, origins[body.parent] + outer @ offset
        return rotations, origins

    def mass_matrix(self, q: Sequence[float]) -> Array:
        """Z(q) of the joints with the base held, shape (n, n) [kg m^2, kg m or kg]."""
        n = len(self._bodies)
        columns = [
            self._recursion(q, [0.0] * n, unit.tolist(), lift=ZERO, alpha=ZERO, omega=ZERO).torques
            for unit in np.eye(n)
        ]
        return np.array(columns).T.reshape(n, n)

    def _still(self) -> BaseState:
        return BaseState(self.mechanism.base_rotation, np.zeros(3))

    def _recursion(
        self,
        q: Sequence[float],
        qd: Sequence[float],
        qdd: Sequence[float],
        *,
        lift: Triple,
        alpha: Triple,
        omega: Triple,
    ) -> Needed:
        """Tip to base, after base to tip.

        `lift` is the base's acceleration minus gravity, so that weights need no term of their own.
        """
        poses: list[tuple[Rows, Triple]] = []
        motions: list[tuple[Triple, Triple, Triple]] = []
        wrenches: list[tuple[Triple, Triple]] = []
        for body, k in zip(self._bodies, self._order):
            pose = body.pose(q[k])
            outer = motions[body.parent] if body.parent >= 0 else (lift, alpha, omega)
            motion = _outward(body.revolute, pose, outer, rate=qd[k], acceleration=qdd[k])
            poses.append(pose)
            motions.append(motion)
            wrenches.append(body.wrench(*motion))
        torques = [0.0] * len(poses)
        total = self._base.wrench(lift, alpha, omega)
        for index in range(len(poses) - 1, -1, -1):
            body, k, (force, moment) = self._bodies[index], self._order[index], wrenches[index]
            torques[k] = (moment[2] if body.revolute else force[2]) + body.rotor * qdd[k]
            carried = _inward(poses[index], force, moment)
            if body.parent >= 0:
                inner = wrenches[body.parent]
                wrenches[body.parent] = (_add(inner[0], carried[0]), _add(inner[1], carried[1]))
            else:
                total = (_add(total[0], carried[0]), _add(total[1], carried[1]))
        return Needed(torques, [*total[0], *total[1]], wrenches)


def _outward(
    revolute: bool,
    pose: tuple[Rows, Triple],
    outer: tuple[Triple, Triple, Triple],
    *,
    rate: float,
    acceleration: float,
) -> tuple[Triple, Triple, Triple]:
    """Acceleration of the origin, angular acceleration and angular velocity, in the member's axes."""
    (rotation, origin), (a, alpha, omega) = pose, outer
    a = _add(a, _add(_cross(alpha, origin), _cross(omega, _cross(omega, origin))))
    a, alpha, omega = (_transposed_times(rotation, vector) for vector in (a, alpha, omega))
    if revolute:
        alpha = (alpha[0] + omega[1] * rate, alpha[1] - omega[0] * rate, alpha[2] + acceleration)
        return a, alpha, (omega[0], omega[1], omega[2] + rate)
    a = (a[0] + 2 * omega[1] * rate, a[1] - 2 * omega[0] * rate, a[2] + acceleration)
    return a, alpha, omega


def _inward(pose: tuple[Rows, Triple], force: Triple, moment: Triple) -> tuple[Triple, Triple]:
    """A wrench about the member's origin as one about the parent's, in the parent's axes."""
    rotation, origin = pose
    turned = _times(rotation, force)
    return turned, _add(_times(rotation, moment), _cross(origin, turned))

"""Channels of a redundant system besides the joints: bearings, spherical joints, tips, energy, momenta."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.flexible_link import flexible_link
from exudyn_model.bodies.rotation import cross, from_quaternion, skew, to_quaternion
from exudyn_model.redundant.bodies.exact_beam import ExactBeam
from exudyn_model.redundant.bodies.handles import Handle, euler_rates
from exudyn_model.redundant.bodies.modal_body import ModalBody
from exudyn_model.redundant.drive import JointMotion
from exudyn_model.redundant.reactions import bearing_load
from exudyn_model.redundant.system import System
from robot_model import Joint, Robot

__all__ = ["Watch", "extra_channels"]

Array = NDArray[np.float64]

LOADS = ("radial_force", "axial_force", "bending_moment", "load_moment")


def extra_channels(robot: Robot, *, flexible: str = "modal") -> tuple[str, ...]:
    """Channels that the redundant formulation gives besides those of the kinematic tree.

    Modal coordinates are included where links bend by modes, with `flexible` "modal".
    """
    names = [f"{joint.name}.{load}" for joint in robot.moving_joints for load in LOADS]
    for joint in robot.spherical_joints:
        names += [f"{joint.name}.attitude.{axis}" for axis in "wxyz"]
        names += [f"{joint.name}.angular_velocity.{axis}" for axis in "xyz"]
    for link in robot.flexible_links:
        names += [
            f"{link.name}.tip_{what}.{axis}" for what in ("deflection", "acceleration") for axis in "xyz"
        ]
        names += [f"{link.name}.strain.{k + 1}" for k in range(len(link.beam.gauges) if link.beam else 0)]
        if flexible == "modal" or not link.beam:
            names += [f"{link.name}.modal_coordinate.{k + 1}" for k in range(flexible_link(link).count)]
    names.append("robot.energy")
    names += [f"robot.{kind}_momentum.{axis}" for kind in ("linear", "angular") for axis in "xyz"]
    if getattr(robot.controller, "base_kp", None) is not None:
        names += [f"base.control_{kind}.{axis}" for kind in ("force", "torque") for axis in "xyz"]
    return tuple(names)


class Watch:
    """Reads one system at the instants of the recording."""

    def __init__(self, system: System) -> None:
        self._system = system
        self._near: dict[str, Array] = {}

    def row(
        self, time: float, x: Array, v: Array, a: Array, mass: Array, motion: JointMotion, stored: float
    ) -> list[float]:
        """Values of `extra_channels` from all coordinates, rates, accelerations and the mass matrix.

        `stored` is the energy of the gears [J].
        """
        system = self._system
        multipliers = system.multipliers()
        loads: dict[str, tuple[float, ...]] = {}
        spheres: dict[str, list[float]] = {}
        for k, link in enumerate(system.connections):
            outer, inner = motion.handles[k]
            if link.joint.kind in ("revolute", "prismatic"):
                loads[link.joint.name] = self._load(link.joint, multipliers[k], outer, inner)
            elif link.joint.kind == "spherical":
                relative = outer.joint.T @ inner.joint
                near = self._near.get(link.joint.name)
                attitude = self._near[link.joint.name] = to_quaternion(relative, near=near)
                spheres[link.joint.name] = [*attitude, *(inner.joint.T @ (inner.spin - outer.spin))]
        found: list[float] = []
        for joint in system.robot.moving_joints:
            found += loads[joint.name]
        for joint in system.robot.spherical_joints:
            found += spheres[joint.name]
        tips = {part.name: self._tip(k, x, v, a) for k, part in enumerate(system.parts) if part.link}
        for flexible in system.robot.flexible_links:
            found += tips[flexible.name]
        energy, *rest = self._balances(x, v, mass, motion)
        pushed, spin = self._pushed(time, x, v)
        rest[3:] = (np.array(rest[3:]) + spin).tolist()
        return [*found, energy + stored + pushed, *rest]

    def _pushed(self, time: float, x: Array, v: Array) -> tuple[float, Array]:
        """Energy of the force effects on bodies, and angular momentum on board, inertial axes."""
        energy, spin = 0.0, np.zeros(3)
        for gripped in self._system.pushes:
            rows = [self._system.rows_of(node) for node in gripped.grip.nodes]
            own_x, own_v = (np.concatenate([part[row] for row in rows]) for part in (x, v))
            at = gripped.grip.motion(time, own_x, own_v)
            energy += gripped.push.energy(at)
            spin += at.rotation @ gripped.push.spin(at)
        return energy, spin

    def _load(self, joint: Joint, multipliers: Array, outer: Handle, inner: Handle) -> tuple[float, ...]:
        load = bearing_load(joint.kind, multipliers, outer, inner)
        return *load.sizes, load.friction_moment(joint.bearing) if joint.bearing else 0.0

    def _tip(self, index: int, x: Array, v: Array, a: Array) -> list[float]:
        """Deflection in link axes, acceleration in the tip's axes, strains, modal coordinates if any."""
        system, body = self._system, self._system.bodies[index]
        if isinstance(body, ModalBody):
            return self._modal_tip(body, x, v, a)
        assert isinstance(body, ExactBeam)
        rows = [system.rows_of(node) for node in body.nodes]
        frames = [from_quaternion(x[row][3:7]) @ body.beam.axes.T for row in rows]
        apart = frames[0].T @ (x[rows[-1]][:3] - x[rows[0]][:3])
        acceleration = frames[-1].T @ a[rows[-1]][:3]
        return [*(apart - body.beam.nodes[-1]), *acceleration, *body.strains([x[row] for row in rows])]

    def _modal_tip(self, body: ModalBody, x: Array, v: Array, a: Array) -> list[float]:
        frame, modal = (self._system.rows_of(node) for node in (body.node, body.modal))
        link, own = body.link, x[modal]
        node = link.motion(link.tip, own, v[modal])
        rates = euler_rates(x[frame][3:7])
        omega, turning = rates @ v[frame][3:7], rates @ a[frame][3:7]
        acceleration = from_quaternion(x[frame][3:7]).T @ a[frame][:3] + cross(turning, node.place)
        acceleration += cross(omega, cross(omega, node.place) + 2 * node.slides)
        acceleration += node.slide @ a[modal] + node.slide_bias
        strain = link.shapes.strain @ own
        return [*(node.place - link.nodes[link.tip]), *(node.rotation.T @ acceleration), *strain, *own]

    def _balances(self, x: Array, v: Array, mass: Array, motion: JointMotion) -> list[float]:
        """Energy, linear momentum, angular momentum about the centre of mass, by the mass matrix.

        Reflected rotors have energy, but no mass or momentum of a body; on a fixed base they would rotate
        with the entire robot.
        """
        moves, turns = self._rigid_motions(x)
        driven = self._system.driven.astype(np.intp)
        bodies = mass.copy()
        bodies[np.ix_(driven, driven)] -= self._system.drive.reflected(motion)
        linear, angular = moves.T @ bodies @ v, turns.T @ bodies @ v
        whole = float(moves[:, 0] @ bodies @ moves[:, 0])
        # Moving at unit speed along e, the angular momentum about the origin is (m c) x e.
        first = turns.T @ bodies @ moves
        center = np.array([first[2, 1], first[0, 2], first[1, 0]]) / whole
        energy = 0.5 * float(v @ mass @ v) + self._system.elastic_energy(x)
        energy -= whole * float(self._system.gravity @ center)
        return [energy, *linear, *(angular - cross(center, linear))]

    def _rigid_motions(self, x: Array) -> tuple[Array, Array]:
        """Rates of all coordinates in unit translations and unit turns about the inertial origin, (N, 3)."""
        moves, turns = np.zeros((len(x), 3)), np.zeros((len(x), 3))
        for rows in self._system.frames:
            own = x[rows]
            moves[rows][:3] = np.eye(3)
            turns[rows][:3] = -skew(own[:3])
            turns[rows][3:] = 0.25 * euler_rates(own[3:7]).T @ from_quaternion(own[3:7]).T
        return moves, turns

"""Control and friction as expressions of Exudyn's coordinates.

Controllers and friction laws are the expressions of the reference model; this module computes their inputs
from Exudyn's coordinates, rates, accelerations and multipliers. Bearing loads come from the accelerations of
a tree's coordinates by inverse dynamics, and between bodies from Exudyn's own multipliers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import Mechanism
from exudyn_model.bodies.rotation import to_quaternion
from exudyn_model.redundant.bodies.parts import Connection
from reference_model.control.laws import drive
from reference_model.control.motion import reference_function
from reference_model.dynamics.balance import LOADS, bearing_load
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.kinematics.spatial import rotation_from_quaternion
from reference_model.plant.acting import Signals
from reference_model.plant.closed_loop import Plant
from robot_model import Bearing, Robot

__all__ = ["Coordinates", "Seats", "between_bodies", "bristles", "on_tree"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coordinates:
    """Symbols of Exudyn's state.

    Attributes:
        time: [s].
        x, v, a: coordinates without their reference values, rates and accelerations, N x 1.
        multipliers: of the constraints.
        weights: of the derivatives of a Jacobian by x, v and a, 3 x 1.
    """

    time: ca.SX
    x: ca.SX
    v: ca.SX
    a: ca.SX
    multipliers: ca.SX
    weights: ca.SX

    @classmethod
    def of(cls, count: int, multipliers: int) -> Coordinates:
        """Symbols for so many coordinates and multipliers."""
        columns = [ca.SX.sym(name, count) for name in "xva"]
        return cls(ca.SX.sym("t"), *columns, ca.SX.sym("multipliers", multipliers), ca.SX.sym("weights", 3))

    @property
    def inputs(self) -> list[ca.SX]:
        """In the order of `machine_code.System.addresses`."""
        return [self.time, self.x, self.v, self.a, self.multipliers, self.weights]


@dataclass(frozen=True)
class Seats:
    """A connection between two bodies, in terms of the system's coordinates.

    Attributes:
        link: the connection.
        outer, inner: first coordinate of the carrying and of the carried body's frame.
        multipliers: first one of the constraint.
    """

    link: Connection
    outer: int
    inner: int
    multipliers: int


def bristles(robot: Robot) -> int:
    """Internal states of its friction laws."""
    return Plant(robot).layout.effect_states


def on_tree(robot: Robot, mechanism: Mechanism, at: Coordinates) -> ca.SX:
    """Forces on the tree's coordinates and rates of the bristles, N x 1.

    Bristle deflections are the rates of the last coordinates.
    """
    plant = Plant(robot)
    first, count = (6 if mechanism.free else 0), len(mechanism.coordinate)
    member = [first + mechanism.coordinate.index(k) for k in range(count)]
    parts = {"position": at.x[member], "velocity": at.v[member], "effects": at.v[first + count :]}
    moving = {"base_acceleration": ca.SX(6, 1)}
    if mechanism.free:
        attitude, twist = _base(mechanism, at)
        parts |= {"base_position": at.x[:3], "attitude": attitude, "base_velocity": twist}
        turning = _along(twist[3:], at)
        moving["base_acceleration"] = ca.vertcat(rotation_from_quaternion(attitude).T @ at.a[:3], turning)
    still = SymbolicRobot.still_base(robot)
    own = {name: parts.get(name, still[name]) for name in ("attitude", "base_velocity", "base_position")}
    motion = Motion(parts["position"], parts["velocity"], at.a[member], **own, **moving)
    model = plant.truth.symbolic(motion, at.time, ca.SX(0, 1))
    force, rates = _acting(plant, at.time, parts, at.a[member], model.bearing_loads(model.joint_wrenches))
    return ca.vertcat(ca.SX(first, 1), force[list(mechanism.coordinate)], rates)


def _base(mechanism: Mechanism, at: Coordinates) -> tuple[ca.SX, ca.SX]:
    """Attitude, 4 x 1, and velocity [linear; angular] in base axes, 6 x 1, of a base on six joints."""
    attitude = ca.SX(to_quaternion(mechanism.base_rotation))
    for axis in range(3):
        half = at.x[3 + axis] / 2
        turn = [ca.cos(half), 0, 0, 0]
        turn[1 + axis] = ca.sin(half)
        attitude = _product(attitude, ca.vertcat(*turn))
    (da, db, dc), (b, c) = ca.vertsplit(at.v[3:6]), ca.vertsplit(at.x[4:6])
    omega = ca.vertcat(
        ca.cos(b) * ca.cos(c) * da + ca.sin(c) * db,
        -ca.cos(b) * ca.sin(c) * da + ca.cos(c) * db,
        ca.sin(b) * da + dc,
    )
    return attitude, ca.vertcat(rotation_from_quaternion(attitude).T @ at.v[:3], omega)


def _product(a: ca.SX, b: ca.SX) -> ca.SX:
    """Of quaternions (w, x, y, z)."""
    vector = a[0] * b[1:] + b[0] * a[1:] + ca.cross(a[1:], b[1:])
    return ca.vertcat(a[0] * b[0] - ca.dot(a[1:], b[1:]), vector)


def _along(value: ca.SX, at: Coordinates) -> ca.SX:
    """Rate of a value along the motion."""
    return ca.jtimes(value, at.x, at.v) + ca.jtimes(value, at.v, at.a)


def between_bodies(
    robot: Robot, seats: Sequence[Seats], reference: Array, own: Sequence[int], at: Coordinates
) -> tuple[ca.SX, ca.SX]:
    """Forces on the coordinates `own` and the rotors' mass matrix on them; square, dense.

    Args:
        robot: all of its joints revolute, on a free base in weightlessness.
        seats: its connections.
        reference: values of all coordinates, shape (N,).
        own: of the system's coordinates those of the bodies' frames, then the bristles'.
        at: symbols.
    """
    plant = Plant(robot)
    order = [joint.name for joint in robot.moving_joints]
    whole, states = ca.SX(reference) + at.x, plant.layout.effect_states
    joints, loads = {}, {}
    for seat in seats:
        k = order.index(seat.link.joint.name)
        joints[k] = _turn(seat, whole, at.v)
        loads[k] = _carried(seat, whole, at.multipliers)
    position, velocity = (ca.vertcat(*(joints[k][i] for k in range(len(order)))) for i in (0, 1))
    frame = whole[:7]
    axes = rotation_from_quaternion(frame[3:])
    parts = {
        "position": position,
        "velocity": velocity,
        "base_position": frame[:3],
        "attitude": frame[3:],
        "base_velocity": ca.vertcat(axes.T @ at.v[:3], _omega(frame[3:], at.v[3:7])),
        "effects": at.v[own[len(own) - states :]],
    }
    column = ca.horzcat(*(loads[k] for k in range(len(order))))
    force, rates = _acting(plant, at.time, parts, ca.SX(len(order), 1), column)
    rows = ca.jacobian(velocity, at.v)[:, own]
    motors = [joint.actuator for joint in robot.moving_joints]
    rotors = [m.gear_ratio**2 * m.rotor_inertia if m else 0.0 for m in motors]
    generalised = ca.densify(rows.T @ force)
    generalised[len(own) - states :] += rates
    mass = rows.T @ ca.diag(ca.SX(rotors)) @ rows
    ones = [0.0] * (len(own) - states) + [1.0] * states
    return generalised, mass + ca.diag(ca.SX(ones))


def _acting(
    plant: Plant, time: ca.SX, parts: Mapping[str, ca.SX], acceleration: ca.SX, loads: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Forces on the joints, n x 1, and the rates of the bristles."""
    sizes = plant.layout.sizes
    state = ca.vertcat(*(parts.get(name, ca.SX(size, 1)) for name, size in sizes.items()))
    command = plant.command(time, state, *reference_function(plant.robot)(time))
    position, velocity = parts["position"], parts["velocity"]
    torque = drive(plant.robot, command[plant.wrench :], velocity)
    assert loads.shape[0] == len(LOADS)
    signals = Signals(time, position, velocity, acceleration, torque, loads)
    total, rates, _ = plant.forces.act(signals, parts["effects"])
    return torque + total, rates


def _omega(e: ca.SX, rate: ca.SX) -> ca.SX:
    """Angular velocity in body axes from Euler parameters and their rates, 3 x 1."""
    return 2 * (e[0] * rate[1:] - rate[0] * e[1:] - ca.cross(e[1:], rate[1:]))


def _turn(seat: Seats, whole: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Angle and angular velocity about the joint's z axis."""
    (outer, inner), (outer_omega, inner_omega) = (
        _frames(seat, whole),
        [_omega(whole[k + 3 : k + 7], v[k + 3 : k + 7]) for k in (seat.outer, seat.inner)],
    )
    relative = outer.T @ inner[:, 0]
    carrying = ca.SX((seat.link.rotation @ seat.link.align)[:, 2])
    speed = ca.dot(ca.SX(seat.link.align[:, 2]), inner_omega) - ca.dot(carrying, outer_omega)
    return ca.atan2(relative[1], relative[0]), speed


def _frames(seat: Seats, whole: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Axes of the joint on both bodies, inertial."""
    turns = seat.link.rotation @ seat.link.align, seat.link.align
    places = seat.outer, seat.inner
    outer, inner = (
        rotation_from_quaternion(whole[k + 3 : k + 7]) @ ca.SX(turn) for k, turn in zip(places, turns)
    )
    return outer, inner


def _carried(seat: Seats, whole: ca.SX, multipliers: ca.SX) -> ca.SX:
    """Rows of `LOADS` from Exudyn's multipliers: three global forces, two products of axes that vanish."""
    own = multipliers[seat.multipliers : seat.multipliers + 6]
    outer, inner = _frames(seat, whole)
    moment = sum(-own[3 + k] * ca.cross(inner[:, k], outer[:, 2]) for k in (0, 1))
    wrench = ca.vertcat(outer.T @ -own[:3], outer.T @ moment)
    bearing = seat.link.joint.bearing or Bearing()
    return bearing_load("revolute", ca.SX([0.0, 0.0, 1.0]), wrench, bearing)

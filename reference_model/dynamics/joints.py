"""One step of the recursion in three parts: node of the inboard body, joint, root of the outboard body.

Each step maps the velocity column [rd; omega] of one frame to that of the next, ``v' = X v + h w + b`` at
acceleration level, w the rates of the step's own coordinates. A step is exact: its position, velocity and
acceleration agree with one another to rounding, so that energy and momentum are conserved to integration
tolerance for deflections of any size.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.flexible import FlexibleBody
from reference_model.kinematics.spatial import constant, rotation_about, rotation_from_quaternion, skew

__all__ = ["Node", "Step", "joint_step", "node_of", "node_step", "root_step"]


@dataclass(frozen=True)
class Step:
    """From one frame to the next.

    Attributes:
        transfer: X, 6 x 6.
        columns: h, of the step's own coordinates, 6 x k.
        bias: b [m/s^2, rad/s^2], 6 x 1; depends on the velocities of both frames.
        velocity: of the next frame in its own axes, 6 x 1.
        rotation: next to first axes, 3 x 3.
        shift: origin of the next frame from that of the first, in the first frame's axes [m], 3 x 1.
    """

    transfer: ca.SX
    columns: ca.SX
    bias: ca.SX
    velocity: ca.SX
    rotation: ca.SX
    shift: ca.SX


@dataclass(frozen=True)
class Node:
    """Position of a node of a flexible body, and its motion with the modal coordinates.

    Attributes:
        place: rho, from the frame's origin in the body's axes [m], 3 x 1.
        rotation: node to body axes, 3 x 3.
        slide: d rho / dx, 3 x s.
        turn: angular velocity of the node in the body per unit of modal rate, body axes, 3 x s.
        slide_rate, turn_rate: time derivatives of slide and turn times the modal rates, 3 x 1 each.
    """

    place: ca.SX
    rotation: ca.SX
    slide: ca.SX
    turn: ca.SX
    slide_rate: ca.SX
    turn_rate: ca.SX


def node_of(body: FlexibleBody, index: int, x: ca.SX, rate: ca.SX) -> Node:
    """A node for given modal coordinates and rates.

    The displacement is Phi x, minus the foreshortening 1/2 x^T B x along the axis of a stiffening beam. The
    rotation vector Psi x is used as twice the Rodrigues parameters: an exact rotation that agrees with
    1 + (Psi x)~ to first order (docs/theory.md (1)), with angular velocity
    ``(phid + phi x phid / 2) / (1 + phi.phi / 4)``.
    """
    phi = constant(body.translations[index])
    psi = constant(body.rotations[index])
    slide, place = phi, constant(body.nodes[index]) + phi @ x
    slide_rate = ca.SX(3, 1)
    if body.foreshortening is not None and body.axis is not None:
        axis = constant(body.axis)
        shape = constant(body.foreshortening[index])
        place -= axis * (ca.dot(x, shape @ x) / 2)
        slide -= axis @ (x.T @ shape)
        slide_rate -= axis * ca.dot(rate, shape @ rate)
    angle, spin = psi @ x, psi @ rate
    size = 1 + ca.dot(angle, angle) / 4
    turn = ((ca.SX.eye(3) + skew(angle) / 2) / size) @ psi
    rotation = rotation_from_quaternion(ca.vertcat(1, angle / 2))
    # d/dt of (1 + phi~/2)/size: phid x phid vanishes, the denominator's derivative remains
    turn_rate = -(ca.dot(angle, spin) / 2 / size) * (turn @ rate)
    return Node(place, rotation, slide, turn, slide_rate, turn_rate)


def node_step(node: Node, velocity: ca.SX, rate: ca.SX) -> Step:
    """From a flexible body's frame to the axes of one of its nodes; the columns are its modal coordinates."""
    omega, back = velocity[3:6], node.rotation.T
    sliding, turning = node.slide @ rate, node.turn @ rate
    transfer = _carried(back, node.place)
    columns = ca.vertcat(back @ node.slide, back @ node.turn)
    linear = ca.cross(omega, ca.cross(omega, node.place) + 2 * sliding) + node.slide_rate
    angular = ca.cross(omega, turning) + node.turn_rate
    return Step(
        transfer,
        columns,
        ca.vertcat(back @ linear, back @ angular),
        transfer @ velocity + columns @ rate,
        node.rotation,
        node.place,
    )


def root_step(node: Node, velocity: ca.SX, rate: ca.SX) -> Step:
    """From the axes of a flexible body's root node to the body's frame: `node_step` backwards."""
    turn, place = node.rotation, node.place
    transfer = ca.blockcat([[turn, skew(place) @ turn], [ca.SX(3, 3), turn]])
    columns = ca.vertcat(-node.slide - skew(place) @ node.turn, -node.turn)
    result = transfer @ velocity + columns @ rate
    omega = result[3:6]
    sliding, turning = node.slide @ rate, node.turn @ rate
    angular = -ca.cross(omega, turning) - node.turn_rate
    linear = -ca.cross(omega, ca.cross(omega, place) + 2 * sliding) - node.slide_rate
    bias = ca.vertcat(linear + skew(place) @ angular, angular)
    return Step(transfer, columns, bias, result, turn.T, -turn.T @ place)


def joint_step(
    kind: str,
    rotation: NDArray[np.float64],
    origin: NDArray[np.float64],
    axis: NDArray[np.float64],
    *,
    place: ca.SX,
    rate: ca.SX,
    velocity: ca.SX,
) -> Step:
    """Across a joint, from the frame it sits on to the frame it carries.

    Args:
        kind: revolute, prismatic, spherical or fixed.
        rotation: joint frame to the first frame's axes at rest, 3 x 3.
        origin: of the joint frame in the first frame [m], shape (3,).
        axis: unit vector in joint axes, shape (3,).
        place: the joint's position, 1 x 1, or its quaternion, 4 x 1; empty for a fixed joint.
        rate: the joint's velocity, 1 x 1 or 3 x 1 in carried axes; empty for a fixed joint.
        velocity: of the first frame in its own axes, 6 x 1.
    """
    omega = velocity[3:6]
    turn, shift = constant(rotation), constant(origin)
    along = constant(axis)
    columns, sliding = ca.SX(6, 0), ca.SX(3, 1)
    if kind == "revolute":
        columns = ca.vertcat(ca.SX(3, 1), along)
        turn = turn @ rotation_about(axis, place)
    elif kind == "prismatic":
        columns = ca.vertcat(along, ca.SX(3, 1))
        shift += turn @ along * place
        sliding = turn @ along * rate
    elif kind == "spherical":
        columns = ca.vertcat(ca.SX(3, 3), ca.SX.eye(3))
        turn = turn @ rotation_from_quaternion(place)
    back = turn.T
    transfer = _carried(back, shift)
    result = transfer @ velocity + columns @ rate
    linear = back @ ca.cross(omega, ca.cross(omega, shift) + 2 * sliding)
    angular = ca.cross(result[3:6], (columns @ rate)[3:6])
    return Step(transfer, columns, ca.vertcat(linear, angular), result, turn, shift)


def _carried(back: ca.SX, shift: ca.SX) -> ca.SX:
    """[A, -A rho~; 0, A]: the velocity of a frame at rho, in the axes into which A transforms, 6 x 6."""
    return ca.blockcat([[back, -back @ skew(shift)], [ca.SX(3, 3), back]])

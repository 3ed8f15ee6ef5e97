"""Dynamics of a tree as pure functions of expressions: both directions, reactions, momentum and energy.

Jourdain's principle over the velocity recursion gives as many equations as coordinates,
``-Z ydd + z + f = 0`` with ``Z = sum G_i^T M_i G_i`` and ``z = sum G_i^T (f_i - M_i g_i)`` (Liu, Li, Wang,
Cai 2015). Here the sums over the global matrices G_i are never formed: forces accumulate from the tips to
the base, so inverse dynamics and articulated-body forward dynamics (Featherstone, Rigid Body Dynamics
Algorithms, 2008, ch. 5-7) cost O(n).

Generalised vectors hold, for a free base, first ``[force; moment]`` or ``[linear; angular]`` of the base
frame's origin in base axes (6 rows), then the moving joints in file order (n rows).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from reference_model.inertial import BodyMass
from reference_model.tree import BodyState, Tree

__all__ = [
    "Mechanism",
    "accelerations",
    "forward_dynamics",
    "generalised",
    "mass_matrix",
    "solve_spd",
    "wrenches",
]


@dataclass(frozen=True)
class Mechanism:
    """A tree in a given state with given masses: what every algorithm below needs.

    Attributes:
        tree: constants of the recursion.
        states: result of `tree.recursion`.
        masses: by index of the body; a fixed base has none.
        reflected: rotor inertia on the joint coordinates [kg m^2 or kg], n x 1.
        gravity: inertial axes [m/s^2], 3 x 1.
    """

    tree: Tree
    states: tuple[BodyState, ...]
    masses: Mapping[int, BodyMass]
    reflected: ca.SX
    gravity: ca.SX

    def own(self, index: int, generalised_vector: ca.SX) -> ca.SX:
        """The rows of a generalised vector that belong to one body's own coordinates."""
        return generalised_vector[self.columns(index)]

    def columns(self, index: int) -> slice:
        """Places of one body's own coordinates in generalised vectors."""
        offset = 6 if self.tree.free_base else 0
        if index == 0:
            return slice(0, offset)
        start = offset + self.tree.bodies[index].coordinate
        return slice(start, start + self.states[index].hinge.shape[1])

    def rotor(self, index: int) -> ca.SX:
        """Reflected inertia on the coordinates of one body, square."""
        coordinate = self.tree.bodies[index].coordinate
        count = self.states[index].hinge.shape[1]
        return ca.SX(count, count) if coordinate < 0 else self.reflected[coordinate]


def _applied(mechanism: Mechanism, index: int) -> ca.SX:
    """f_i: inertial, Coriolis and gravity force on a body at its origin, in its axes, 6 x 1.

    f_w = -[om~ om~ m c; om~ J om] and f_o = [m g; m c~ g].
    """
    mass = mechanism.masses.get(index)
    if mass is None:
        return ca.SX(6, 1)
    state = mechanism.states[index]
    omega = state.velocity[3:6]
    gravity = state.rotation.T @ mechanism.gravity
    force = mass.mass * gravity - ca.cross(omega, ca.cross(omega, mass.first_moment))
    moment = ca.cross(mass.first_moment, gravity) - ca.cross(omega, mass.inertia @ omega)
    return ca.vertcat(force, moment)


def _matrix(mechanism: Mechanism, index: int) -> ca.SX:
    """M_i, 6 x 6; zero for a fixed base."""
    mass = mechanism.masses.get(index)
    return ca.SX(6, 6) if mass is None else mass.matrix


def accelerations(mechanism: Mechanism, acceleration: ca.SX, base_acceleration: ca.SX) -> tuple[ca.SX, ...]:
    """Acceleration column of every body, vd_i = T_ij vd_j + U_i ydd_i + beta_i, each 6 x 1.

    Args:
        mechanism: tree, state and masses.
        acceleration: of the joints, n x 1.
        base_acceleration: inertial acceleration of the base in base axes, [linear; angular], 6 x 1.
    """
    found = [base_acceleration]
    for index in range(1, len(mechanism.tree.bodies)):
        body, state = mechanism.tree.bodies[index], mechanism.states[index]
        value = state.transfer @ found[body.parent] + state.bias
        if body.coordinate >= 0:
            value += state.hinge * acceleration[body.coordinate]
        found.append(value)
    return tuple(found)


def wrenches(mechanism: Mechanism, acceleration: ca.SX, base_acceleration: ca.SX) -> tuple[ca.SX, ...]:
    """Wrench by the inboard on the outboard body at every body's origin, [force; moment], body axes.

    Newton-Euler from the tips to the base: w_i = M_i vd_i - f_i, and the wrench at a body is its own w_i
    plus those of all bodies outboard, carried inwards by T^T. Entry 0 is the external wrench that the
    base needs.
    """
    moved = accelerations(mechanism, acceleration, base_acceleration)
    total = [
        _matrix(mechanism, index) @ value - _applied(mechanism, index) for index, value in enumerate(moved)
    ]
    for index in range(len(total) - 1, 0, -1):
        parent = mechanism.tree.bodies[index].parent
        total[parent] = total[parent] + mechanism.states[index].transfer.T @ total[index]
    return tuple(total)


def generalised(mechanism: Mechanism, wrench: tuple[ca.SX, ...], acceleration: ca.SX) -> ca.SX:
    """Inverse dynamics from the wrenches: U_i^T w_i plus the rotors' share, rows as in the module's head."""
    joints = [
        mechanism.states[index].hinge.T @ wrench[index] + mechanism.reflected[k] * acceleration[k]
        for k, index in enumerate(mechanism.tree.moved)
    ]
    return ca.densify(ca.vertcat(*([wrench[0]] if mechanism.tree.free_base else []), *joints))


def mass_matrix(mechanism: Mechanism) -> ca.SX:
    """Z = sum G_i^T M_i G_i by composite bodies, rows x rows, symmetric and positive definite."""
    tree, states = mechanism.tree, mechanism.states
    composite = [_matrix(mechanism, index) for index in range(len(tree.bodies))]
    for index in range(len(composite) - 1, 0, -1):
        transfer, parent = states[index].transfer, tree.bodies[index].parent
        composite[parent] = composite[parent] + transfer.T @ composite[index] @ transfer
    offset = 6 if tree.free_base else 0
    result = ca.SX(tree.rows, tree.rows)
    if tree.free_base:
        result[:6, :6] = composite[0]
    for k, index in enumerate(tree.moved):
        force = composite[index] @ states[index].hinge
        result[offset + k, offset + k] = states[index].hinge.T @ force + mechanism.reflected[k]
        while index != 0:  # carry the force of a unit acceleration inwards past every inboard joint
            force, index = states[index].transfer.T @ force, tree.bodies[index].parent
            columns = mechanism.columns(index)
            result[columns, offset + k] = states[index].hinge.T @ force
            result[offset + k, columns] = force.T @ states[index].hinge
    return ca.densify(result)


def solve_spd(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solution of a symmetric positive definite system, by a division or by L D L^T."""
    if matrix.shape == (1, 1):
        return right / matrix
    diagonal, upper, order = ca.ldl(ca.densify(matrix))
    return ca.ldl_solve(ca.densify(right), diagonal, upper, order)


def forward_dynamics(mechanism: Mechanism, force: ca.SX, base_acceleration: ca.SX) -> ca.SX:
    """Accelerations by the articulated-body method, O(n).

    Args:
        mechanism: tree, state and masses.
        force: generalised forces, rows as in the module's head.
        base_acceleration: of a base that is not free, 6 x 1; ignored for a free base.

    Returns:
        Generalised accelerations; of a free base the inertial acceleration in base axes.
    """
    tree, states = mechanism.tree, mechanism.states
    inertia = [_matrix(mechanism, index) for index in range(len(tree.bodies))]
    bias = [-_applied(mechanism, index) for index in range(len(tree.bodies))]
    for index in range(len(inertia) - 1, 0, -1):
        state, parent = states[index], tree.bodies[index].parent
        seen, pushed = inertia[index], bias[index]
        if state.hinge.shape[1]:
            lever = inertia[index] @ state.hinge
            size = state.hinge.T @ lever + mechanism.rotor(index)
            seen = seen - lever @ solve_spd(size, lever.T)
            left = mechanism.own(index, force) - state.hinge.T @ bias[index]
            pushed = pushed + lever @ solve_spd(size, left)
        inertia[parent] = inertia[parent] + state.transfer.T @ seen @ state.transfer
        bias[parent] = bias[parent] + state.transfer.T @ (pushed + seen @ state.bias)
    moved = [solve_spd(inertia[0], force[:6] - bias[0]) if tree.free_base else base_acceleration]
    found: dict[int, ca.SX] = {}
    for index in range(1, len(tree.bodies)):
        body, state = tree.bodies[index], states[index]
        value = state.transfer @ moved[body.parent] + state.bias
        if body.coordinate >= 0:
            lever = inertia[index] @ state.hinge
            size = state.hinge.T @ lever + mechanism.rotor(index)
            left = mechanism.own(index, force) - state.hinge.T @ bias[index] - lever.T @ value
            found[body.coordinate] = solve_spd(size, left)
            value = value + state.hinge @ found[body.coordinate]
        moved.append(value)
    joints = [found[k] for k in range(len(tree.joints))]
    return ca.densify(ca.vertcat(*([moved[0]] if tree.free_base else []), *joints))

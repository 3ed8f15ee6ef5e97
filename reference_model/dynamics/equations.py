"""Dynamics of a tree as pure functions of expressions: both directions, reactions, momentum and energy.

Jourdain's principle over the velocity recursion gives as many equations as coordinates,
``-Z ydd + z + f = 0`` with ``Z = sum G_i^T M_i G_i`` and ``z = sum G_i^T (f_i - M_i g_i)`` (Liu, Li, Wang,
Cai 2015). Here the sums over the global matrices G_i are never formed: forces accumulate from the tips to
the base, so inverse dynamics and articulated-body forward dynamics (Featherstone, Rigid Body Dynamics
Algorithms, 2008, ch. 5-7) cost O(n).

The force column of a flexible body has rows for its modal coordinates below the wrench; its own coordinates
are those of its joint and the modal ones. Otherwise it is treated like a rigid body.

Generalised vectors are ordered as in `tree.Tree`; for a free base they hold ``[force; moment]`` or
``[linear; angular]`` at the base frame's origin in base axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca

from reference_model.dynamics.inertial import BodyMass
from reference_model.dynamics.outside import Outside
from reference_model.dynamics.tree import BodyState, Tree
from reference_model.kinematics.spatial import rows_of

__all__ = [
    "Mechanism",
    "accelerations",
    "applied",
    "body_matrix",
    "forward_dynamics",
    "generalised",
    "joint_wrench",
    "mass_matrix",
    "solve_spd",
    "wrenches",
]


@dataclass(frozen=True)
class Mechanism:
    """A tree in a given state with given masses: the input of every algorithm below.

    Attributes:
        tree: constants of the recursion.
        states: result of `tree.recursion`.
        masses: by index of the body; a fixed base has none.
        rotors: their mass matrix on the joint coordinates [kg m^2 or kg], n x n; diagonal unless motors move
            several joints.
        gravity: inertial axes [m/s^2], 3 x 1.
        outside: forces of the surroundings and devices on board on the bodies.
    """

    tree: Tree
    states: tuple[BodyState, ...]
    masses: Mapping[int, BodyMass]
    rotors: ca.SX
    gravity: ca.SX
    outside: Outside = field(default_factory=Outside)

    def own(self, index: int, generalised_vector: ca.SX) -> ca.SX:
        """The rows of a generalised vector for one body's own coordinates."""
        return rows_of(generalised_vector, self.tree.own(index))

    @property
    def is_coupled(self) -> bool:
        """Whether a rotor sits on several joints."""
        return not self.rotors.sparsity().is_diag()

    def rotor(self, index: int) -> ca.SX:
        """Reflected inertia on the coordinates of one body, square."""
        coordinate = self.tree.bodies[index].coordinate
        count = self.states[index].hinge.shape[1]
        inertia = ca.SX(count, count)
        if coordinate >= 0:
            inertia[0, 0] = self.rotors[coordinate, coordinate]
        return inertia


def applied(mechanism: Mechanism, index: int) -> ca.SX:
    """f_i: inertial, elastic, gravity and outer force on a body at its origin, in its axes, (6 + s) x 1.

    f_w = -[om~ om~ m c; om~ J om] of a rigid body and f_o = [m g; m c~ g; (d(m c)/dx)^T g].
    """
    mass = mechanism.masses.get(index)
    outer = mechanism.outside.columns.get(index)
    if mass is None:
        return ca.SX(6, 1) if outer is None else outer
    force = mass.force + mass.weight @ (mechanism.states[index].rotation.T @ mechanism.gravity)
    return force if outer is None else force + outer


def body_matrix(mechanism: Mechanism, index: int) -> ca.SX:
    """M_i, (6 + s) x (6 + s); zero for a fixed base."""
    mass = mechanism.masses.get(index)
    return ca.SX(6, 6) if mass is None else mass.matrix


def accelerations(
    mechanism: Mechanism, acceleration: ca.SX, base_acceleration: ca.SX, inner: ca.SX
) -> tuple[ca.SX, ...]:
    """Acceleration column of every body, vd_i = T_ij vd_j + U_i ydd_i + beta_i, (6 + s_i) x 1 each.

    Args:
        mechanism: tree, state and masses.
        acceleration: of the one-coordinate joints, n x 1.
        base_acceleration: inertial acceleration of the base in base axes, [linear; angular], 6 x 1.
        inner: accelerations of spherical joints and modal coordinates.
    """
    tree = mechanism.tree
    every = ca.vertcat(ca.SX(tree.offset, 1), acceleration, inner)
    found = [base_acceleration]
    for index in range(1, len(tree.bodies)):
        state = mechanism.states[index]
        value = state.transfer @ found[tree.bodies[index].parent] + state.bias
        found.append(value + state.hinge @ mechanism.own(index, every))
    return tuple(found)


def wrenches(
    mechanism: Mechanism, acceleration: ca.SX, base_acceleration: ca.SX, inner: ca.SX
) -> tuple[ca.SX, ...]:
    """Generalised force by the inboard on the outboard body at every body's origin, body axes.

    Newton-Euler from the tips to the base: w_i = M_i vd_i - f_i, and the force at a body is its own w_i
    plus those of all bodies outboard, carried inwards by T^T. Its first six rows are the wrench
    [force; moment], the others the forces on the modal coordinates required by the motion. Entry 0 is the
    external wrench required at the base.
    """
    moved = accelerations(mechanism, acceleration, base_acceleration, inner)
    total = [
        body_matrix(mechanism, index) @ value - applied(mechanism, index) for index, value in enumerate(moved)
    ]
    for index in range(len(total) - 1, 0, -1):
        parent = mechanism.tree.bodies[index].parent
        total[parent] = total[parent] + mechanism.states[index].transfer.T @ total[index]
    return tuple(total)


def joint_wrench(mechanism: Mechanism, index: int, total: ca.SX) -> ca.SX:
    """The wrench [force; moment] that a body's inboard joint carries, at the joint in its axes, 6 x 1."""
    return mechanism.states[index].bearing.T @ total[:6]


def generalised(mechanism: Mechanism, wrench: tuple[ca.SX, ...], acceleration: ca.SX) -> ca.SX:
    """Inverse dynamics from the wrenches: U_i^T w_i plus rotor inertia, rows as in the module docstring."""
    tree = mechanism.tree
    result = ca.SX(tree.rows, 1)
    if tree.free_base:
        result[:6] = wrench[0]
    for index in range(1, len(tree.bodies)):
        rows = tree.own(index)
        if rows:
            result[rows] = mechanism.states[index].hinge.T @ wrench[index]
    if tree.joints:
        result[tree.offset : tree.offset + len(tree.joints)] += mechanism.rotors @ acceleration
    return ca.densify(result)


def mass_matrix(mechanism: Mechanism) -> ca.SX:
    """Z = sum G_i^T M_i G_i by composite bodies, rows x rows, symmetric and positive definite."""
    tree, states = mechanism.tree, mechanism.states
    composite = [body_matrix(mechanism, index) for index in range(len(tree.bodies))]
    for index in range(len(composite) - 1, 0, -1):
        transfer, parent = states[index].transfer, tree.bodies[index].parent
        composite[parent] = composite[parent] + transfer.T @ composite[index] @ transfer
    result = ca.SX(tree.rows, tree.rows)
    for index in range(len(tree.bodies)):
        own = tree.own(index)
        if not own:
            continue
        force = composite[index] @ states[index].hinge
        result[own, own] = states[index].hinge.T @ force + mechanism.rotor(index)
        inboard = index
        while inboard != 0:  # carry the force of a unit acceleration inwards past every inboard joint
            force, inboard = states[inboard].transfer.T @ force, tree.bodies[inboard].parent
            rows = tree.own(inboard)
            if rows:
                block = states[inboard].hinge.T @ force
                result[rows, own], result[own, rows] = block, block.T
    if mechanism.is_coupled:
        joints = slice(tree.offset, tree.offset + len(tree.joints))
        result[joints, joints] += mechanism.rotors - ca.diag(ca.diag(mechanism.rotors))
    return ca.densify(result)


def solve_spd(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solution of a symmetric positive definite system, by a division or by L D L^T.

    The factors keep the zeros of the matrix: the modal block is diagonal.
    """
    if matrix.shape == (1, 1):
        return right / matrix
    diagonal, upper, order = ca.ldl(matrix)
    return ca.ldl_solve(ca.densify(right), diagonal, upper, order)


def forward_dynamics(mechanism: Mechanism, force: ca.SX, base_acceleration: ca.SX) -> ca.SX:
    """Accelerations by the articulated-body method, O(n); by Z ydd = z + f where rotors couple joints.

    Args:
        mechanism: tree, state and masses.
        force: generalised forces, rows as in the module docstring.
        base_acceleration: of a base that is not free, 6 x 1; ignored for a free base.

    Returns:
        Generalised accelerations; of a free base the inertial acceleration in base axes.
    """
    tree, states = mechanism.tree, mechanism.states
    if mechanism.is_coupled:
        return _by_elimination(mechanism, force, base_acceleration)
    inertia = [body_matrix(mechanism, index) for index in range(len(tree.bodies))]
    bias = [-applied(mechanism, index) for index in range(len(tree.bodies))]
    hinges: dict[int, _Hinge] = {}
    for index in range(len(inertia) - 1, 0, -1):
        state, parent = states[index], tree.bodies[index].parent
        seen, pushed = inertia[index], bias[index]
        if state.hinge.shape[1]:
            hinge = hinges[index] = _Hinge.of(mechanism, index, inertia[index], bias[index], force)
            seen = seen - hinge.lever @ hinge.response
            pushed = pushed + hinge.lever @ hinge.alone
        inertia[parent] = inertia[parent] + state.transfer.T @ seen @ state.transfer
        bias[parent] = bias[parent] + state.transfer.T @ (pushed + seen @ state.bias)
    moved = [solve_spd(inertia[0], force[:6] - bias[0]) if tree.free_base else base_acceleration]
    result = ca.SX(tree.rows, 1)
    if tree.free_base:
        result[:6] = moved[0]
    for index in range(1, len(tree.bodies)):
        state = states[index]
        value = state.transfer @ moved[tree.bodies[index].parent] + state.bias
        if index in hinges:
            own = hinges[index].alone - hinges[index].response @ value
            result[tree.own(index)] = own
            value = value + state.hinge @ own
        moved.append(value)
    return ca.densify(result)


def _by_elimination(mechanism: Mechanism, force: ca.SX, base_acceleration: ca.SX) -> ca.SX:
    """`forward_dynamics` from the full mass matrix: a rotor on several joints belongs to no single body."""
    tree = mechanism.tree
    count, base = len(tree.joints), ca.SX(6, 1) if tree.free_base else base_acceleration
    resting = ca.SX(count, 1)
    total = wrenches(mechanism, resting, base, ca.SX(tree.rows - tree.offset - count, 1))
    needed = generalised(mechanism, total, resting)
    return ca.densify(solve_spd(mass_matrix(mechanism), force - needed))


@dataclass(frozen=True)
class _Hinge:
    """A body's own coordinates with all outboard bodies; D = U^T I U plus rotors, I articulated.

    Attributes:
        lever: I U.
        response: D^-1 (I U)^T, how they follow the acceleration of the body.
        alone: D^-1 (f - U^T p), their acceleration at zero acceleration of the body's column.
    """

    lever: ca.SX
    response: ca.SX
    alone: ca.SX

    @classmethod
    def of(cls, mechanism: Mechanism, index: int, inertia: ca.SX, bias: ca.SX, force: ca.SX) -> _Hinge:
        """Of one body, from its articulated inertia and bias and the generalised forces."""
        columns = mechanism.states[index].hinge
        lever = inertia @ columns
        size = columns.T @ lever + mechanism.rotor(index)
        left = mechanism.own(index, force) - columns.T @ bias
        both = solve_spd(size, ca.horzcat(lever.T, left))
        return cls(lever, both[:, :-1], both[:, -1])

"""The minimal form of the equations of motion, ``-Z ydd + z + f = 0``, with explicit global matrices.

Jourdain's principle with the velocity columns of all bodies as functions of the independent coordinates,
v = G yd and vd = G ydd + g, gives ``Z = sum G_i^T M_i G_i`` and ``z = sum G_i^T (f_i - M_i g_i)`` (Liu, Li,
Wang, Cai, Aerospace Science and Technology 47 (2015) 164-176). The rows of G follow by recursion from the
base to the tips: G_ik = T_ij G_jk for coordinates of bodies inboard of i, G_ii = U_i, and g_i = T_ij g_j +
beta_i. It costs O(n^2) to O(n^3) where `reference_model.dynamics.equations` costs O(n); each tests the other.
"""

from __future__ import annotations

import casadi as ca

from reference_model.dynamics.equations import Mechanism, applied, body_matrix

__all__ = ["global_recursion", "minimal_form"]


def global_recursion(mechanism: Mechanism, base_acceleration: ca.SX) -> tuple[list[ca.SX], list[ca.SX]]:
    """G_i, (6 + s_i) x rows, and g_i, (6 + s_i) x 1, of every body.

    Args:
        mechanism: tree, state and masses.
        base_acceleration: of a base that is not free, inertial, in base axes, 6 x 1; ignored for a free one.
    """
    tree = mechanism.tree
    first = ca.SX(6, tree.rows)
    if tree.free_base:
        first[:, :6] = ca.SX.eye(6)
    matrices, columns = [first], [ca.SX(6, 1) if tree.free_base else base_acceleration]
    for index, (body, state) in enumerate(zip(tree.bodies[1:], mechanism.states[1:]), start=1):
        matrix = state.transfer @ matrices[body.parent]
        if tree.own(index):
            matrix[:, tree.own(index)] = state.hinge
        matrices.append(matrix)
        columns.append(state.transfer @ columns[body.parent] + state.bias)
    return matrices, columns


def minimal_form(mechanism: Mechanism, base_acceleration: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Z, rows x rows, and z, rows x 1; rotors on the joints included in Z.

    Args:
        mechanism: tree, state and masses.
        base_acceleration: of a base that is not free, 6 x 1; ignored for a free one.
    """
    matrices, columns = global_recursion(mechanism, base_acceleration)
    rows = mechanism.tree.rows
    matrix, forces = ca.SX(rows, rows), ca.SX(rows, 1)
    for index, (total, column) in enumerate(zip(matrices, columns)):
        mass = body_matrix(mechanism, index)
        matrix = matrix + total.T @ mass @ total
        forces = forces + total.T @ (applied(mechanism, index) - mass @ column)
    joints = slice(mechanism.tree.offset, mechanism.tree.offset + len(mechanism.tree.joints))
    matrix[joints, joints] += mechanism.rotors
    return ca.densify(matrix), ca.densify(forces)

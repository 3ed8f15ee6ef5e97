"""Momentum, energy, and the bearing loads of joints."""

from __future__ import annotations

import casadi as ca

from reference_model.dynamics.equations import Mechanism
from robot_model import Bearing

__all__ = [
    "LOADS",
    "bearing_load",
    "centre_of_mass",
    "elastic_energy",
    "kinetic_energy",
    "momentum",
    "potential_energy",
    "structural_loss",
]

#: Magnitudes of forces and moments are smoothed at zero over this value [N, N m], so that they have a
#: derivative where a load vanishes (a planar robot's bending moment is zero at all times). All larger
#: magnitudes are this much too small, which is the rounding error of loads of some kN.
LOAD_FLOOR = 1e-12

#: Rows of `bearing_load`, in order.
LOADS = ("radial_force", "axial_force", "bending_moment", "radial_sum")


def centre_of_mass(mechanism: Mechanism) -> tuple[ca.SX, ca.SX]:
    """Total mass [kg] and centre of mass in the inertial frame [m], 3 x 1."""
    mass, moment = ca.SX(1, 1), ca.SX(3, 1)
    for index, body in mechanism.masses.items():
        state = mechanism.states[index]
        mass += body.mass
        moment += body.mass * state.position + state.rotation @ body.first_moment
    return mass, moment / mass


def momentum(mechanism: Mechanism) -> tuple[ca.SX, ca.SX]:
    """Linear momentum [N s] and angular momentum about the centre of mass [N m s], inertial axes, 3 x 1.

    Wheels on board are in the latter.
    """
    linear, angular = ca.SX(3, 1), ca.SX(3, 1)
    for index, body in mechanism.masses.items():
        state = mechanism.states[index]
        column = body.matrix @ state.velocity
        force = state.rotation @ column[:3]
        linear += force
        angular += state.rotation @ column[3:6] + ca.cross(state.position, force)
    for index, spin in mechanism.outside.spins.items():
        angular += mechanism.states[index].rotation @ spin
    return linear, angular - ca.cross(centre_of_mass(mechanism)[1], linear)


def kinetic_energy(mechanism: Mechanism, velocity: ca.SX) -> ca.SX:
    """1/2 sum v_i^T M_i v_i plus the rotors' 1/2 qd^T R qd [J]."""
    energy = ca.dot(velocity, mechanism.rotors @ velocity) / 2
    for index, body in mechanism.masses.items():
        column = mechanism.states[index].velocity
        energy += ca.dot(column, body.matrix @ column) / 2
    return energy


def potential_energy(mechanism: Mechanism) -> ca.SX:
    """-sum m_i g . r_i of the centres of mass, zero at the inertial origin [J]."""
    energy = ca.SX(1, 1)
    for index, body in mechanism.masses.items():
        state = mechanism.states[index]
        moment = body.mass * state.position + state.rotation @ body.first_moment
        energy -= ca.dot(mechanism.gravity, moment)
    return energy


def elastic_energy(mechanism: Mechanism) -> ca.SX:
    """sum 1/2 x_i^T K_i x_i of the flexible bodies, plus the energy of springs outside the bodies [J]."""
    return sum((body.elastic for body in mechanism.masses.values()), start=mechanism.outside.stored)


def structural_loss(mechanism: Mechanism) -> ca.SX:
    """sum xd_i^T C_i xd_i, the power dissipated by damping of the deformation [W]."""
    return sum((body.loss for body in mechanism.masses.values()), start=ca.SX(1, 1))


def bearing_load(kind: str, axis: ca.SX, wrench: ca.SX, bearing: Bearing) -> ca.SX:
    """Load of a joint's bearing: the rows of `LOADS`, 4 x 1 [N, N, N m, N].

    For a revolute joint: F_r = |F - (F.H) H|, F_a = |F.H| and N_b = |N - (N.H) H|, H the axis, moments about
    the joint frame's origin, which is the middle of the bearings. The guide of a prismatic joint carries no
    force along its axis (the drive does) but the entire moment: |F - (F.H) H|, 0 and |N|.

    The radial sum is the factor of the radial arm: F_r + N_b/R_b, or with a span b the sum of the forces of
    two bearings, |F_r/2 + (H x N)/b| + |F_r/2 - (H x N)/b| as vectors. For a guide with a span the moment
    about its axis, which no pair of forces on the axis can carry, enters with R_b.
    """
    force, moment = wrench[:3], wrench[3:6]
    along, about = ca.dot(force, axis), ca.dot(moment, axis)
    radial = force - along * axis
    guide = kind == "prismatic"
    bending = _size(moment if guide else moment - about * axis)
    if bearing.span is None:
        total = _size(radial) + bending / bearing.bending_arm
    else:
        couple = ca.cross(axis, moment) / bearing.span
        total = _size(radial / 2 + couple) + _size(radial / 2 - couple)
        total += _size(about) / bearing.bending_arm if guide else 0
    return ca.vertcat(_size(radial), 0 if guide else _size(along), bending, total)


def _size(vector: ca.SX) -> ca.SX:
    return ca.sqrt(ca.sumsqr(vector) + LOAD_FLOOR**2) - LOAD_FLOOR

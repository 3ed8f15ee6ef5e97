"""Momentum, energy, and the loads a joint's bearing carries."""

from __future__ import annotations

import casadi as ca

from reference_model.dynamics import Mechanism

__all__ = ["bearing_load", "centre_of_mass", "kinetic_energy", "momentum", "potential_energy"]

#: Forces and moments are rounded off at zero over this size [N, N m], so that their magnitudes keep a
#: derivative where a load vanishes (a planar robot's bending moment is zero at all times).
LOAD_FLOOR = 1e-9


def centre_of_mass(mechanism: Mechanism) -> tuple[ca.SX, ca.SX]:
    """Total mass [kg] and centre of mass in the inertial frame [m], 3 x 1."""
    mass, moment = ca.SX(1, 1), ca.SX(3, 1)
    for index, body in mechanism.masses.items():
        state = mechanism.states[index]
        mass += body.mass
        moment += body.mass * state.position + state.rotation @ body.first_moment
    return mass, moment / mass


def momentum(mechanism: Mechanism) -> tuple[ca.SX, ca.SX]:
    """Linear momentum [N s] and angular momentum about the centre of mass [N m s], inertial axes, 3 x 1."""
    linear, angular = ca.SX(3, 1), ca.SX(3, 1)
    for index, body in mechanism.masses.items():
        state = mechanism.states[index]
        column = body.matrix @ state.velocity
        force = state.rotation @ column[:3]
        linear += force
        angular += state.rotation @ column[3:6] + ca.cross(state.position, force)
    return linear, angular - ca.cross(centre_of_mass(mechanism)[1], linear)


def kinetic_energy(mechanism: Mechanism, velocity: ca.SX) -> ca.SX:
    """1/2 sum v_i^T M_i v_i plus the rotors' 1/2 reflected qd^2 [J]."""
    energy = ca.dot(mechanism.reflected, velocity**2) / 2
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


def bearing_load(kind: str, axis: ca.SX, wrench: ca.SX) -> ca.SX:
    """What the bearing of a joint carries: radial force [N], axial force [N], bending moment [N m], 3 x 1.

    Of a revolute joint: |F - (F.H) H|, |F.H| and |N - (N.H) H|, H the axis, moments about the joint
    frame's origin. The guide of a prismatic joint carries no force along its axis (the drive does) but the
    whole moment: |F - (F.H) H|, 0 and |N|.
    """
    force, moment = wrench[:3], wrench[3:6]
    along = ca.dot(force, axis)
    if kind == "prismatic":
        return ca.vertcat(_size(force - along * axis), 0, _size(moment))
    return ca.vertcat(_size(force - along * axis), _size(along), _size(moment - ca.dot(moment, axis) * axis))


def _size(vector: ca.SX) -> ca.SX:
    return ca.sqrt(ca.sumsqr(vector) + LOAD_FLOOR**2) - LOAD_FLOOR

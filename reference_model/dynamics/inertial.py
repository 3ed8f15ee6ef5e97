"""Mass properties as one vector of parameters in which inverse dynamics is linear.

Per body ten parameters: mass [kg], first moment mass x centre of mass [kg m] and inertia about the frame's
origin [kg m^2], all in the body's frame (the barycentric form of Gautier, Khalil, ICRA 1990); then the
reflected rotor inertia of each drive, gear_ratio^2 x rotor_inertia [kg m^2 or kg], named after its joint or,
in a transmission, after its motor; then gravity [m/s^2]. For constant gravity the joint torques are linear in
all the others, and for constant masses linear in gravity. The ten parameters of a flexible link are those of
its rigid hub, fixed in the link's frame; the deformable part is constant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.dynamics.tree import Body, BodyState, Tree
from reference_model.flexible.motion_forces import deformed
from reference_model.kinematics.coupling import Coupling
from reference_model.kinematics.spatial import constant, skew
from robot_model import Inertial, Robot

__all__ = [
    "BODY_NUMBERS",
    "BodyMass",
    "body_names",
    "inertial_names",
    "mass_of",
    "masses",
    "nominal_inertial",
    "ten_numbers",
]

BODY_NUMBERS = (
    "mass",
    *(f"first_moment.{axis}" for axis in "xyz"),
    *(f"inertia.{pair}" for pair in ("xx", "yy", "zz", "xy", "xz", "yz")),
)


@dataclass(frozen=True)
class BodyMass:
    """Mass matrix of one body for its velocity column, and the forces that act on it.

    Attributes:
        matrix: M_i = [m 1, -(m c)~; (m c)~, J], 6 x 6, J about the frame's origin; of a flexible body
            (6 + s) x (6 + s) with the modal rows and columns.
        mass: m [kg].
        first_moment: m c [kg m], 3 x 1.
        weight: [m 1; m c~; (d(m c)/dx)^T], (6 + s) x 3: times gravity it is the force of gravity; the first
            columns of M.
        force: f_w + f_u: centrifugal and Coriolis forces, elastic forces and damping, (6 + s) x 1.
        elastic: energy of deformation [J].
        loss: xd^T C xd, the power dissipated by damping of the deformation [W].
    """

    matrix: ca.SX
    mass: ca.SX
    first_moment: ca.SX
    weight: ca.SX
    force: ca.SX
    elastic: ca.SX
    loss: ca.SX

    def plus(self, factor: ca.SX, other: BodyMass) -> BodyMass:
        """The sum with `factor` times another one."""
        return BodyMass(*(a + factor * b for a, b in zip(vars(self).values(), vars(other).values())))


def body_names(robot: Robot) -> tuple[str, ...]:
    """Bodies with inertial parameters, in their order: a free base first, then links in file order."""
    base = ("base",) if robot.base.kind == "free" else ()
    return (*base, *(link.name for link in robot.links))


def inertial_names(robot: Robot) -> tuple[str, ...]:
    """Names of all P parameters."""
    return (
        *(f"{body}.{number}" for body in body_names(robot) for number in BODY_NUMBERS),
        *(f"{drive.name}.reflected_inertia" for drive in robot.drives),
        *(f"gravity.{axis}" for axis in "xyz"),
    )


def ten_numbers(body: Inertial) -> NDArray[np.float64]:
    """The ten parameters of a body from mass, centre of mass and central inertia, shape (10,)."""
    c = np.asarray(body.center_of_mass)
    origin = body.inertia_matrix + body.mass * (c @ c * np.eye(3) - np.outer(c, c))  # Steiner
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return np.array([body.mass, *(body.mass * c), *(origin[pair] for pair in pairs)])


def nominal_inertial(robot: Robot) -> NDArray[np.float64]:
    """The description's values of all parameters, shape (P,)."""
    bodies = [robot.base if name == "base" else robot.link(name) for name in body_names(robot)]
    reflected = [drive.reflected_inertia for drive in robot.drives]
    return np.concatenate([*(ten_numbers(body) for body in bodies), reflected, robot.gravity])


def masses(
    robot: Robot, tree: Tree, states: Sequence[BodyState], inertial: ca.SX
) -> tuple[Mapping[int, BodyMass], ca.SX, ca.SX]:
    """The parameters as matrices.

    Args:
        robot: the description, for the order of the parameters.
        tree: of the same robot.
        states: result of `tree.recursion`.
        inertial: all parameters, P x 1; may be constants. Those of beams, where the tree has them, come
            before gravity.

    Returns:
        Mass of each body by its index in the tree (a fixed base has none), mass matrix of the rotors on the
        joints n x n, gravity 3 x 1.
    """
    place = {body.name: index for index, body in enumerate(tree.bodies)}
    names = body_names(robot)
    found = {}
    for k, name in enumerate(names):
        index, ten = place[name], inertial[10 * k : 10 * (k + 1)]
        found[index] = mass_of(tree.bodies[index], states[index], ten)
    start = 10 * len(names)
    count = len(tree.joints)
    rotors = Coupling(robot).inertia(inertial[start : start + count])
    at = start + count
    for index, body in enumerate(tree.bodies):
        for number in body.numbers:
            varied = mass_of(replace(body, flexible=number.change), states[index], ca.SX(10, 1))
            found[index] = found[index].plus(inertial[at] - number.value, varied)
            at += 1
    return found, rotors, inertial[at : at + 3]


def mass_of(body: Body, state: BodyState, ten: ca.SX) -> BodyMass:
    mass, moment, inertia = _hub(ten)
    omega, x, rate = state.velocity[3:6], state.modal, state.velocity[6:]
    flexible = body.flexible
    if flexible is None:
        turning = ca.vertcat(ca.cross(omega, ca.cross(omega, moment)), ca.cross(omega, inertia @ omega))
        matrix = ca.blockcat([[mass * ca.SX.eye(3), -skew(moment)], [skew(moment), inertia]])
        return BodyMass(matrix, mass, moment, matrix[:, :3], -turning, ca.SX(1, 1), ca.SX(1, 1))
    bent = deformed(flexible, x, mass, moment, inertia)
    stiffness, damping = constant(flexible.stiffness), constant(flexible.damping)
    elastic = ca.vertcat(ca.SX(6, 1), stiffness @ x + damping @ rate)
    return BodyMass(
        bent.matrix,
        bent.mass,
        bent.first_moment,
        bent.matrix[:, :3],
        bent.motion_force(omega, rate) - elastic,
        ca.dot(x, stiffness @ x) / 2,
        ca.dot(rate, damping @ rate),
    )


def _hub(ten: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Mass, first moment 3 x 1, inertia about the frame's origin 3 x 3."""
    xx, yy, zz, xy, xz, yz = (ten[k] for k in range(4, 10))
    inertia = ca.sparsify(ca.blockcat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return ten[0], ten[1:4], inertia

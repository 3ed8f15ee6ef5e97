"""Mass matrix and motion-dependent forces of one flexible body, from its constant integrals.

With v = [rd; omega; xd] in body axes the kinetic energy is 1/2 v^T M(x) v, where

    M = [ m 1   -mc~   M13 ]     mc  = mc0 + S0 x - e (x^T G x)/2
        [ mc~    J     M23 ]     M13 = d(mc)/dx
        [ sym.         M33 ]     J   = J0 - sum x_j (E_j + E_j^T) - sum x_j x_l F_jl + (x^T W x) e~ e~
                                 M23 = S1 + sum x_j D_j

(docs/theory.md 2). The terms with the axis e are those of a beam that stiffens: node k also moves by
-1/2 x^T B_k x along e, G = sum m_k B_k, W = sum m_k (rho0_k.e) B_k, all nodes on the axis; of their products
those of third order in x are omitted, so that M stays positive definite only while deflections are small
compared with the body. The equations of motion follow from this energy alone, by the Boltzmann-Hamel
equations in body axes,

    f_w = -( Mdot v + [ omega x p ; omega x L ; -1/2 d/dx v^T M v ] ),   [p; L; .] = M v,   rd = 0,

(with the inertial acceleration of the origin in place of d(rd)/dt no term with rd remains), so that
energy and momentum are conserved exactly, whatever is neglected in M. Written out that is
`Deformed.motion_force`.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from reference_model.flexible.body import FlexibleBody
from reference_model.kinematics.spatial import constant, skew

__all__ = ["Deformed", "deformed"]


@dataclass(frozen=True)
class Deformed:
    """A flexible body in its present shape.

    Attributes:
        body: its constants.
        modal: x, s x 1.
        mass: m [kg].
        first_moment: m c about the frame's origin [kg m], 3 x 1.
        inertia: J about the frame's origin [kg m^2], 3 x 3.
        change: d(m c)/dx, M13, 3 x s.
        products: K_j = E_j + sum_l x_l F_lj of every mode, 3 x 3 each.
    """

    body: FlexibleBody
    modal: ca.SX
    mass: ca.SX
    first_moment: ca.SX
    inertia: ca.SX
    change: ca.SX
    products: tuple[ca.SX, ...]

    @property
    def matrix(self) -> ca.SX:
        """M, (6 + s) x (6 + s)."""
        coupling = constant(self.body.S1)
        for j, part in enumerate(self.body.D):
            coupling += self.modal[j] * constant(part)
        return ca.blockcat(
            [
                [self.mass * ca.SX.eye(3), -skew(self.first_moment), self.change],
                [skew(self.first_moment), self.inertia, coupling],
                [self.change.T, coupling.T, constant(self.body.modal_mass)],
            ]
        )

    def motion_force(self, omega: ca.SX, rate: ca.SX) -> ca.SX:
        """f_w, (6 + s) x 1: centrifugal, Coriolis and gyroscopic forces at angular velocity and modal rates.

        f1 = -[om~ om~ mc + 2 om~ M13 xd + dM13/dt xd], f2 = -om~ J om + 2 sum_j xd_j K_j om - om~ P xd,
        f3_j = -om^T K_j om - 2 sum_l xd_l om.h_lj (docs/theory.md 2), and what foreshortening adds.
        """
        body = self.body
        turned = ca.horzcat(*(product @ omega for product in self.products))
        gyroscopic = ca.SX(3, body.count)
        for j, part in enumerate(body.D):
            gyroscopic += rate[j] * constant(part)  # its column j is sum_l xd_l h_lj
        force = -ca.cross(omega, ca.cross(omega, self.first_moment) + 2 * (self.change @ rate))
        moment = 2 * (turned @ rate) - ca.cross(omega, self.inertia @ omega + constant(body.P) @ rate)
        modal = -turned.T @ omega - 2 * (gyroscopic.T @ omega)
        column = ca.vertcat(force, moment, modal)
        return column if body.foreshortening is None else column + self._shortening(omega, rate)

    def _shortening(self, omega: ca.SX, rate: ca.SX) -> ca.SX:
        """Terms not in mc, M13 and J: -dM13/dt xd, -dJ/dt om, and 1/2 d/dx (om^T J om)."""
        shape, lever, axis = _shortening_moments(self.body)
        bent, across = lever @ self.modal, skew(axis) @ skew(axis) @ omega
        return ca.vertcat(
            axis * ca.dot(rate, shape @ rate),
            -2 * ca.dot(rate, bent) * across,
            bent * ca.dot(omega, across),
        )


def deformed(body: FlexibleBody, x: ca.SX, mass: ca.SX, first_moment: ca.SX, inertia: ca.SX) -> Deformed:
    """The body at modal coordinates x, with a rigid hub that is fixed in its frame.

    Args:
        body: constants without the hub.
        x: s x 1.
        mass, first_moment, inertia: of the hub, about the frame's origin [kg, kg m, kg m^2], 1, 3 x 1, 3 x 3.
    """
    change = constant(body.S0)
    moment = first_moment + constant(body.first_moment) + change @ x
    turned = inertia + constant(body.inertia)
    products = []
    for j in range(body.count):
        product = constant(body.E[j])
        for k in range(body.count):
            product += x[k] * constant(body.F[k, j])
        products.append(product)
        turned -= x[j] * (product + constant(body.E[j].T))  # sum_l x_l F_lj = K_j - E_j
    if body.foreshortening is not None:
        shape, lever, axis = _shortening_moments(body)
        moment -= axis * (ca.dot(x, shape @ x) / 2)
        change -= axis @ (x.T @ shape)
        turned += ca.dot(x, lever @ x) * (skew(axis) @ skew(axis))
    whole = ca.triu2symm(ca.triu(turned))  # symmetric but for the order of its sums
    return Deformed(body, x, mass + body.mass, moment, whole, change, tuple(products))


def _shortening_moments(body: FlexibleBody) -> tuple[ca.SX, ca.SX, ca.SX]:
    """G = sum m_k B_k, W = sum m_k (rho0_k.e) B_k, and the axis e."""
    assert body.foreshortening is not None
    assert body.axis is not None
    weighted = body.node_masses[:, None, None] * body.foreshortening
    lever = np.tensordot(body.nodes @ body.axis, weighted, axes=1)
    return constant(weighted.sum(axis=0)), constant(lever), constant(body.axis)

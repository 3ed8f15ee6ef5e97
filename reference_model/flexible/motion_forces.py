"""Mass matrix and motion-dependent forces of one flexible body, from its constant integrals.

With v = [rd; omega; xd] in body axes the kinetic energy is 1/2 v^T M(x) v, where

    M = [ m 1   -mc~   M13 ]     mc  = mc0 + S0 x - e (x^T G x)/2
        [ mc~    J     M23 ]     M13 = S0 - e x^T G
        [ sym.         M33 ]     J   = J0 - sum x_j (E_j + E_j^T) - sum x_j x_l F_jl + (w~ e~ + e~ w~)/2
                                 M23 = S1 + sum x_j D_j + e~ W x

(model.md 2.5). The terms with the axis e are those of a beam that stiffens: node k also moves by
-1/2 x^T B_k x along e, G = sum m_k B_k, W = sum m_k rho0_k B_k and w = x^T W x; of their products those of
third order in x are left out. The equations of motion follow from this energy alone, by the
Boltzmann-Hamel equations in body axes,

    f_w = -( Mdot v + [ omega x p ; omega x L ; -1/2 d/dx v^T M v ] ),   [p; L; .] = M v,   rd = 0,

(with the inertial acceleration of the origin in the place of d(rd)/dt no term with rd is left), so that
energy and momentum are conserved exactly, whatever was left out of M. For a body that does not stiffen it
is the closed form of model.md 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from reference_model.flexible.body import FlexibleBody
from reference_model.spatial import skew

__all__ = ["Inertia", "inertia_of", "motion_force"]


@dataclass(frozen=True)
class Inertia:
    """Mass properties of a body in its present shape.

    Attributes:
        matrix: M, (6 + s) x (6 + s).
        first_moment: m c about the frame's origin [kg m], 3 x 1.
        change: d(m c)/dx, M13, 3 x s.
    """

    matrix: ca.SX
    first_moment: ca.SX
    change: ca.SX


def inertia_of(body: FlexibleBody, x: ca.SX) -> Inertia:
    """M(x) of the body with its hub, as an expression of its modal coordinates, s x 1."""
    s = body.count
    change = _constant(body.S0)
    moment = _constant(body.first_moment) + change @ x
    inertia, coupling = _constant(body.inertia), _constant(body.S1)
    for j in range(s):
        inertia -= x[j] * _constant(body.E[j] + body.E[j].T)
        coupling += x[j] * _constant(body.D[j])
        for k in range(j + 1):
            pair = body.F[j, k] if j == k else body.F[j, k] + body.F[k, j]
            inertia -= x[j] * x[k] * _constant(pair)
    if body.axis is not None and body.foreshortening is not None:
        axis = _constant(body.axis)
        weighted = body.node_masses[:, None, None] * body.foreshortening
        shape = _constant(weighted.sum(axis=0))
        moments = [_constant(np.tensordot(body.nodes[:, a], weighted, axes=1)) @ x for a in range(3)]
        moment -= axis * (ca.dot(x, shape @ x) / 2)
        change -= axis @ (x.T @ shape)
        quadratic = skew(ca.vertcat(*(ca.dot(x, column) for column in moments)))
        inertia += (quadratic @ skew(axis) + skew(axis) @ quadratic) / 2
        coupling += skew(axis) @ ca.horzcat(*moments).T
    matrix = ca.blockcat(
        [
            [body.mass * ca.SX.eye(3), -skew(moment), change],
            [skew(moment), inertia, coupling],
            [change.T, coupling.T, _constant(body.modal_mass)],
        ]
    )
    return Inertia(matrix, moment, change)


def motion_force(body: FlexibleBody) -> ca.Function:
    """f_w of (x, omega, xd), (6 + s) x 1: centrifugal, Coriolis and gyroscopic forces, hub included."""
    x, omega, rate = ca.SX.sym("x", body.count), ca.SX.sym("omega", 3), ca.SX.sym("xd", body.count)
    column = ca.vertcat(ca.SX(3, 1), omega, rate)
    momentum = inertia_of(body, x).matrix @ column
    change = ca.jtimes(momentum, x, rate)
    energy = ca.dot(column, momentum) / 2
    rotating = ca.vertcat(
        ca.cross(omega, momentum[:3]), ca.cross(omega, momentum[3:6]), -ca.gradient(energy, x)
    )
    return ca.Function("motion_force", [x, omega, rate], [-(change + rotating)])


def _constant(array: object) -> ca.SX:
    return ca.sparsify(ca.SX(np.asarray(array, dtype=float)))

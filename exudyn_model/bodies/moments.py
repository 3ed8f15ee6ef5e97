"""Moments of a flexible link's masses, constant in its frame, and corrections to those of its points.

All displacements are affine in the modal coordinates x: with z = (1, x), ``rho = R z`` of every point, so
that every inertial sum is one of the constants ``sum m R`` and ``sum m R_p R_q^T``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from exudyn_model.bodies.rotation import cross, skew

__all__ = ["Moments", "Points", "Surplus", "axial", "moments_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Points:
    """Points with displacements only, whose motion is that of the body.

    Attributes:
        places: undeformed, in the link's frame [m], shape (K, 3).
        masses: between them, the same in all directions [kg], shape (K, K).
        modes: displacements per modal coordinate [1/sqrt(kg)], shape (K, 3, s).
    """

    places: Array
    masses: sparse.csr_array
    modes: Array


@dataclass(frozen=True, eq=False)
class Moments:
    """Constants of points.

    Attributes:
        mass: [kg].
        first: sum m R, shape (3, 1 + s): the first moment, then that of every mode.
        second: sum m R_p R_q^T, shape (1 + s, 1 + s, 3, 3).
    """

    mass: float
    first: Array
    second: Array

    @property
    def inertia(self) -> Array:
        """Of the undeformed points about the frame's origin [kg m^2], shape (3, 3)."""
        still = self.second[0, 0]
        found: Array = np.trace(still) * np.eye(3) - still
        return found

    @property
    def turning(self) -> Array:
        """Angular momentum about the frame's origin per modal rate, undeformed, shape (3, s)."""
        return axial(self.second[0, 1:]).T

    @property
    def modal(self) -> Array:
        """Mass matrix of the modal coordinates, shape (s, s)."""
        found: Array = np.einsum("jlaa->jl", self.second[1:, 1:])
        return found


def moments_of(points: Points) -> Moments:
    """The constants of these points."""
    every = np.concatenate([points.places[:, :, None], points.modes], axis=2)
    flat = every.reshape(len(every), -1)
    weighted = points.masses @ flat
    count = every.shape[2]
    second = (flat.T @ weighted).reshape(3, count, 3, count).transpose(1, 3, 0, 2)
    return Moments(float(points.masses.sum()), weighted.sum(axis=0).reshape(3, count), second)


def axial(moments: Array) -> Array:
    """Sum of a x b from the sum of a b^T, shapes (..., 3, 3) to (..., 3)."""
    m = moments
    return np.stack(
        [
            m[..., 1, 2] - m[..., 2, 1],
            m[..., 2, 0] - m[..., 0, 2],
            m[..., 0, 1] - m[..., 1, 0],
        ],
        axis=-1,
    )


@dataclass(frozen=True, eq=False)
class Surplus:
    """Inertia in addition to that of points with linear displacements, as a kinetic energy.

    With the velocity v and the angular velocity w of the frame in its own axes, this energy is half of
    (v, w, xd) M (v, w, xd). A beam that stiffens also moves node k by -1/2 x^T B_k x along its axis e, to
    second order in x: G = sum m_k B_k, W = sum m_k (rho_k.e) B_k, all nodes on the axis. A mass matrix
    that couples displacements with rotations adds first moments, inertia and modal couplings.

    Attributes:
        first: first moment [kg m], shape (3,).
        inertia: about the frame's origin [kg m^2], shape (3, 3).
        slide, turn: linear and angular momentum per modal rate, shape (3, s).
        modal: mass matrix of the modal coordinates, shape (s, s).
        axis: e, shape (3,).
        shortened, lever: G and W, shape (s, s).
    """

    first: Array
    inertia: Array
    slide: Array
    turn: Array
    modal: Array
    axis: Array
    shortened: Array
    lever: Array

    @classmethod
    def none(cls, count: int) -> Surplus:
        """Nothing, of so many modal coordinates."""
        row, square = np.zeros((3, count)), np.zeros((count, count))
        return cls(np.zeros(3), np.zeros((3, 3)), row, row, square, np.array([1.0, 0.0, 0.0]), square, square)

    def shortening(self, axis: Array, masses: Array, places: Array, shapes: Array) -> Surplus:
        """With masses m_k at places rho_k.e along the axis, and B_k, shape (K, s, s)."""
        weighted = masses[:, None, None] * shapes
        return replace(
            self,
            axis=axis,
            shortened=self.shortened + weighted.sum(axis=0),
            lever=self.lever + np.tensordot(places, weighted, axes=1),
        )

    def weight(self, x: Array) -> tuple[Array, Array]:
        """First moment at x [kg m], shape (3,), and its derivative by x, shape (3, s)."""
        bent = self.shortened @ x
        return (
            self.first + self.slide @ x - 0.5 * float(x @ bent) * self.axis,
            self.slide - np.outer(self.axis, bent),
        )

    def mass(self, x: Array) -> Array:
        """M, shape (6 + s, 6 + s)."""
        moment, change = self.weight(x)
        across = skew(self.axis)
        turned = self.inertia + float(x @ self.lever @ x) * across @ across
        cross_moment = skew(moment)
        return np.block(
            [
                [np.zeros((3, 3)), -cross_moment, change],
                [cross_moment, turned, self.turn],
                [change.T, self.turn.T, self.modal],
            ]
        )

    def force(self, omega: Array, x: Array, v: Array) -> Array:
        """Velocity-dependent forces, to be added to -M times accelerations, shape (6 + s,).

        From this kinetic energy by the equations of Boltzmann and Hamel in the frame's axes, with the
        inertial acceleration of its origin among the accelerations.
        """
        moment, change = self.weight(x)
        swept, bent = cross(self.axis, cross(self.axis, omega)), self.lever @ x
        rotating = self.inertia @ omega + float(x @ bent) * swept + self.turn @ v
        linear = float(v @ self.shortened @ v) * self.axis
        linear -= cross(omega, cross(omega, moment) + 2 * change @ v)
        angular = -cross(omega, rotating) - 2 * float(v @ bent) * swept
        return np.concatenate([linear, angular, float(omega @ swept) * bent])

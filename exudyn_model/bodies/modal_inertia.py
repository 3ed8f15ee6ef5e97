"""Inertia and forces of a bent link in its own frame, from the moments of its masses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.flexible_link import FlexibleLink
from exudyn_model.bodies.moments import axial, moments_of
from exudyn_model.bodies.rotation import cross, skew

__all__ = ["ModalInertia"]

Array = NDArray[np.float64]


class ModalInertia:
    """Of a flexible link without its hub, on [a; alpha; xdd] in its frame's axes.

    With z = (1, x) every point is at R z, and its acceleration beyond those is ``W R z + 2 w~ R zd`` with
    W = w~ w~: all sums are contractions of ``C = sum m R_p R_q^T``.
    """

    def __init__(self, link: FlexibleLink) -> None:
        self._link, self._moments = link, moments_of(link.points)
        self._stiffness = link.shapes.frequencies**2
        self._traces = np.einsum("jqaa->jq", self._moments.second[1:, 1:])

    def mass(self, x: Array) -> Array:
        """Shape (6 + s, 6 + s)."""
        moments, z = self._moments, np.concatenate([[1.0], x])
        at = np.tensordot(z, moments.second, axes=1)  # sum m rho R_q^T of every q
        second = np.tensordot(z, at, axes=1)
        first = skew(moments.first @ z)
        turning, slide = axial(at[1:]).T, moments.first[:, 1:]
        whole: Array = np.block(
            [
                [moments.mass * np.eye(3), -first, slide],
                [first, np.trace(second) * np.eye(3) - second, turning],
                [slide.T, turning.T, self._traces],
            ]
        )
        return whole if self._link.surplus is None else whole + self._link.surplus.mass(x)

    def force(self, omega: Array, x: Array, v: Array, gravity: Array) -> Array:
        """Weight, elastic, damping and velocity-dependent forces, shape (6 + s,).

        Args:
            omega: angular velocity of the frame in its axes [rad/s], shape (3,).
            x, v: modal coordinates and rates, shape (s,).
            gravity: in the frame's axes [m/s^2], shape (3,).
        """
        moments, surplus = self._moments, self._link.surplus
        z, rate = np.concatenate([[1.0], x]), np.concatenate([[0.0], v])
        spin = skew(omega)
        at = np.tensordot(z, moments.second, axes=1)
        # of the accelerations beyond: sums of m, of rho times them, of every mode times them
        linear = spin @ (spin @ (moments.first @ z) + 2 * moments.first @ rate)
        around = np.tensordot(z, at, axes=1) @ (spin @ spin).T + 2 * np.tensordot(rate, at, axes=1) @ spin.T
        bent = np.einsum("jab,ab->j", at[1:], spin @ spin)
        bent += 2 * np.einsum("jqab,q,ab->j", moments.second[1:], rate, spin)
        moment, slide = moments.first @ z, moments.first[:, 1:]
        if surplus is not None:
            more = surplus.weight(x)
            moment, slide = moment + more[0], slide + more[1]
        elastic = self._stiffness * x + self._link.damping @ v
        force = np.concatenate(
            [
                moments.mass * gravity - linear,
                cross(moment, gravity) - axial(around),
                slide.T @ gravity - bent - elastic,
            ]
        )
        return force if surplus is None else force + surplus.force(omega, x, v)

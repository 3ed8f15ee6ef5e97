"""Forces on bodies other than joint forces: a wall, a mount under the base, wheels on board.

All are functions of time and of the motion of one point of a body. Wheels keep no memory either: momentum
and angle of a rotor under motor torque and drag are known in closed form.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import expm1
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.rotation import cross

__all__ = ["Contact", "Mount", "PlacedMount", "PointMotion", "Push", "Wheels"]

Array = NDArray[np.float64]

#: Drag below which a rotor's closed form neglects it [1/s]: its influence over an hour is then negligible.
NO_DRAG = 1e-12


@dataclass(frozen=True)
class PointMotion:
    """A point of a body and axes that turn with the body.

    Attributes:
        time: [s].
        position: inertial frame [m], shape (3,).
        rotation: the axes to inertial ones, shape (3, 3).
        velocity, omega: inertial, in the axes at the point [m/s, rad/s], shape (3,).
    """

    time: float
    position: Array
    rotation: Array
    velocity: Array
    omega: Array


@dataclass(frozen=True)
class Push(ABC):
    """Base of the forces; parameters are the fields of the concrete class, in SI units."""

    #: Sits at a link; otherwise at the base.
    at_link: ClassVar[bool] = False

    @property
    def acts(self) -> bool:
        """Whether it has any influence."""
        return True

    @property
    def point(self) -> Array:
        """Point of action in the body's frame [m], shape (3,)."""
        return np.zeros(3)

    @abstractmethod
    def wrench(self, at: PointMotion) -> tuple[Array, Array]:
        """Force and moment about the point, in the axes at the point [N, N m]."""

    def energy(self, at: PointMotion) -> float:
        """Stored energy [J]."""
        return 0.0

    def spin(self, at: PointMotion) -> Array:
        """Angular momentum besides the body's, in the axes at the point [N m s], shape (3,)."""
        return np.zeros(3)


@dataclass(frozen=True)
class Contact(Push):
    """F = K d^1.5 max(1 + c dd/dt, 0) along n, d = max(offset - n.r, 0)."""

    at_link = True
    stiffness: float
    offset: float
    damping: float = 0.0
    normal_x: float = 0.0
    normal_y: float = 0.0
    normal_z: float = 1.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    @property
    def acts(self) -> bool:
        return self.stiffness > 0

    @property
    def point(self) -> Array:
        return np.array([self.x, self.y, self.z])

    def wrench(self, at: PointMotion) -> tuple[Array, Array]:
        normal = self._normal()
        depth = self._depth(at)
        if depth == 0.0:
            return np.zeros(3), np.zeros(3)
        own = at.rotation.T @ normal
        size = self.stiffness * depth**1.5 * max(1 - self.damping * float(own @ at.velocity), 0.0)
        return size * own, np.zeros(3)

    def energy(self, at: PointMotion) -> float:
        return 0.4 * self.stiffness * self._depth(at) ** 2.5

    def _normal(self) -> Array:
        normal = np.array([self.normal_x, self.normal_y, self.normal_z])
        unit: Array = normal / np.linalg.norm(normal)
        return unit

    def _depth(self, at: PointMotion) -> float:
        return max(self.offset - float(self._normal() @ at.position), 0.0)


@dataclass(frozen=True)
class Mount:
    """Springs and dampers from the ground to the base, in SI units; put in place, it is a `PlacedMount`."""

    compliance: float
    arm: float = 0.5
    damping: float = 1e-3
    mass: float = 0.0
    inertia: float = 0.0

    @property
    def acts(self) -> bool:
        """Whether the base is compliant."""
        return self.compliance > 0


@dataclass(frozen=True)
class PlacedMount(Push):
    """F = -(r - r0 + D v)/C and, rotated by angle about axis, N = -arm^2 (sin(angle) axis + D omega)/C.

    Attributes:
        mount: its parameters.
        home, home_rotation: of the base's frame at the start, shapes (3,) and (3, 3).
        force, moment: about the base's origin, that balance its initial load, inertial axes [N, N m],
            shape (3,) each.
    """

    mount: Mount
    home: Array
    home_rotation: Array
    force: Array
    moment: Array

    def wrench(self, at: PointMotion) -> tuple[Array, Array]:
        own, to_base = self.mount, at.rotation.T
        turned = self.home_rotation.T @ at.rotation
        sine = 0.5 * np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        )
        apart = to_base @ (at.position - self.home)
        force = -(apart + own.damping * at.velocity) / own.compliance
        moment = -(own.arm**2) * (sine + own.damping * at.omega) / own.compliance
        return force + to_base @ self.force, moment + to_base @ self.moment

    def energy(self, at: PointMotion) -> float:
        apart = at.position - self.home
        cosine = 0.5 * (float(np.trace(self.home_rotation.T @ at.rotation)) - 1)
        return (0.5 * float(apart @ apart) + self.mount.arm**2 * (1 - cosine)) / self.mount.compliance


@dataclass(frozen=True)
class Wheels(Push):
    """Rotors about the base's axes: hd = torque - drag h; on the base -omega x h - hd and their shaking."""

    momentum_x: float = 0.0
    momentum_y: float = 0.0
    momentum_z: float = 0.0
    torque_x: float = 0.0
    torque_y: float = 0.0
    torque_z: float = 0.0
    drag: float = 0.0
    imbalance: float = 0.0
    rotor_inertia: float = 0.01

    @property
    def acts(self) -> bool:
        return bool(self._start.any() or self._torque.any())

    @property
    def _start(self) -> Array:
        return np.array([self.momentum_x, self.momentum_y, self.momentum_z])

    @property
    def _torque(self) -> Array:
        return np.array([self.torque_x, self.torque_y, self.torque_z])

    def _momentum(self, time: float) -> Array:
        if self.drag < NO_DRAG:
            return self._start + self._torque * time
        settled = self._torque / self.drag
        found: Array = self._start + (self._start - settled) * expm1(-self.drag * time)
        return found

    def _angle(self, time: float) -> Array:
        """Integral of the momenta over the rotors' inertia [rad]."""
        if self.drag < NO_DRAG:
            return (self._start * time + 0.5 * self._torque * time**2) / self.rotor_inertia
        settled = self._torque / self.drag
        fading = -expm1(-self.drag * time) / self.drag
        found: Array = (settled * time + (self._start - settled) * fading) / self.rotor_inertia
        return found

    def wrench(self, at: PointMotion) -> tuple[Array, Array]:
        momentum = self._momentum(at.time)
        moment = -cross(at.omega, momentum) - (self._torque - self.drag * momentum)
        if self.imbalance == 0.0:
            return np.zeros(3), moment
        sizes = self.imbalance * (momentum / self.rotor_inertia) ** 2
        angle = self._angle(at.time)
        # Rotor x shakes along y and z, rotor y along z and x, rotor z along x and y.
        return np.roll(sizes * np.cos(angle), 1) + np.roll(sizes * np.sin(angle), 2), moment

    def spin(self, at: PointMotion) -> Array:
        return self._momentum(at.time)

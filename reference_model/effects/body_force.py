"""The interface of effects that apply a force to a body from outside, or from a device on board."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import Effect, Values
from robot_model import Robot

__all__ = ["BodySight", "BodySignals", "ForceEffect"]


@dataclass(frozen=True)
class BodySignals:
    """Motion of the point at which a force acts, as expressions.

    Attributes:
        time: [s].
        position: in the inertial frame [m], 3 x 1.
        rotation: from the axes at the point, which rotate with the body, to inertial ones, 3 x 3.
        velocity: inertial, [linear; angular] in the axes at the point [m/s, rad/s], 6 x 1.
        home, home_rotation: position and rotation of the base's frame at the start, shapes (3,) and (3, 3).
    """

    time: ca.SX
    position: ca.SX
    rotation: ca.SX
    velocity: ca.SX
    home: NDArray[np.float64]
    home_rotation: NDArray[np.float64]


@dataclass(frozen=True)
class BodySight:
    """Motion of a rigid link in the recordings with the joints' residual forces; K samples, n joints.

    Attributes:
        position: of the link's frame in the inertial one [m], shape (K, 3).
        rotation: from the link's axes to inertial ones, shape (K, 3, 3).
        spread: force at the joints of each component of a wrench [force; moment] about the frame's origin in
            the link's axes, shape (K, n, 6).
        left: residual force at the joints, whitened like `spread`, shape (K, n).
        points: points of the link that may make contact, in its frame [m], shape (Q, 3).
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    spread: NDArray[np.float64]
    left: NDArray[np.float64]
    points: NDArray[np.float64]


class ForceEffect(Effect):
    """Applies a force to a body at a point of it.

    The motion of a base or flexible link that it causes is not recorded with the joints' motion.
    """

    along_motion = False
    #: Number of internal states.
    states: ClassVar[int] = 0
    #: It also balances, with a constant wrench, the load on its body at the start.
    carries_start: ClassVar[bool] = False

    @property
    def is_searched(self) -> bool:
        return self.along_base or self.along_link

    #: Parameters that a robot file states and that a recording has to determine.
    located: ClassVar[tuple[str, ...]] = ()

    def starts_along(self, sight: BodySight) -> Sequence[tuple[float, Mapping[str, float]]]:
        """Starting values for a link, best first, each with the fraction of squared forces it explains."""
        return ()

    def limits(self, robot: Robot, at: str) -> Mapping[str, tuple[float, float]]:
        """Bounds of parameters narrower than the catalogue's for this robot or its torques."""
        return {}

    @abstractmethod
    def wrench(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        """[force; moment] on the body about the point, in the axes at the point [N, N m], 6 x 1."""

    def acts(self, p: Mapping[str, float]) -> bool:
        """Whether it has any influence with these parameters."""
        return True

    def point(self, p: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        """Point of action in the body's frame [m]; on a flexible link the nearest node is used."""
        return (0.0, 0.0, 0.0)

    def state_rate(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        """Time derivative of `z`."""
        return ca.SX(0, 1)

    def initial_state(self, p: Mapping[str, float]) -> tuple[float, ...]:
        """`z` at time 0."""
        return (0.0,) * self.states

    def spin(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        """Angular momentum on board in addition to the body's, in the axes at the point [N m s], 3 x 1."""
        return ca.SX(3, 1)

    def stored(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        """Energy that the effect stores [J]."""
        return ca.SX(1, 1)

    def power(self, s: BodySignals, p: Values, z: ca.SX) -> ca.SX:
        """Power delivered to the body and to the stored energy [W]; negative where it dissipates."""
        return ca.dot(self.wrench(s, p, z), s.velocity)

    def fastest(self, p: Mapping[str, float], mass: float) -> float:
        """Upper bound of the natural frequency of a body of this mass on it [rad/s]; 0 for none."""
        return 0.0

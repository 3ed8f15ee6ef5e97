"""Temperatures of joints: constant, along a table, or of a heat capacity that friction warms.

C dT/dt = P - (T - T_ambient)/R with P = -T_friction qd; see `robot_model.SelfHeating`.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from robot_model import ConstantTemperature, Robot, SelfHeating, TemperatureTable

__all__ = ["AMBIENT_TEMPERATURE", "Temperatures"]

#: Default joint temperature, 20 degrees Celsius [K].
AMBIENT_TEMPERATURE = 293.15


class Temperatures:
    """Temperatures of all moving joints of a robot; those with self-heating are states.

    Attributes:
        states: number of them, in the order of the joints.
    """

    def __init__(self, robot: Robot) -> None:
        kinds = [joint.thermal.temperature if joint.thermal else None for joint in robot.moving_joints]
        self._kinds = kinds
        self._heated = [k for k, kind in enumerate(kinds) if isinstance(kind, SelfHeating)]
        self.states = len(self._heated)

    def at(self, time: ca.SX, states: ca.SX) -> ca.SX:
        """Temperatures [K], n x 1.

        Args:
            time: [s].
            states: temperatures of the joints with self-heating [K].
        """
        column = []
        for k, kind in enumerate(self._kinds):
            if isinstance(kind, ConstantTemperature):
                column.append(ca.SX(kind.value))
            elif isinstance(kind, TemperatureTable):
                held = ca.fmax(kind.times[0], ca.fmin(kind.times[-1], time))
                column.append(ca.pw_lin(held, ca.DM(kind.times), ca.DM(kind.values)))
            elif isinstance(kind, SelfHeating):
                column.append(states[self._heated.index(k)])
            else:
                column.append(ca.SX(AMBIENT_TEMPERATURE))
        return ca.vertcat(*column)

    def rates(self, states: ca.SX, friction: ca.SX, velocity: ca.SX) -> ca.SX:
        """Time derivatives of the states [K/s].

        Args:
            states: as in `at`.
            friction: at the joints [N m or N], n x 1.
            velocity: of the joints [rad/s or m/s], n x 1.
        """
        found = ca.SX(self.states, 1)
        for row, k in enumerate(self._heated):
            kind = self._kinds[k]
            assert isinstance(kind, SelfHeating)
            cooled = (states[row] - kind.ambient) / kind.resistance
            found[row] = (-friction[k] * velocity[k] - cooled) / kind.capacity
        return found

    @property
    def initial(self) -> np.ndarray:
        """The states at time 0 [K], shape (states,)."""
        heated = [kind for kind in self._kinds if isinstance(kind, SelfHeating)]
        return np.array([kind.ambient if kind.initial is None else kind.initial for kind in heated])

"""Heat from friction and the windings' resistance, by the trapezoidal rule over accepted steps."""

from __future__ import annotations

from collections.abc import Sequence

from exudyn_model.control.base import JointState
from robot_model import Actuator, Robot

__all__ = ["LOSSES", "Losses", "has_winding"]

#: Rows of every joint, in order: power [W] and energy since the start [J].
LOSSES = ("friction_power", "armature_power", "friction_energy", "armature_energy")


class Losses:
    """Of all moving joints of a robot."""

    def __init__(self, robot: Robot) -> None:
        self._gains = [_gain(drive.actuator) for drive in robot.drives]
        count = len(self._gains)
        self._time, self._power = 0.0, ([0.0] * count, [0.0] * count)
        self._energy = ([0.0] * count, [0.0] * count)

    def begin(self, state: JointState, command: Sequence[float], friction: Sequence[float]) -> None:
        """Powers after an instant at which they may jump."""
        self._time, self._power = state.time, self._powers(state, command, friction)

    def accept(self, state: JointState, command: Sequence[float], friction: Sequence[float]) -> None:
        """Powers at an accepted instant."""
        half, later = 0.5 * (state.time - self._time), self._powers(state, command, friction)
        for energy, before, after in zip(self._energy, self._power, later):
            for k, (first, second) in enumerate(zip(before, after)):
                energy[k] += half * (first + second)
        self._time, self._power = state.time, later

    def row(self) -> list[float]:
        """`LOSSES` of the first joint, then of the second, and so on."""
        return [value for four in zip(*self._power, *self._energy) for value in four]

    def _powers(
        self, state: JointState, command: Sequence[float], friction: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        rubbed = [-force * v for force, v in zip(friction, state.velocity)]
        return rubbed, [gain * torque * torque for gain, torque in zip(self._gains, command)]


def has_winding(actuator: Actuator | None) -> bool:
    """Its current and its resistance are known."""
    return bool(actuator and actuator.torque_constant and actuator.resistance)


def _gain(actuator: Actuator | None) -> float:
    """R/(n k_t)^2 [W/(N m)^2 or W/N^2]."""
    if actuator is None or actuator.torque_constant is None or actuator.resistance is None:
        return 0.0
    return actuator.resistance / (actuator.gear_ratio * actuator.torque_constant) ** 2

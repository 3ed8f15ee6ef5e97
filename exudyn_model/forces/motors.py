"""Laws at motors of transmissions: functions of the motor's motion that act on it or on its joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.control.base import JointState
from exudyn_model.effects.base import Instant, JointLaw, Memory
from exudyn_model.effects.friction import ViscousFriction
from exudyn_model.forces.acting import Remembered

__all__ = ["MotorLaws"]

#: Order of evaluation: later laws may depend on the friction of earlier ones.
ORDER = ("friction", "modifier", "drive", "load")


class MotorLaws:
    """The laws at all motors of transmissions, each with the friction inside the motor.

    Args:
        coupling: the robot's transmissions.
        laws: by the motor's index among the drives.
        inside: dry and viscous friction of every drive's motor [N m or N, and per speed].
        apart: index of a motor with its own coordinate to its index among those.
    """

    def __init__(
        self,
        coupling: Transmissions,
        laws: Mapping[int, Sequence[JointLaw]],
        inside: Sequence[tuple[float, float]],
        apart: Mapping[int, int],
    ) -> None:
        self._coupling, self._inside, self._apart = coupling, inside, apart
        self.laws = {
            k: sorted(laws.get(k, ()), key=lambda law: ORDER.index(law.role))
            for k in coupling.motors.values()
        }

    @property
    def dry(self) -> tuple[int, ...]:
        """Drives whose friction jumps at a reversal."""
        return tuple(
            k
            for k, own in self.laws.items()
            if self._inside[k][0]
            or any(law.role == "friction" and not isinstance(law, ViscousFriction) for law in own)
        )

    def initial(
        self, state: JointState, command: Sequence[float], last: Remembered
    ) -> dict[int, list[Memory]]:
        """Initial memories, by drive; `command` is that of the drives [N m or N]."""
        found = {}
        for k, own in self.laws.items():
            now = self._instant(state, k, command[k], last)
            found[k] = [law.initial(now) if law.remembers else () for law in own]
        return found

    def add(
        self,
        state: JointState,
        command: Sequence[float],
        last: Remembered,
        motors: list[float],
        total: list[float],
        friction: list[float],
    ) -> dict[int, list[Memory]]:
        """Add the laws' forces to separate `motors`, and to `total` and `friction` of joints.

        Returns the laws' memories, by drive.
        """
        behind, taken = [0.0] * len(command), [0.0] * len(command)
        remembered: dict[int, list[Memory]] = {}
        for k, own in self.laws.items():
            now = self._instant(state, k, command[k], last)
            dry, wet = self._inside[k]
            rubbed = acting = -(dry * now.sign + wet * now.velocity)
            remembered[k] = []
            for law, memory in zip(own, last.at_motors.get(k, [()] * len(own))):
                force, kept = law.advance(now, memory)
                remembered[k].append(kept)
                acting += force
                now.friction += force if law.role == "friction" else 0.0
                rubbed += force if law.role in ("friction", "modifier") else 0.0
            if k in self._apart:
                motors[self._apart[k]] += acting
            else:
                behind[k], taken[k] = acting, rubbed
        for sums, part in ((total, behind), (friction, taken)) if remembered else ():
            for k, more in enumerate(self._coupling.forces_on_joints(part)):
                sums[k] += more
        return remembered

    def _instant(self, state: JointState, k: int, command: float, last: Remembered) -> Instant:
        """Signals of laws at a motor; bearings and temperatures are of joints."""
        if k in self._apart:
            i = self._apart[k]
            position, velocity, before = (
                values[i] for values in (state.motor_position, state.motor_velocity, last.motor_velocity)
            )
        else:
            position, velocity, before = (
                self._coupling.to_motors(values)[k]
                for values in (state.position, state.velocity, last.velocity)
            )
        elapsed = state.time - last.time
        return Instant(state.time, elapsed, position, velocity, command, 0.0, before, last.command[k])

"""All forces on the joint coordinates: controller, limits, and the laws of the robot's effects.

Exudyn asks for forces at trial states during its iterations; an accepted step is told by `accept`. Only
`accept` changes what is remembered (bristles, lags, integrals, held outputs), so the forces at a trial
state are a pure function of it, and the numerical Jacobian sees the memory's dependence on the state too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from exudyn_model.control import ControlLaw, JointState
from exudyn_model.effects.base import Instant, JointLaw, Memory
from exudyn_model.extra import ArmInstant, ExtraForce
from robot_model import Robot

__all__ = ["Forces", "JointForces"]

#: Relative to the sample time: how near to a tick an instant counts as on it (rounding of the step sizes).
TICK_TOLERANCE = 1e-6


@dataclass(slots=True)
class JointForces:
    """Forces at one instant, per moving joint in the order of the file [N m or N].

    Attributes:
        command: commanded actuator torque, within the actuator's limit.
        friction: of the friction laws and their modifiers.
        total: everything that acts on the coordinate.
        wrench: of the controller on a held base, force and moment about its origin in base axes [N, N m];
            empty otherwise.
    """

    command: list[float]
    friction: list[float]
    total: list[float]
    wrench: list[float] = field(default_factory=list)


class _Memory:
    """What was true at the last accepted instant."""

    def __init__(self, joints: int) -> None:
        self.time = 0.0
        self.velocity = [0.0] * joints
        self.command = [0.0] * joints
        self.errors = [0.0] * joints
        self.integral = [0.0] * joints
        self.output: list[float] | None = None
        self.loads = [0.0] * joints
        self.laws: list[list[Memory]] = [[] for _ in range(joints)]
        self.extra: list[Memory] = []


class Forces:
    """Forces on the joints of one run; `laws` per moving joint, modifiers after friction laws."""

    def __init__(
        self,
        robot: Robot,
        control: ControlLaw,
        laws: Sequence[Sequence[JointLaw]],
        extra: Sequence[ExtraForce] = (),
    ) -> None:
        self._control, self._extra = control, tuple(extra)
        order = ("friction", "modifier", "drive", "load")
        self._laws = [sorted(own, key=lambda law: order.index(law.role)) for own in laws]
        actuators = [joint.actuator for joint in robot.moving_joints]
        self._limits = [a.torque_limit if a and a.torque_limit else None for a in actuators]
        self._passive = [a is None for a in actuators]
        self._memory = _Memory(len(laws))
        self._ticks = 0
        self.holds_base = control.holds_base
        #: Some law depends on what the bearings carry.
        self.needs_loads = any(law.needs_load for own in laws for law in own)

    @property
    def remembers(self) -> bool:
        """Some force depends on more than the present state: a bristle, a lag, an integral."""
        laws = any(law.remembers for own in self._laws for law in own)
        return laws or bool(self._extra) or (self._control.integrates and self._control.sample_time == 0)

    @property
    def next_tick(self) -> float | None:
        """When a digital controller computes next [s]; None for a continuous one."""
        sample_time = self._control.sample_time
        return self._ticks * sample_time if sample_time > 0 else None

    def start(self, state: JointState) -> JointForces:
        """Forces at the initial state, from which everything remembered begins."""
        memory = self._memory
        memory.time, memory.velocity = state.time, list(state.velocity)
        memory.errors = self._control.errors(state)
        if self._control.sample_time > 0:
            self._tick(state)
        memory.command = self._command(state)
        for k, own in enumerate(self._laws):
            now = self._instant(state, k, memory.command[k])
            memory.laws[k] = [law.initial(now) if law.remembers else () for law in own]
        whole = self._arm_instant(state, memory.command)
        memory.extra = [force.initial(whole) for force in self._extra]
        return self.at(state)

    def at(self, state: JointState) -> JointForces:
        """Forces at a trial state."""
        return self._evaluate(state)[0]

    def voltage(self, state: JointState) -> list[float] | None:
        """Winding voltages of a voltage drive at a state [V], else None."""
        return self._control.voltage(self._output(state))

    def accept(self, state: JointState) -> list[float] | None:
        """Remember this state; gives the jump of the total forces if a digital controller computes here."""
        forces, laws, extra = self._evaluate(state)
        memory = self._memory
        if self._control.integrates and self._control.sample_time == 0:
            memory.integral = self._integral(state)
            memory.errors = self._control.errors(state)
        memory.time, memory.velocity = state.time, list(state.velocity)
        memory.command, memory.laws, memory.extra = forces.command, laws, extra
        memory.loads = list(state.loads) or memory.loads
        tick = self.next_tick
        if tick is None or state.time < tick - TICK_TOLERANCE * self._control.sample_time:
            return None
        self._tick(state)
        after = self.at(state)
        memory.command = after.command
        return [new - old for new, old in zip(after.total, forces.total)]

    def _tick(self, state: JointState) -> None:
        """A digital controller computes: rectangle rule for the integral, errors up to now included."""
        memory, period = self._memory, self._control.sample_time
        errors = self._control.errors(state)
        memory.integral = [total + period * e for total, e in zip(memory.integral, errors)]
        memory.output = self._control.output(state, memory.integral)
        self._ticks += 1

    def _integral(self, state: JointState) -> list[float]:
        """Trapezoidal rule from the last accepted instant."""
        memory, half = self._memory, 0.5 * (state.time - self._memory.time)
        errors = self._control.errors(state)
        return [i + half * (last + e) for i, last, e in zip(memory.integral, memory.errors, errors)]

    def _output(self, state: JointState) -> list[float]:
        memory, control = self._memory, self._control
        if memory.output is not None:
            return memory.output
        return control.output(state, self._integral(state) if control.integrates else memory.integral)

    def _command(self, state: JointState) -> list[float]:
        torques = self._control.torque(self._output(state), state)
        for k, limit in enumerate(self._limits):
            if self._passive[k]:
                torques[k] = 0.0
            elif limit is not None and abs(torques[k]) > limit:
                torques[k] = limit if torques[k] > 0 else -limit
        return torques

    def _instant(self, state: JointState, k: int, command: float) -> Instant:
        memory = self._memory
        return Instant(
            state.time,
            state.time - memory.time,
            state.position[k],
            state.velocity[k],
            command,
            0.0,
            memory.velocity[k],
            memory.command[k],
            state.loads[k] if state.loads else 0.0,
            memory.loads[k],
        )

    def _arm_instant(self, state: JointState, command: list[float]) -> ArmInstant:
        memory = self._memory
        return ArmInstant(
            state.time,
            state.time - memory.time,
            state.position,
            state.velocity,
            command,
            memory.velocity,
            memory.command,
        )

    def _evaluate(self, state: JointState) -> tuple[JointForces, list[list[Memory]], list[Memory]]:
        command = self._command(state)
        friction = [0.0] * len(command)
        total = list(command)
        remembered: list[list[Memory]] = []
        for k, own in enumerate(self._laws):
            now = self._instant(state, k, command[k])
            kept: list[Memory] = []
            for law, memory in zip(own, self._memory.laws[k]):
                force, memory = law.advance(now, memory) if law.remembers else (law.force(now), memory)
                kept.append(memory)
                total[k] += force
                if law.role == "friction":
                    now.friction += force
                if law.role in ("friction", "modifier"):
                    friction[k] += force
            remembered.append(kept)
        extra: list[Memory] = []
        for arm_force, memory in zip(self._extra, self._memory.extra):
            added, memory = arm_force.advance(self._arm_instant(state, command), memory)
            extra.append(memory)
            total = [before + more for before, more in zip(total, added)]
        wrench = self._control.wrench(self._output(state))
        return JointForces(command, friction, total, wrench), remembered, extra

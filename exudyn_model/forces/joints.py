"""All forces on the joint coordinates: controller, limits, and the laws of the robot's effects.

Exudyn evaluates forces at trial states during its iterations; an accepted step is reported by `accept`. Only
`accept` changes the memory (bristles, lags, integrals, held outputs), so the forces at a trial state are a
pure function of it, and the numerical Jacobian includes the memory's dependence on the state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.control.laws import ControlLaw, JointState
from exudyn_model.effects.base import Instant, JointLaw, Memory
from exudyn_model.effects.clearance import loose_bearings
from exudyn_model.effects.gear import Gear
from exudyn_model.effects.losses import Losses
from exudyn_model.effects.thermal import Warmth
from exudyn_model.forces.acting import JointForces, LawMemories, Remembered, Stopping
from exudyn_model.forces.extra import ArmInstant, ExtraForce
from exudyn_model.forces.motors import MotorLaws
from robot_model import Robot

__all__ = ["Forces", "JointForces", "Stopping"]

#: Tolerance for an instant at a controller tick, relative to the sample time (rounding of the step sizes).
TICK_TOLERANCE = 1e-6


class Forces:
    """Forces on the joints of one run; `laws` per moving joint, modifiers after friction laws.

    Where a motor has its own coordinate (`gears`, by drive), laws of the drive act on it and depend on its
    motion; all others act on the joint. The controller reads its encoder when `reads_motors`. Laws
    `at_motors` of transmissions, by drive, depend on their motor and act on it, or on the joints through the
    transmission.
    """

    def __init__(
        self,
        robot: Robot,
        control: ControlLaw,
        laws: Sequence[Sequence[JointLaw]],
        extra: Sequence[ExtraForce] = (),
        gears: Mapping[int, Gear] | None = None,
        at_motors: Mapping[int, Sequence[JointLaw]] | None = None,
    ) -> None:
        self._coupling = Transmissions(robot)
        self._control, self._extra = control, tuple(extra)
        self.gears = dict(gears or {})
        self._motor = {k: i for i, k in enumerate(self.gears)}
        self._reads_motors = getattr(robot.controller, "feedback", "motor") == "motor"
        self._views: tuple[JointState | None, JointState | None] = (None, None)
        order = ("friction", "modifier", "drive", "load")
        self._laws = [sorted(own, key=lambda law: order.index(law.role)) for own in laws]
        actuators = [drive.actuator for drive in robot.drives]
        self._limits = [a.torque_limit if a and a.torque_limit else None for a in actuators]
        self._passive = [a is None for a in actuators]
        self._rubbing = [(a.coulomb_friction, a.viscous_friction) if a else (0.0, 0.0) for a in actuators]
        self._memory = Remembered(len(laws))
        self._at_motors = MotorLaws(self._coupling, at_motors or {}, self._rubbing, self._motor)
        #: Motors of transmissions whose friction jumps at a reversal.
        self.dry_motors = tuple(robot.drives[k].name for k in self._at_motors.dry)
        self._stopping: Stopping | None = None
        self._bearings, self._losses = loose_bearings(robot), Losses(robot)
        self._warmth = [Warmth(joint) for joint in robot.moving_joints]
        self._ticks = 0
        self.holds_base = control.holds_base
        #: The controller's output changes strongly within a step of the solver.
        self.stiff_control = control.stiff
        #: The controller's model has spherical joints or bent links; of the latter these.
        self.needs_inner, self.bent_links = control.needs_inner, control.bent_links
        #: Some law depends on bearing loads.
        self.needs_loads = any(law.needs_load for own in laws for law in own)

    @property
    def remembers(self) -> bool:
        """Some force depends on more than the present state: a bristle, a lag, an integral, a gear."""
        laws = any(law.remembers for own in (*self._laws, *self._at_motors.laws.values()) for law in own)
        laws = laws or any(gear.friction for gear in self.gears.values())
        laws = laws or bool(self._bearings) or any(warmth.own for warmth in self._warmth)
        return laws or bool(self._extra) or self._control.integrates or self._control.remembers

    @property
    def next_tick(self) -> float | None:
        """Next tick of a digital controller [s]; None for a continuous one."""
        sample_time = self._control.sample_time
        return self._ticks * sample_time if sample_time > 0 else None

    def start(self, state: JointState) -> JointForces:
        """Forces at the initial state, at which all memories start."""
        memory = self._memory
        memory.time, memory.velocity = state.time, list(state.velocity)
        memory.motor_velocity = list(state.motor_velocity)
        memory.errors = self._control.errors(self._read(state))
        if self._control.sample_time > 0:
            self._tick(state)
        self._control.begin(self._read(state), self._output(state))
        memory.command = self._command(self._output(state), state)
        at_joints = self._coupling.forces_on_joints(memory.command)
        for k, own in enumerate(self._laws):
            now = self._instant(state, k, at_joints[k])
            memory.laws[k] = [law.initial(now) if law.remembers else () for law in own]
        memory.at_motors = self._at_motors.initial(state, memory.command, memory)
        whole = self._arm_instant(state, at_joints)
        memory.extra = [force.initial(whole) for force in self._extra]
        forces = self.at(state)
        for k, warmth in enumerate(self._warmth):
            warmth.begin(state.time, -forces.rubbing[k] * state.velocity[k])
        self._losses.begin(state, forces.command, forces.friction)
        return forces

    def settle(self, state: JointState) -> list[float]:
        """Initial positions of motors with their own coordinate, under the first command at a state.

        `state` has none; their gears start from here.
        """
        if not self.gears:
            return []
        begun = [self._coupling.to_motors(part) for part in (state.position, state.velocity)]
        positions, speeds = ([part[k] for k in self.gears] for part in begun)
        along = replace(state, motor_position=positions, motor_velocity=speeds)
        output = self._control.output(self._read(along), [0.0] * len(self._passive))
        torques = self._command(output, along)
        wound = [gear.start(torques[k]) for k, gear in self.gears.items()]
        self._memory.gears = [memory for _, memory in wound]
        return [position + twist for position, (twist, _) in zip(positions, wound)]

    def _read(self, state: JointState) -> JointState:
        """The state as measured by the controller's encoders."""
        if not (self._reads_motors and self.gears):
            return state
        driven = self._driven(state)
        if not self._coupling.motors:
            return driven
        position, velocity = map(self._coupling.to_joints, (driven.position, driven.velocity))
        return replace(state, position=position, velocity=velocity)

    def _driven(self, state: JointState) -> JointState:
        """The state with the motors' motion in place of their joints'; the same object for the same state."""
        if not self.gears and not self._coupling.motors:
            return state
        known, view = self._views
        if known is not state or view is None:
            position, velocity = map(self._coupling.to_motors, (state.position, state.velocity))
            for i, k in enumerate(self.gears):
                position[k], velocity[k] = state.motor_position[i], state.motor_velocity[i]
            view = replace(state, position=position, velocity=velocity)
            self._views = state, view
        return view

    def gear_energy(self, state: JointState) -> float:
        """Energy stored in all gears [J]."""
        return sum(gear.energy(self._transmitted(state, k)[1]) for k, gear in self.gears.items())

    def _transmitted(self, state: JointState, k: int) -> tuple[float, Memory]:
        """Torque through the gear of a drive, and its memory."""
        i = self._motor[k]
        position, velocity = map(self._coupling.to_motors, (state.position, state.velocity))
        twist = state.motor_position[i] - position[k]
        rate = state.motor_velocity[i] - velocity[k]
        return self.gears[k].advance(twist, rate, self._memory.gears[i])

    @property
    def laws(self) -> tuple[tuple[JointLaw, ...], ...]:
        """Of each joint, in the order in which they act."""
        return tuple(map(tuple, self._laws))

    def resume(
        self, state: JointState, *, remembered: Sequence[Sequence[Memory]], integral: Sequence[float]
    ) -> JointForces:
        """Forces at a state of a run with these memories.

        Args:
            state: the state.
            remembered: one memory for each of `laws`.
            integral: of reference minus position [rad s or m s], of each joint.
        """
        self.start(state)
        self._memory.laws = [list(own) for own in remembered]
        self._memory.integral = list(integral)
        return self.at(state)

    def at(self, state: JointState, output: Sequence[float] | None = None) -> JointForces:
        """Forces at a trial state; the controller's output is computed there, or given."""
        return self._evaluate(state, output)[0]

    def stop(self, stopping: Stopping | None) -> None:
        """Set the friction of the next step; None derives it from the velocities."""
        self._stopping = stopping

    def output(self, state: JointState) -> Sequence[float]:
        """The controller's output at a trial state."""
        return self._output(state)

    @property
    def lost(self) -> list[float]:
        """Power and energy of friction and of armatures at the last accepted instant; see `Losses.row`."""
        return self._losses.row()

    def contact_forces(self, state: JointState) -> list[float]:
        """Normal forces in the bearings with clearance [N]."""
        return [bearing.normal(state) for bearing in self._bearings]

    def temperatures(self, time: float) -> list[float]:
        """Of all joints [K]."""
        return [warmth.at(time) for warmth in self._warmth]

    def voltage(self, state: JointState) -> list[float] | None:
        """Winding voltages of a voltage drive at a state [V], else None."""
        return self._control.voltage(self._output(state))

    def accept(self, state: JointState) -> list[float] | None:
        """Store this state; returns the jump of the total forces if a digital controller acts here."""
        forces, laws, extra = self._evaluate(state)
        memory = self._memory
        self._control.accept(self._read(state), self._output(state))
        if self._control.integrates:
            memory.integral = self._integral(state)
            memory.errors = self._control.errors(self._read(state))
        memory.gears = [self._transmitted(state, k)[1] for k in self.gears]
        memory.motor_velocity = list(state.motor_velocity)
        memory.time, memory.velocity = state.time, list(state.velocity)
        memory.command, memory.extra = forces.command, extra
        memory.laws, memory.at_motors = laws.at_joints, laws.at_motors
        memory.loads = list(state.loads) or memory.loads
        for bearing in self._bearings:
            bearing.accept(state)
        self._losses.accept(state, forces.command, forces.friction)
        for k, warmth in enumerate(self._warmth):
            warmth.accept(state.time, -forces.rubbing[k] * state.velocity[k])
        tick = self.next_tick
        if tick is None or state.time < tick - TICK_TOLERANCE * self._control.sample_time:
            return None
        self._tick(state)
        after = self.at(state)
        memory.command = after.command
        self._losses.begin(state, after.command, after.friction)
        return [new - old for new, old in zip(after.every, forces.every)]

    def _tick(self, state: JointState) -> None:
        """A tick of a digital controller; only its output is held, the error integral continues."""
        self._memory.output = self._control.output(self._read(state), self._memory.integral)
        self._control.begin(self._read(state), self._memory.output)
        self._ticks += 1

    def _integral(self, state: JointState) -> list[float]:
        """Trapezoidal rule from the last accepted instant."""
        memory, half = self._memory, 0.5 * (state.time - self._memory.time)
        errors = self._control.errors(self._read(state))
        return [i + half * (last + e) for i, last, e in zip(memory.integral, memory.errors, errors)]

    def _output(self, state: JointState) -> list[float]:
        memory, control = self._memory, self._control
        if memory.output is not None:
            return memory.output
        integral = self._integral(state) if control.integrates else memory.integral
        return control.output(self._read(state), integral)

    def _command(self, output: Sequence[float], state: JointState) -> list[float]:
        torques = self._control.torque(output, self._driven(state))
        return self._limited(torques if self._control.at_drives else self._coupling.forces_on_motors(torques))

    def _limited(self, torques: list[float]) -> list[float]:
        for k, limit in enumerate(self._limits):
            if self._passive[k]:
                torques[k] = 0.0
            elif limit is not None and abs(torques[k]) > limit:
                torques[k] = limit if torques[k] > 0 else -limit
        return torques

    def _instant(self, state: JointState, k: int, command: float) -> Instant:
        memory, temperature = self._memory, self._warmth[k].at(state.time)
        return Instant(
            state.time,
            state.time - memory.time,
            state.position[k],
            state.velocity[k],
            command,
            0.0,
            memory.velocity[k],
            self._coupling.forces_on_joints(memory.command)[k],
            state.loads[k] if state.loads else 0.0,
            memory.loads[k],
            None if self._stopping is None else self._stopping.direction[k],
            temperature,
            *self._warmth[k].factors(temperature),
        )

    def _motor_instant(self, state: JointState, k: int, command: float) -> Instant:
        """Signals of a drive law at a motor with its own coordinate."""
        now, i = self._instant(state, k, command), self._motor[k]
        now.position, now.velocity = state.motor_position[i], state.motor_velocity[i]
        now.last_velocity, now.direction = self._memory.motor_velocity[i], None
        return now

    def _arm_instant(self, state: JointState, command: list[float]) -> ArmInstant:
        memory = self._memory
        return ArmInstant(
            state.time,
            state.time - memory.time,
            state.position,
            state.velocity,
            command,
            memory.velocity,
            self._coupling.forces_on_joints(memory.command),
        )

    def _evaluate(
        self, state: JointState, output: Sequence[float] | None = None
    ) -> tuple[JointForces, LawMemories, list[Memory]]:
        output = self._output(state) if output is None else output
        command = self._command(output, state)
        at_joints = self._coupling.forces_on_joints(command)
        friction = [0.0] * len(command)
        shafts = list(command)
        gears = [self._transmitted(state, k)[0] for k in self.gears]
        motors = [command[k] - torque for k, torque in zip(self.gears, gears)]
        for k, torque in zip(self.gears, gears):
            shafts[k] = torque
        total = self._coupling.forces_on_joints(shafts)
        remembered: list[list[Memory]] = []
        for k, own in enumerate(self._laws):
            coupled = k in self._at_motors.laws
            now = self._instant(state, k, at_joints[k])
            apart = k in self.gears and not coupled
            motor = self._motor_instant(state, k, at_joints[k]) if apart else now
            dry, wet = (0.0, 0.0) if coupled else self._rubbing[k]
            inside = -(dry * motor.sign + wet * motor.velocity)
            if apart:
                motors[self._motor[k]] += inside
            else:
                total[k] += inside
                friction[k] += inside
            kept: list[Memory] = []
            for law, memory in zip(own, self._memory.laws[k]):
                seen = motor if law.role == "drive" else now
                force, memory = law.advance(seen, memory)
                kept.append(memory)
                if law.role == "drive" and apart:
                    motors[self._motor[k]] += force
                else:
                    total[k] += force
                if law.role == "friction":
                    now.friction += force
                if law.role in ("friction", "modifier"):
                    friction[k] += force
            if self._stopping is not None:
                total[k] += self._stopping.force[k]
                friction[k] += self._stopping.force[k]
            remembered.append(kept)
        for bearing in self._bearings:
            bearing.add(state, total, friction)
        rubbing = list(friction)
        at_motors = self._at_motors.add(state, command, self._memory, motors, total, friction)
        extra: list[Memory] = []
        for arm_force, memory in zip(self._extra, self._memory.extra):
            added, memory = arm_force.advance(self._arm_instant(state, at_joints), memory)
            extra.append(memory)
            total = [before + more for before, more in zip(total, added)]
        wrench = self._control.wrench(output)
        found = JointForces(command, friction, total, wrench, motors, gears, rubbing)
        return found, LawMemories(remembered, at_motors), extra

"""A run of the redundant system: states, forces and rows of the recording, in step with the solver.

Friction that depends on bearing loads uses the multipliers of Exudyn's present Newton iterate, so that at the
end of a step loads and friction agree without a delay: the order stays that of the integrator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.rotation import from_quaternion
from exudyn_model.control.laws import JointState
from exudyn_model.control.rigid_dynamics import BaseState, Inner
from exudyn_model.effects import Effects
from exudyn_model.forces.joints import Forces
from exudyn_model.redundant.bodies.handles import omega_of
from exudyn_model.redundant.drive import JointMotion
from exudyn_model.redundant.reactions import bearing_load
from exudyn_model.redundant.system import build
from exudyn_model.redundant.watch import Watch
from exudyn_model.solve.channels import Samples
from exudyn_model.solve.divergence import diverged
from exudyn_model.solve.stepping import CONSTRAINED_TOLERANCE, ON_GRID, Stepper
from exudyn_model.solve.system import RobotState
from robot_model import Robot

__all__ = ["RedundantRun"]

Array = NDArray[np.float64]

#: Tolerance of Newton's iterations with exact beams, per EA [N]: their stretching forces are EA times the
#: rounding of positions of some metres over elements of some decimetres.
BEAM_TOLERANCE = 1e-13
#: Iterations of loads and friction after a jump, and the relative change that ends them.
PASSES, SETTLED = 50, 1e-12


class RedundantRun:
    """From the initial state to the end of the grid."""

    def __init__(
        self,
        robot: Robot,
        effects: Effects,
        forces: Forces,
        *,
        grid: Array,
        step: float,
        tolerance: float,
        flexible: str,
        motors: Sequence[float] = (),
        newton: float = CONSTRAINED_TOLERANCE,
        exact: bool = False,
    ) -> None:
        self._robot, self._forces, self._grid, self._exact = robot, forces, grid, exact
        self._system = build(
            robot,
            effects,
            self._on_joints,
            flexible=flexible,
            motors=motors,
            nearby=self._near,
            watched=forces.bent_links,
        )
        names = [link.joint.name for link in self._system.connections]
        self._balls = [names.index(joint.name) for joint in robot.spherical_joints]
        self._bearings = [joint.bearing for joint in robot.moving_joints]
        self._loaded = forces.needs_loads
        order = [joint.name for joint in robot.moving_joints]
        self._coordinate = {
            k: order.index(link.joint.name)
            for k, link in enumerate(self._system.connections)
            if link.joint.name in order
        }
        self._samples = Samples()
        self._watch = Watch(self._system)
        self._time = 0.0
        self._last: tuple[Sequence[float], Sequence[float]] = ((), ())
        self._started, self._begins = False, True
        self._stepper = Stepper(
            self._system.mbs,
            step=step,
            tolerance=math.inf if flexible == "beam" and robot.flexible_links else tolerance,
            next_stop=self._next_stop,
            accepted=self._accepted,
            seen=self._seen,
            jumped=self._jumped,
            constrained=True,
            newton=_newton_tolerance(robot, flexible, newton),
        )

    def samples(self, progress: Callable[[float], None]) -> Samples:
        """Run, reporting the time of every sample; raises `InputError` when the motion diverges."""
        self._progress = progress
        if not self._stepper.run(0.0, float(self._grid[-1])) or len(self._samples) < len(self._grid):
            names = [joint.name for joint in self._robot.moving_joints]
            raise diverged(self._robot, self._time, names, *self._last)
        return self._samples

    def _state(self, time: float, motion: JointMotion, x: Array, v: Array) -> JointState:
        """Input of controllers and laws, at coordinates of the drive."""
        base = None
        if self._system.free:
            own = self._system.drive.whole(x)[:7]
            base = BaseState(from_quaternion(own[3:]), omega_of(own, v[:7]), own[:3], v[:3])
        n = self._system.drive.joints
        (q, motor), (qd, motor_rate) = ((part[:n], part[n:]) for part in (motion.position, motion.velocity))
        inner = self._inner(motion, x, v) if self._forces.needs_inner else None
        return JointState(time, q, qd, base, self._loads(motion), motor, motor_rate, inner)

    def _inner(self, motion: JointMotion, x: Array, v: Array) -> Inner:
        """Spherical joints, and the links whose deflection the controller measures."""
        pairs = [motion.handles[k] for k in self._balls]
        rows = [place for rows in self._system.drive.watched for place in range(rows.start, rows.stop)]
        return Inner(
            [outer.joint.T @ inner.joint for outer, inner in pairs],
            np.ravel([inner.joint.T @ (inner.spin - outer.spin) for outer, inner in pairs]),
            x[rows],
            v[rows],
        )

    def _loads(self, motion: JointMotion) -> list[float]:
        """Friction moments W of the bearings [N m]; none where nothing depends on them."""
        loads = [0.0] * len(self._bearings)
        if not self._loaded:
            return loads
        multipliers = self._system.multipliers()
        for k, i in self._coordinate.items():
            bearing = self._bearings[i]
            if bearing is not None:
                kind = self._system.connections[k].joint.kind
                load = bearing_load(kind, multipliers[k], *motion.handles[k])
                loads[i] = load.friction_moment(bearing)
        return loads

    def _on_joints(self, time: float, motion: JointMotion, x: Array, v: Array) -> Array:
        return self._total(self._begun(self._state(time, motion, x, v)))

    def _begun(self, state: JointState) -> JointState:
        """The same state; the first one initialises all memories."""
        if not self._started:
            self._started = True
            self._forces.start(state)
        return state

    def _near(self, time: float, motion: JointMotion, x: Array, v: Array) -> Callable[[JointMotion], Array]:
        """Forces nearby, with constant loads and, where it is not stiff, constant controller output."""
        state, n = self._begun(self._state(time, motion, x, v)), self._system.drive.joints
        output = None if self._forces.stiff_control else self._forces.output(state)

        def forces(moved: JointMotion) -> Array:
            (q, motor), (qd, rate) = ((part[:n], part[n:]) for part in (moved.position, moved.velocity))
            there = replace(state, position=q, velocity=qd, motor_position=motor, motor_velocity=rate)
            return np.array(self._forces.at(there, output).every)

        return forces

    def _total(self, state: JointState) -> Array:
        found = self._forces.at(state)
        return np.array([*found.every, *found.wrench])

    def _next_stop(self, time: float) -> float:
        row = len(self._samples)
        if row < len(self._grid) and self._grid[row] <= time + ON_GRID:
            row += 1  # called before the sample at this instant is recorded
        stop = float(self._grid[row]) if row < len(self._grid) else math.inf
        tick = self._forces.next_tick
        return stop if tick is None or tick <= time + ON_GRID else min(stop, tick)

    def _motion(self, x: Array, v: Array) -> tuple[JointMotion, Array, Array]:
        driven = self._system.driven
        own_x, own_v = x[driven], v[driven]
        return self._system.drive.motion(own_x, own_v), own_x, own_v

    def _accepted(self, time: float, x: Array, v: Array) -> Array | None:
        self._time = time
        motion, own_x, own_v = self._motion(x, v)
        self._system.drive.last = motion.position[: self._system.drive.joints]
        self._last = motion.position, motion.velocity
        state = self._state(time, motion, own_x, own_v)
        # Exudyn's first accelerations come before its first multipliers: no bearing is loaded yet.
        unloaded = self._begins and self._loaded
        before = self._total(replace(state, loads=[0.0] * len(self._bearings)) if unloaded else state)
        ticked = self._forces.accept(state) is not None
        return before if ticked or self._begins else None

    def _jumped(self, solver: Any, before: Array) -> Array:
        """Accelerations and multipliers for forces that differ from `before`.

        At the start they are also corrected to rounding: Exudyn computes its first ones by differences, and
        the trapezoidal rule would keep their error of 1e-7 forever.
        """
        data, mbs = self._system.mbs.systemData, self._system.mbs
        x, v = data.GetODE2Coordinates(), data.GetODE2Coordinates_t()
        motion, own_x, own_v = self._motion(x, v)
        solver.ComputeMassMatrix(mbs)
        matrix, count = self._system.saddle(np.array(solver.GetSystemMassMatrix())), len(x)
        multipliers = data.GetAECoordinates()
        places = self._system.multiplier_places
        jump: Array = np.zeros(len(matrix))
        last: Array = np.zeros(len(before))
        strain = np.zeros(len(matrix))
        if self._begins:
            drift = self._system.constraint_drift(x, v)
            strain[count:] = -drift - matrix[count:, :count] @ data.GetODE2Coordinates_tt()
            self._begins = False
        for _ in range(PASSES):
            state = self._state(self._time, motion, own_x, own_v)
            change = self._total(state) - before
            forces = strain.copy()
            forces[self._system.driven] = self._system.drive.spread(motion, own_x, change)
            jump = np.asarray(np.linalg.solve(matrix, forces), dtype=np.float64)
            now = multipliers.copy()
            now[places] += jump[count : count + len(places)]
            data.SetAECoordinates(now)
            if np.abs(change - last).max(initial=0.0) <= SETTLED * (1 + np.abs(change).max(initial=0.0)):
                break
            last = change
        accelerations: Array = jump[:count]
        return accelerations

    def _seen(self, time: float, x: Array, v: Array, a: Array) -> bool:
        row = len(self._samples)
        if row < len(self._grid) and abs(time - self._grid[row]) <= ON_GRID:
            data = self._system.mbs.systemData
            multipliers = data.GetAECoordinates()
            self._take(time, x, v, self._consistent(x, v, a) if self._exact else a)
            data.SetAECoordinates(multipliers)
            self._progress(time)
        return True

    def _consistent(self, x: Array, v: Array, a: Array) -> Array:
        """Accelerations that satisfy the constraints at this state; stores their multipliers in the system.

        Those of a step carry the rounding of positions and velocities, divided by the step.
        """
        system, solver = self._system, self._stepper.solver
        data, count, places = system.mbs.systemData, len(x), system.multiplier_places
        drift = system.constraint_drift(x, v)
        solver.ComputeMassMatrix(system.mbs)
        matrix = system.saddle(np.array(solver.GetSystemMassMatrix()))
        strain = np.zeros(len(matrix))
        strain[count:] = -drift - matrix[count:, :count] @ a
        change: Array = np.asarray(np.linalg.solve(matrix, strain), dtype=np.float64)
        multipliers = data.GetAECoordinates()
        multipliers[places] += change[count : count + len(places)]
        data.SetAECoordinates(multipliers)
        put_right: Array = a + change[:count]
        return put_right

    def _take(self, time: float, x: Array, v: Array, a: Array) -> None:
        system, solver = self._system, self._stepper.solver
        motion, own_x, own_v = self._motion(x, v)
        state = self._state(time, motion, own_x, own_v)
        accelerations = (motion.rows @ a[system.driven] + motion.extra)[: system.drive.joints]
        forces = self._forces.at(state)
        self._samples.add_joints(state, accelerations.tolist(), forces)
        self._samples.add_forces(state, self._forces)
        whole = x + system.reference
        if state.base is not None:
            first = system.rows_of(system.drive.nodes[0])
            self._samples.add_base(_robot_state(state), a[first][:3].tolist())
        solver.ComputeMassMatrix(system.mbs)
        mass = np.array(solver.GetSystemMassMatrix())
        stored = self._forces.gear_energy(state)
        self._samples.extra.append(
            [*self._watch.row(time, whole, v, a, mass, motion, stored), *forces.wrench]
        )


def _newton_tolerance(robot: Robot, flexible: str, wanted: float) -> float:
    beams = [link.beam for link in robot.flexible_links if link.beam and flexible == "beam"]
    stretching = [beam.young * beam.section.figures[0] for beam in beams]
    return max(wanted, BEAM_TOLERANCE * max(stretching, default=0.0))


def _robot_state(state: JointState) -> RobotState:
    base = state.base
    assert base is not None
    assert base.position is not None
    assert base.velocity is not None
    return RobotState(
        state.time,
        tuple(state.position),
        tuple(state.velocity),
        base.rotation,
        base.position,
        base.velocity,
        base.angular_velocity,
    )

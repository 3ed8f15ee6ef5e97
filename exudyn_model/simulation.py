"""`simulate`: the robot's reference motion in Exudyn, as a recording; `check`: whether it can be run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import Mechanism, mechanism_of
from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.control.laws import JointState, control_law, initial_joints
from exudyn_model.control.nominal import nominal_model
from exudyn_model.effects import Effects, effects_of, require_bodies
from exudyn_model.effects.links.structure import as_is
from exudyn_model.forces.extra import ExtraForce
from exudyn_model.forces.joints import Forces
from exudyn_model.redundant import RedundantRun, extra_channels
from exudyn_model.redundant.mounting import mounted
from exudyn_model.solve.channels import Samples, channel_names, exact_recording
from exudyn_model.solve.divergence import diverged
from exudyn_model.solve.explicit import Dynamics, ExplicitStepper
from exudyn_model.solve.sensing import check_sensors, sensed
from exudyn_model.solve.start import check_movable, initial_state, sampling_instants
from exudyn_model.solve.stepping import CONSTRAINED_TOLERANCE, FIXED_TOLERANCE, ON_GRID, TOLERANCE, Stepper
from exudyn_model.solve.stopping import stopped
from exudyn_model.solve.system import System, build
from robot_model import InputError, Recording, Robot, nearest
from robot_model.description.loosening import loosened
from robot_model.system.interrupts import interruptible

__all__ = [
    "DEFAULT_STEP",
    "Flexible",
    "Formulation",
    "Integrator",
    "check",
    "local_tolerance",
    "measured",
    "simulate",
]

Array = NDArray[np.float64]

Formulation = Literal["auto", "tree", "redundant"]
Flexible = Literal["modal", "beam"]
Integrator = Literal["adaptive", "trapezoidal", "runge-kutta"]

#: Largest time step [s]: a two-joint arm in smooth motion is then followed to about 2e-7 rad.
DEFAULT_STEP = 1e-3
#: Local error of a velocity per step where links ring [rad/s, m/s, sqrt(kg) m/s], at the default step: their
#: higher modes run at the given step, and only reversals and impacts of friction are resolved finer.
RINGING = 1e-5


@interruptible()
def simulate(
    robot: Robot,
    *,
    seed: int = 0,
    sensors: bool = True,
    step: float = DEFAULT_STEP,
    formulation: Formulation = "auto",
    flexible: Flexible = "modal",
    integrator: Integrator = "adaptive",
    stiction: bool = False,
    losses: bool = False,
    extra: Sequence[ExtraForce] = (),
    controller_model: Robot | None = None,
    tolerance: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Run the reference motion of `robot` in Exudyn.

    Args:
        robot: the description, with its effects, controller and reference motion.
        seed: of the sensors' noise.
        sensors: True gives the channels of `robot.sensors` with their noise, resolution and faults, and the
            reference positions; False gives every channel exactly.
        step: largest time step [s].
        formulation: "tree", minimal coordinates; "redundant", bodies and constraints, which adds bearing
            loads (`radial_force`, `axial_force`, `bending_moment`) from Exudyn's own constraint forces,
            `robot.energy` and momenta; "auto" takes the tree where it can do what is asked for.
        flexible: how flexible links bend: "modal", the modes of the description in a floating frame, or
            "beam", geometrically exact elements without any truncation of modes, at the given step
            throughout: their stretching waves would hold error control at steps of microseconds.
        integrator: "adaptive", the trapezoidal rule under local error control; for proofs of convergence
            "trapezoidal", the same at the fixed `step` with Newton's iterations carried to rounding, or
            "runge-kutta", explicit and of sixth order, for trees whose laws have no memory.
        stiction: friction stops joints within a step where its level suffices, without smoothing (see
            `stopping`); for the integrator "runge-kutta".
        losses: record the losses in friction and the windings' resistance, as in the reference engine.
        extra: additional forces on the joints, outside the description.
        controller_model: the controller's model of the robot; default is `robot` without its effects.
        tolerance: local error of a velocity per step [rad/s, m/s]; default is `local_tolerance`.
        progress: called with the present time [s] at every instant of the recording.

    Returns:
        Recording sampled at `reference.sample_rate` from 0 to `reference.duration`.

    Raises:
        InputError: no reference motion, an effect or setting without counterpart in this engine, a joint
            with nothing to move, or a motion that diverges (with its time and last state).
    """
    if tolerance is None:
        tolerance = local_tolerance(robot, step)
    ready = _prepare(
        robot,
        step=step,
        formulation=formulation,
        flexible=flexible,
        extra=extra,
        tolerance=tolerance,
        integrator=integrator,
        stiction=stiction,
        controller_model=controller_model,
    )
    samples = ready.run.samples(progress or _unheard)
    exact = exact_recording(ready.robot, ready.grid, samples, ready.channels, losses=losses)
    return sensed(robot, exact, faults=ready.effects.faults, seed=seed) if sensors else exact


@interruptible()
def check(
    robot: Robot,
    *,
    step: float = DEFAULT_STEP,
    formulation: Formulation = "auto",
    flexible: Flexible = "modal",
) -> None:
    """Raise the `InputError` with which `simulate` would refuse `robot`, without running it."""
    _prepare(robot, step=step, formulation=formulation, flexible=flexible, extra=(), tolerance=TOLERANCE)


def local_tolerance(robot: Robot, step: float) -> float:
    """Local error of a velocity per step at which `simulate` runs `robot` [rad/s, m/s, sqrt(kg) m/s].

    Below the default step it decreases with the cube of the step, so that steps cut by error control shrink
    with the others.
    """
    own = RINGING if as_is(robot).flexible_links else TOLERANCE
    return own * min(1.0, (step / DEFAULT_STEP) ** 3)


@dataclass(frozen=True)
class _Ready:
    """The true robot, an assembled run, the instants of its recording, and channels beyond the tree's."""

    robot: Robot
    run: _Run | RedundantRun
    grid: Array
    channels: tuple[str, ...]
    effects: Effects


def _prepare(
    robot: Robot,
    *,
    step: float,
    formulation: Formulation,
    flexible: Flexible,
    extra: Sequence[ExtraForce],
    tolerance: float,
    integrator: Integrator = "adaptive",
    stiction: bool = False,
    controller_model: Robot | None = None,
) -> _Ready:
    for key, word, words in (
        ("formulation", formulation, get_args(Formulation)),
        ("flexible", flexible, get_args(Flexible)),
        ("integrator", integrator, get_args(Integrator)),
    ):
        if word not in words:
            raise InputError(f"{key} = {word!r} is none of {', '.join(words)}{nearest(str(word), words)}.")
    grid = sampling_instants(robot, step)
    robot = loosened(robot)
    described, robot = robot, as_is(robot)
    effects = effects_of(robot)
    require_bodies(robot, effects)
    _check_carried(robot, effects, flexible)
    mechanism = None
    if not robot.spherical_joints:  # which minimal coordinates of this engine do not have
        mechanism = mechanism_of(
            robot, added=effects.masses, added_gravity=effects.gravity, apart=effects.gears
        )
        check_movable(robot, mechanism)
    effects = mounted(robot, effects)
    law = control_law(described, nominal_model(controller_model or described))
    forces = Forces(robot, law, effects.laws, extra, effects.gears, effects.at_motors)
    _check_known(described, forces, flexible)
    motors = forces.settle(initial_joints(robot))
    redundant = _is_redundant(robot, effects, forces, formulation)
    channels = extra_channels(robot, flexible=flexible) if redundant else ()
    check_sensors(robot, channel_names(robot, channels), [channel for channel, _ in effects.faults])
    _check_integrator(robot, forces, integrator, redundant=redundant, stiction=stiction)
    if stiction and integrator != "runge-kutta":
        raise InputError(
            f"robot '{robot.name}': Exudyn's \"{integrator}\" integrator has no steps in which friction "
            f"stops a "
            'joint; use integrator = "runge-kutta", or leave out stiction.'
        )
    fixed = integrator != "adaptive"
    settings: dict[str, Any] = {"grid": grid, "step": step, "tolerance": math.inf if fixed else tolerance}
    run: _Run | RedundantRun
    if redundant:
        # Friction that follows the loads converges slowly in Newton's iterations, not to rounding.
        exact = fixed and not forces.needs_loads
        newton = FIXED_TOLERANCE if exact else CONSTRAINED_TOLERANCE
        settings |= {"flexible": flexible, "newton": newton, "motors": motors, "exact": exact}
        run = RedundantRun(robot, effects, forces, **settings)
    else:
        assert mechanism is not None
        run = _Run(
            robot, mechanism, forces, **settings, integrator=integrator, motors=motors, stiction=stiction
        )
    return _Ready(robot, run, grid, channels, effects)


def _unheard(time: float) -> None:
    """Ignore progress."""


def _check_integrator(
    robot: Robot, forces: Forces, integrator: Integrator, *, redundant: bool, stiction: bool
) -> None:
    """Raise `InputError` for anything that explicit steps do not support."""
    if integrator != "runge-kutta":
        return
    remedy = "leave out stiction and the integrator" if stiction else 'use integrator = "trapezoidal"'
    reasons = [(redundant, "constraints"), (forces.remembers, "forces that remember earlier instants")]
    for there, what in reasons:
        if there:
            raise InputError(
                f"robot '{robot.name}': Exudyn's explicit integrator does not carry {what}; {remedy}."
            )
    if stiction and forces.dry_motors:
        raise InputError(
            f"robot '{robot.name}', motor '{forces.dry_motors[0]}': exact stick and slip is of joints, and "
            "it moves several; simulate without stiction, or state the friction at joints."
        )


def _check_carried(robot: Robot, effects: Effects, flexible: Flexible) -> None:
    """Raise `InputError` for a flexible link that the chosen form does not support."""
    for link in robot.flexible_links:
        share = effects.stiffening.get(link.name, 1.0)
        if flexible == "beam" and share < 1:
            raise InputError(
                f"link '{link.name}': a geometrically exact beam stiffens wholly, not by a share of "
                f'{share:g}; use flexible = "modal".'
            )


def _check_known(robot: Robot, forces: Forces, flexible: Flexible) -> None:
    """Raise `InputError` for a controller that needs modal coordinates which are not there."""
    for name in forces.bent_links:
        if flexible == "beam" and robot.link(name).beam is not None:
            raise InputError(
                f"robot '{robot.name}': the controller's full model needs the modal coordinates of link "
                f"'{name}', which a geometrically exact beam does not have; use flexible = \"modal\", or set "
                'controller.model to "rigid".'
            )


def _is_redundant(robot: Robot, effects: Effects, forces: Forces, formulation: Formulation) -> bool:
    """Whether bodies and constraints are needed; raises `InputError` where the tree was chosen but fails."""
    needed = [
        (bool(robot.flexible_links), "its flexible links"),
        (bool(robot.spherical_joints), "its spherical joints"),
        (forces.needs_loads, "friction that depends on bearing loads"),
        (forces.holds_base, "the wrench that holds its base"),
        (bool(effects.pushes), "forces on its bodies besides those of the joints"),
    ]
    reasons = [what for there, what in needed if there]
    if formulation == "tree" and reasons:
        raise InputError(
            f"robot '{robot.name}': Exudyn's kinematic tree does not carry {reasons[0]}; "
            'use formulation = "redundant".'
        )
    measured = {sensor.channel for sensor in robot.sensors} & set(extra_channels(robot))
    return formulation == "redundant" or (formulation == "auto" and bool(reasons or measured))


def measured(robot: Robot, exact: Recording, *, seed: int = 0) -> Recording:
    """The result of `simulate(robot, seed=seed)`, from the exact recording of the same simulation."""
    return sensed(robot, exact, faults=effects_of(robot).faults, seed=seed)


class _Run:
    """From the initial state to the end of the grid, with a new anchor of the base where one is due."""

    def __init__(
        self,
        robot: Robot,
        mechanism: Mechanism,
        forces: Forces,
        *,
        grid: Array,
        step: float,
        tolerance: float,
        integrator: Integrator,
        motors: Sequence[float],
        stiction: bool = False,
    ) -> None:
        self._integrator, self._stiction = integrator, stiction
        self._robot, self._mechanism, self._forces = robot, mechanism, forces
        self._grid, self._step, self._tolerance = grid, step, tolerance
        self._coordinate = mechanism.coordinate
        self._samples = Samples()
        speeds = Transmissions(robot).to_motors([joint.initial_velocity for joint in robot.moving_joints])
        speeds = [speeds[k] for k in forces.gears]
        self._state = replace(
            initial_state(robot, mechanism), motor_position=tuple(motors), motor_velocity=tuple(speeds)
        )

    def samples(self, progress: Callable[[float], None]) -> Samples:
        """Run, reporting the time of every sample; raises `InputError` when the motion diverges."""
        self._progress, started = progress, False
        while len(self._samples) < len(self._grid):
            before = self._state.time
            rotors = [gear.inertia for gear in self._forces.gears.values()]
            system = build(self._mechanism, self._state, self._on_coordinates, rotors)
            self._placement = system.placement
            if not started:
                self._forces.start(self._joint_state(self._state.time, *system.initial))
                started = True
            finished = self._stepper(system).run(before, float(self._grid[-1]))
            if not finished or (self._state.time <= before and len(self._grid) > 1):
                self._give_up()
        return self._samples

    def _stepper(self, system: System) -> Stepper | ExplicitStepper:
        watched: dict[str, Any] = {
            "next_stop": self._next_stop,
            "accepted": self._accepted,
            "seen": self._seen,
        }
        if self._integrator == "runge-kutta":
            decided = self._decided if self._stiction else None
            return ExplicitStepper(system.mbs, step=self._step, decided=decided, **watched)
        newton = FIXED_TOLERANCE if self._integrator == "trapezoidal" else None
        return Stepper(system.mbs, step=self._step, tolerance=self._tolerance, newton=newton, **watched)

    def _joint_state(self, time: float, x: Sequence[float], v: Sequence[float]) -> JointState:
        first, count = self._placement.base_coordinates, len(self._coordinate)
        q, qd = [0.0] * count, [0.0] * count
        for member, k in enumerate(self._coordinate, start=first):
            q[k], qd[k] = x[member], v[member]
        motors = x[first + count :], v[first + count :]
        return JointState(time, q, qd, self._placement.base(x, v) if first else None, (), *motors)

    def _on_coordinates(self, time: float, x: Sequence[float], v: Sequence[float]) -> list[float]:
        return self._spread(self._forces.at(self._joint_state(time, x, v)).every)

    def _spread(self, forces: Sequence[float]) -> list[float]:
        """From joint order, with the motors behind, to the system's coordinates."""
        still, count = [0.0] * self._placement.base_coordinates, len(self._coordinate)
        return [*still, *(forces[k] for k in self._coordinate), *forces[count:]]

    def _decided(
        self, time: float, x: Array, v: Array, step: float, dynamics: Callable[[], Dynamics]
    ) -> None:
        state, first = self._joint_state(time, x.tolist(), v.tolist()), self._placement.base_coordinates
        places = [0] * len(self._coordinate)
        for member, k in enumerate(self._coordinate, start=first):
            places[k] = member
        self._forces.stop(stopped(self._forces, state, step, dynamics, places))

    def _next_stop(self, time: float) -> float:
        row = len(self._samples)
        if row < len(self._grid) and self._grid[row] <= time + ON_GRID:
            row += 1  # called before the sample at this instant is recorded
        stop = float(self._grid[row]) if row < len(self._grid) else math.inf
        tick = self._forces.next_tick
        return stop if tick is None or tick <= time + ON_GRID else min(stop, tick)

    def _accepted(self, time: float, x: Array, v: Array) -> Array | None:
        jump = self._forces.accept(self._joint_state(time, x.tolist(), v.tolist()))
        return None if jump is None else np.array(self._spread(jump))

    def _seen(self, time: float, x: Array, v: Array, a: Array) -> bool:
        self._state = self._placement.state(time, x.tolist(), v.tolist())
        row = len(self._samples)
        if row < len(self._grid) and abs(time - self._grid[row]) <= ON_GRID:
            self._take(x.tolist(), v.tolist(), a.tolist())
            self._progress(time)
        return not self._placement.is_near_its_end(x)

    def _take(self, x: list[float], v: list[float], a: list[float]) -> None:
        state, first = self._state, self._placement.base_coordinates
        joints = self._joint_state(state.time, x, v)
        acceleration = [0.0] * len(self._coordinate)
        for member, k in enumerate(self._coordinate, start=first):
            acceleration[k] = a[member]
        self._samples.add_joints(joints, acceleration, self._forces.at(joints))
        self._samples.add_forces(joints, self._forces)
        if first:
            self._samples.add_base(state, a[:3])

    def _give_up(self) -> None:
        state = self._state
        names = [member.joint for member in self._mechanism.members]
        raise diverged(self._robot, state.time, names, state.position, state.velocity)

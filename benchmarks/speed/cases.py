"""Content of the speed benchmarks: robots, states and loops, each made once."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from benchmarks.speed.chains import chain
from benchmarks.speed.loops import (
    Loop,
    from_python,
    mujoco_loop,
    own_from_python,
    own_loop,
    pinocchio_loop,
)
from benchmarks.speed.rigid_peers import MujocoPeer, PinocchioPeer, random_states
from reference_model.control.motion import reference_function
from reference_model.evaluation.forward import forward_function
from reference_model.evaluation.model import RobotModel
from reference_model.fixed_steps.realtime import Stepper
from reference_model.flexible.undeformed import undeformed
from reference_model.kernels import looped_rate, rate_by_size
from reference_model.passive.base_motion import BaseMotion
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from reference_model.steppers.integration import LONGEST_STEP, MAX_STEPS, cvodes, integrate, symbols
from robot_model import Robot, load_robot

__all__ = [
    "LINKS",
    "MANOEUVRE",
    "RECORDED",
    "chain_rate",
    "derivative_columns",
    "fixed_steps",
    "forward_loops",
    "frictionless_robot",
    "integration",
    "least",
    "loaded_robot",
    "manoeuvre",
    "recorded",
    "shipped_rigid",
    "side_by_side",
]

Array = NDArray[np.float64]

LINKS = (2, 4, 8, 16, 32, 64)
MANOEUVRE = "flexible_space_robot"
#: Samples of a long recording: 100 s at 1 kHz.
RECORDED = 100_000


@cache
def shipped_rigid(name: str) -> Robot:
    """A shipped robot; a flexible link becomes a rigid one of the same mass properties."""
    return undeformed(load_robot(name))


@cache
def loaded_robot() -> Robot:
    """The flexible space robot as shipped, with LuGre friction from the bearing loads in both joints.

    Raises:
        ValueError: the shipped robot has other friction.
    """
    robot = load_robot(MANOEUVRE)
    lugre = [use.at for use in robot.effects if use.effect == "lugre_friction"]
    if lugre != [joint.name for joint in robot.moving_joints]:
        raise ValueError(f"robot '{MANOEUVRE}' has LuGre friction at {lugre}")
    return robot


@cache
def frictionless_robot() -> Robot:
    """The same without any effect."""
    return load_robot(MANOEUVRE).model_copy(update={"effects": ()})


@cache
def forward_loops(name: str) -> Mapping[str, Loop]:
    """One forward-dynamics evaluation of the same rigid robot, each engine in its own compiled loop and
    called from Python."""
    robot = shipped_rigid(name)
    states = random_states(robot)
    function, open_one = forward_function(robot), forward_function(robot, constants=False)
    moving = (states.attitude, states.base_velocity, states.position, states.velocity, states.torque)
    numbers = np.tile(RobotModel(robot).inertial, (len(states), 1))
    columns, open_columns = (*moving, numbers[:, :0]), (*moving, numbers)
    mujoco, pinocchio = MujocoPeer(robot, states), PinocchioPeer(robot, states)
    return {
        "reference model": own_loop(function, columns),
        "reference model, masses as inputs": own_loop(open_one, open_columns),
        "MuJoCo mj_forward": mujoco_loop(robot, states),
        "Pinocchio aba": pinocchio_loop(robot, states),
        "reference model, from Python": own_from_python(robot, states),
        "MuJoCo mj_forward, from Python": from_python(mujoco.evaluate, len(states)),
        "Pinocchio aba, from Python": from_python(pinocchio.evaluate, len(states)),
    }


@cache
def derivative_columns(robot: Robot) -> tuple[Plant, Sequence[Array]]:
    """A plant, and time, state, reference and command along its manoeuvre, every tenth of a second."""
    plant, reference = Plant(robot), reference_function(robot)
    assert robot.reference is not None
    short = robot.model_copy(update={"reference": robot.reference.model_copy(update={"sample_rate": 10.0})})
    assert short.reference is not None
    instants = np.arange(int(10 * short.reference.duration) + 1) / 10
    course = integrate(plant, reference, instants, hold=0.0, rtol=1e-6, atol=1e-9)
    goals = np.array([reference(t)[0].full().ravel() for t in instants])
    return plant, (instants[:, None], course.states, goals, course.commands)


def chain_rate(
    links: int, *, flexible: bool, looped: bool | None = None
) -> tuple[ca.Function, Sequence[Array]]:
    """State derivative of a chain, and random states of it; by a loop over bodies or straight-line code.

    Args:
        links: of the chain.
        flexible: beams or rigid links.
        looped: which of the two; None decides by size, as in a run.
    """
    plant = Plant(chain(links, flexible=flexible))
    function = rate_by_size(plant) if looped is None else looped_rate(plant) if looped else plant.rate
    assert function is not None
    rng = np.random.default_rng(links)
    sizes = (1, plant.layout.size, links, plant.commands)
    columns = [rng.normal(size=(32, rows)) * 0.1 for rows in sizes]
    return function, columns


def recorded(name: str) -> Callable[[str], float]:
    """Wall time [s] of a `RobotModel` method over a long recording, without its first call."""
    robot = load_robot(name)
    model = RobotModel(robot)
    rng = np.random.default_rng(1)
    motion = rng.normal(size=(3, RECORDED, len(robot.moving_joints)))
    attitude = rng.normal(size=(RECORDED, 4))
    base = BaseMotion(attitude, *rng.normal(size=(4, RECORDED, 3))) if model.free_base else None

    def run(method: str) -> float:
        start = time.perf_counter()
        getattr(model, method)(*motion, base=base)
        return time.perf_counter() - start

    return run


@cache
def integration(compile_code: bool) -> tuple[Loop, Callable[[], Mapping[str, int]]]:
    """CVODES over the manoeuvre with friction at the default tolerances: processor time, and its counts.

    Building the equations is not included; it is part of `manoeuvre`.
    """
    robot = loaded_robot()
    assert robot.reference is not None
    plant, reference = Plant(robot), reference_function(robot)
    t, x, _ = symbols(reference, plant.layout.size)
    goal = reference(t)
    dae = {"t": t, "x": x, "ode": plant.rate(t, x, goal[0], plant.command(t, x, *goal))}
    rate, count = robot.reference.sample_rate, int(robot.reference.sample_rate * robot.reference.duration)
    options = {"reltol": 1e-8, "abstol": 1e-10, "max_num_steps": MAX_STEPS}
    options["max_step_size"] = LONGEST_STEP / rate
    grid = (np.arange(1, count + 1) / rate).tolist()
    solver, start = cvodes(dae, grid, options, compile_code), plant.initial(reference)

    def run() -> float:
        begun = time.thread_time()
        solver(x0=start)
        return time.thread_time() - begun

    return run, solver.stats


@cache
def fixed_steps() -> Loop:
    """Processor time of one compiled step of 1 ms of the same robot, called from Python."""
    stepper = Stepper(loaded_robot())
    state, command = stepper.initial(), np.zeros(stepper.commands)
    return from_python(lambda k: stepper.step(k * 1e-3, state, command, 1e-3), 64)


def manoeuvre(**options: float | bool) -> float:
    """Processor time [s] of the full simulation with friction, with equations rebuilt and code reloaded."""
    start = time.process_time()
    simulate(loaded_robot(), sensors=False, **options)  # type: ignore[arg-type]
    return time.process_time() - start


def least(loop: Loop, repeats: int) -> tuple[float, float]:
    """Minimum and median of several repeats, after a warm-up."""
    loop()
    found = [loop() for _ in range(repeats)]
    return min(found), float(np.median(found))


def side_by_side(loops: Mapping[str, Loop], repeats: int) -> dict[str, tuple[float, float]]:
    """Minimum and median of each, with interleaved repeats, so that a busy moment affects all of them."""
    for loop in loops.values():
        loop()
    found: dict[str, list[float]] = {name: [] for name in loops}
    for _ in range(repeats):
        for name, loop in loops.items():
            found[name].append(loop())
    return {name: (min(values), float(np.median(values))) for name, values in found.items()}

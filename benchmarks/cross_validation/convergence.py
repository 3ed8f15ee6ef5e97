"""Convergence of the engines' difference with Exudyn's step, and its limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from benchmarks.cross_validation.gaps import by_quantity, exudyn_run, gaps, reference_run
from benchmarks.cross_validation.robots import chain, flexible, imported, rigid, stiffening, use
from benchmarks.cross_validation.statics import FRICTION
from robot_model import JointPD, MultiSine, Reference, Robot

__all__ = ["QUANTITIES", "STUDIES", "Course", "Study", "course"]

#: Compared quantities: positions, velocities, modal coordinates, constraint forces.
QUANTITIES: Mapping[str, tuple[str, ...]] = {
    "position": ("position", "attitude"),
    "velocity": ("velocity", "linear_velocity", "angular_velocity"),
    "modal coordinate": ("modal_coordinate", "strain", "tip_deflection"),
    "constraint force": ("radial_force", "axial_force", "bending_moment"),
    "friction": ("friction_torque",),
}


#: Those among them that accelerations give.
FORCES = ("constraint force", "friction")


@dataclass(frozen=True)
class Study:
    """One robot at decreasing steps.

    Attributes:
        name: for the page.
        robot: in smooth, short motion.
        formulation, integrator: of Exudyn.
        order: of the integrator.
        steps: of Exudyn [s], decreasing.
        goal: relative difference that the last step must reach in motion.
        force_goal: the same in constraint forces and friction, at the step of their smallest difference:
            their rounding error grows as the step shrinks.
        remark: its purpose, and what limits the convergence.
    """

    name: str
    robot: Robot
    formulation: str
    integrator: str
    order: int
    steps: Sequence[float]
    goal: float
    remark: str = ""
    force_goal: float = 1e-6


@dataclass(frozen=True)
class Course:
    """Differences along the steps of a study.

    Attributes:
        study: robot and steps.
        relative: by quantity, one for each step.
    """

    study: Study
    relative: Mapping[str, Sequence[float]]

    def order(self, quantity: str) -> float:
        """Largest observed order between neighbouring steps."""
        return max(self.orders(quantity))

    def orders(self, quantity: str) -> list[float]:
        """Observed order between neighbouring steps."""
        values, steps = self.relative[quantity], self.study.steps
        return [
            log(a / b) / log(h / k) if b > 0 else float("nan")
            for a, b, h, k in zip(values, values[1:], steps, steps[1:])
        ]

    @property
    def holds(self) -> bool:
        """The goals are reached."""
        study = self.study
        return all(
            min(values) <= study.force_goal if name in FORCES else values[-1] <= study.goal
            for name, values in self.relative.items()
        )


def course(study: Study) -> Course:
    """Run a study."""
    reference = reference_run(study.robot)
    found: dict[str, list[float]] = {}
    for step in study.steps:
        run = exudyn_run(study.robot, formulation=study.formulation, integrator=study.integrator, step=step)
        every = by_quantity(gaps(reference, run))
        for name, members in QUANTITIES.items():
            values = [every[member] for member in members if member in every]
            if values:
                found.setdefault(name, []).append(max(values))
    return Course(study, found)


#: Frequency of the joint sines [Hz]: less than a quarter of a period in a run, so that no joint reverses.
FREQUENCY = 1.5
#: Duration of the runs [s], and instants compared in one.
DURATION, SAMPLES = 0.05, 10


def _moving(
    robot: Robot,
    *,
    speeds: tuple[float, ...],
    frequency: float = FREQUENCY,
    duration: float = DURATION,
) -> Robot:
    """The robot from a start in motion, its joints following sines that start with that motion."""
    rate = 2 * np.pi * frequency
    waves = tuple(
        MultiSine(
            joint=joint.name,
            amplitudes=(abs(speed) / rate,),
            frequencies=(frequency,),
            phases=(0.0 if speed > 0 else np.pi,),
            ramp=0.0,
        )
        for joint, speed in zip(robot.moving_joints, speeds)
    )
    joints = tuple(
        joint.model_copy(update={"initial_velocity": speed}) for joint, speed in zip(robot.joints, speeds)
    )
    reference = Reference(duration=duration, sample_rate=SAMPLES / duration, joints=waves)
    controller = JointPD(kp=60.0, kd=6.0)
    return robot.model_copy(update={"joints": joints, "reference": reference, "controller": controller})


def _turning() -> Robot:
    """The arm moving slowly with a reversing reference: both joints reverse within the run."""
    robot = _moving(rigid(), speeds=(-1.0, 1.2))
    slow = (0.05, -0.06)
    joints = tuple(j.model_copy(update={"initial_velocity": v}) for j, v in zip(robot.joints, slow))
    return robot.model_copy(update={"joints": joints, "controller": JointPD(kp=200.0, kd=20.0)})


_ARM = _moving(rigid(), speeds=(3.0, -4.0))
_LONG = _moving(rigid(), speeds=(1.5, -2.0), frequency=1.0, duration=0.1)
_BENT = _moving(flexible(modes=2), speeds=(1.5, -1.2))
_STIFF = _moving(stiffening(flexible(modes=2)), speeds=(1.5, -1.2))
_IMPORTED = _moving(imported("frame", modes=2), speeds=(1.5, -1.2, 0.9))
_CHAIN = _moving(chain(), speeds=(1.5, -1.2))


def _rubbing(law: str, robot: Robot = _ARM) -> Robot:
    effect, parameters = FRICTION[law]
    return robot.with_effects(*(use(effect, joint.name, **parameters) for joint in robot.moving_joints))


_HALVES = (1e-3, 2.5e-4, 6.25e-5)
_FINE = (*_HALVES, 1.5625e-5)
_FINEST = (*_FINE, 5e-6)

STUDIES: tuple[Study, ...] = (
    Study(
        "rigid, tree, Runge-Kutta",
        _ARM,
        "tree",
        "runge-kutta",
        6,
        (5e-3, 2.5e-3, 1.25e-3, 6.25e-4),
        1e-10,
        "Minimal coordinates have no constraint forces. It ends at the tolerance of the reference run.",
    ),
    Study("rigid, tree, trapezoidal", _ARM, "tree", "trapezoidal", 2, _FINE, 1e-7),
    Study(
        "rigid, constraints, trapezoidal",
        _LONG,
        "redundant",
        "trapezoidal",
        2,
        _FINEST,
        1e-9,
        "The solver's own constraint forces have rounding divided by the step, so they are computed from "
        "accelerations that satisfy the constraints at the state itself: these converge to the end.",
        force_goal=1e-9,
    ),
    Study(
        "flexible, constraints, trapezoidal",
        _BENT,
        "redundant",
        "trapezoidal",
        2,
        _FINEST,
        1e-7,
        force_goal=1e-7,
    ),
    Study(
        "flexible on flexible, constraints, trapezoidal",
        _CHAIN,
        "redundant",
        "trapezoidal",
        2,
        _FINE,
        1e-5,
        "The second joint sits on a node that moves and turns with the first link's modes. Their frequencies "
        "reach 200 Hz.",
        force_goal=1e-5,
    ),
    Study(
        "flexible that stiffens, constraints, trapezoidal",
        _STIFF,
        "redundant",
        "trapezoidal",
        2,
        _FINE,
        1e-6,
        "Stiffening is inertia of our own on the coordinates of Exudyn's modal body.",
    ),
    Study(
        "imported finite elements, constraints, trapezoidal",
        _IMPORTED,
        "redundant",
        "trapezoidal",
        2,
        _FINE,
        1e-4,
        "A frame of beams from a file, its consistent masses coupling displacements with rotations.",
        force_goal=1e-4,
    ),
    *(
        Study(f"rigid with {law}", _rubbing(law), "redundant", "trapezoidal", 2, _FINE, 1e-6)
        for law in ("Coulomb", "Stribeck", "LuGre", "LuGre with load")
    ),
    Study(
        "flexible with LuGre with load",
        _rubbing("LuGre with load", _BENT),
        "redundant",
        "trapezoidal",
        2,
        _FINE,
        1e-6,
    ),
    Study(
        "rigid with Coulomb through a reversal, fixed steps",
        _rubbing("Coulomb", _turning()),
        "redundant",
        "trapezoidal",
        2,
        _FINE,
        1e-2,
        "Dry friction changes its sign within 1e-4 rad/s, in some microseconds: longer steps sample the "
        "reversal at random, and the order is lost.",
        force_goal=1.0,
    ),
    Study(
        "the same under local error control",
        _rubbing("Coulomb", _turning()),
        "redundant",
        "adaptive",
        2,
        _HALVES,
        1e-5,
        "Steps shrink to the width of the reversal there. Friction itself lags by the error of the velocity "
        "over 1e-4 rad/s.",
        force_goal=1e-2,
    ),
)

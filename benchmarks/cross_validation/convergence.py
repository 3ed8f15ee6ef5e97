"""How the difference of the engines falls as Exudyn's step shrinks, and where and why it stops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from benchmarks.cross_validation.gaps import by_quantity, exudyn_run, gaps, reference_run
from benchmarks.cross_validation.robots import flexible, rigid, use
from benchmarks.cross_validation.statics import CONTROLLERS, FRICTION
from robot_model import JointPD, MultiSine, Reference, Robot

__all__ = ["QUANTITIES", "STUDIES", "Course", "Study", "course"]

#: What is followed: positions, velocities, modal coordinates, constraint forces.
QUANTITIES: Mapping[str, tuple[str, ...]] = {
    "position": ("position", "attitude"),
    "velocity": ("velocity", "linear_velocity", "angular_velocity"),
    "modal coordinate": ("modal_coordinate", "strain", "tip_deflection"),
    "constraint force": ("radial_force", "axial_force", "bending_moment"),
    "friction": ("friction_torque",),
}


@dataclass(frozen=True)
class Study:
    """One robot followed at falling steps.

    Attributes:
        name: for the page.
        robot: in smooth, short motion.
        formulation, integrator: of Exudyn.
        order: of the integrator.
        steps: of Exudyn [s], falling.
        goal: relative difference that the last step must reach in every quantity.
        remark: why it is this one, and what stops it.
    """

    name: str
    robot: Robot
    formulation: str
    integrator: str
    order: int
    steps: Sequence[float]
    goal: float
    remark: str = ""


@dataclass(frozen=True)
class Course:
    """Differences along the steps of a study.

    Attributes:
        study: what was followed.
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
    def last(self) -> float:
        """Largest difference at the last step."""
        return max(values[-1] for values in self.relative.values())

    @property
    def holds(self) -> bool:
        """The goal is reached."""
        return self.last <= self.study.goal


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


def _moving(robot: Robot, *, speeds: tuple[float, float], duration: float, sine: float = 0.05) -> Robot:
    """The robot from a start in motion, its joints led along sines that begin with that motion."""
    rate = 2 * np.pi * FREQUENCY
    waves = tuple(
        MultiSine(
            joint=joint.name,
            amplitudes=(abs(speed) / rate,),
            frequencies=(FREQUENCY,),
            phases=(0.0 if speed > 0 else np.pi,),
            ramp=0.0,
        )
        for joint, speed in zip(robot.moving_joints, speeds)
    )
    joints = tuple(
        joint.model_copy(update={"initial_velocity": speed}) for joint, speed in zip(robot.joints, speeds)
    )
    reference = Reference(duration=duration, sample_rate=10 / duration, joints=waves)
    controller = JointPD(kp=60.0, kd=6.0)
    return robot.model_copy(update={"joints": joints, "reference": reference, "controller": controller})


#: Of the sines that lead the joints [Hz]: slow beside the run, so that no joint turns back.
FREQUENCY = 1.0

_ARM = _moving(rigid(), speeds=(1.5, -2.0), duration=0.1)
_BENT = _moving(flexible(modes=2), speeds=(0.8, -0.6), duration=0.05)


def _rubbing(law: str) -> Robot:
    effect, parameters = FRICTION[law]
    return _ARM.with_effects(*(use(effect, joint.name, **parameters) for joint in _ARM.moving_joints))


_HALVES = (8e-4, 2e-4, 5e-5)
_FINE = (*_HALVES, 1.25e-5)

STUDIES: tuple[Study, ...] = (
    Study(
        "rigid, tree, Runge-Kutta",
        _ARM,
        "tree",
        "runge-kutta",
        6,
        (1e-2, 5e-3, 2.5e-3, 1.25e-3),
        1e-10,
        "minimal coordinates: no constraint forces",
    ),
    Study("rigid, tree, trapezoidal", _ARM, "tree", "trapezoidal", 2, _FINE, 1e-8),
    Study("rigid, constraints, trapezoidal", _ARM, "redundant", "trapezoidal", 2, (*_FINE, 3e-6), 1e-9),
    Study("flexible, constraints, trapezoidal", _BENT, "redundant", "trapezoidal", 2, (*_FINE, 3e-6), 1e-7),
    *(
        Study(f"rigid with {law}", _rubbing(law), "redundant", "trapezoidal", 2, _FINE, 1e-6)
        for law in ("Coulomb", "Stribeck", "LuGre", "LuGre with load")
    ),
)

"""Formulas of both engines at the same random states, without motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.cross_validation.robots import (
    ROBOTS,
    ball_robot,
    chain,
    flexible,
    imported,
    rigid,
    slide_robot,
    use,
)
from benchmarks.cross_validation.states import (
    of_exudyn,
    of_reference,
    random_states,
)
from robot_model import (
    AdaptiveNetwork,
    ComputedTorque,
    Controller,
    JointPD,
    MultiSine,
    NoController,
    Robot,
    SlidingMode,
    VoltageServo,
)

__all__ = [
    "CONTROLLERS",
    "FRICTION",
    "ROUNDING",
    "Agreement",
    "agreements",
    "control_subjects",
    "equation_subjects",
    "friction_subjects",
]

Array = NDArray[np.float64]

#: Relative rounding error of sums of some thousand products and of one matrix inverse.
ROUNDING = 1e-11
#: Quantities with a separate bound.
BOUNDS = {
    # The smallest eigenvalue of the mass matrix is 1e-3 of the largest: what rounding leaves grows as much.
    "accelerations": 1e-10,
    # Sums of weights, inertia and elastic forces that cancel, each as exact as the accelerations at best.
    "bearing loads": 1e-10,
    # Taken from short steps of the twin's law, whose rounding is divided by the step, see `states`.
    "rates of bristles and lags": 1e-7,
}

MOTIONS = tuple(
    MultiSine(joint=joint, amplitudes=(0.4, 0.1), frequencies=(0.7, 1.9), phases=(0.3, 1.1), ramp=0.5)
    for joint in ("shoulder", "elbow")
)
GAINS = {"kp": (90.0, 60.0), "kd": (11.0, 7.0)}
HELD = {"base_kp": 25.0, "base_kd": 10.0}
SLIDING = {"slope": (6.0, 4.0), "rate": (3.0, 5.0), "boundary_layer": (0.3, 0.4)}
NETWORK = {"centres": 7, "width": 0.6, "adaptation": 300.0, "leakage": 0.02}
#: Random states are many half ranges of the reference away: basis functions this wide reach them.
WIDE = 20.0
FEEDFORWARD = {"coulomb_feedforward": (0.5, 0.3), "load_feedforward": (0.3, 0.1)}

CONTROLLERS: Mapping[str, Controller] = {
    "none": NoController(),
    "PD": JointPD(**GAINS),
    "PID with gravity feed-forward": JointPD(**GAINS, ki=40.0, gravity_feedforward=True),
    "PD with friction feed-forward": JointPD(**GAINS, **FEEDFORWARD),
    "computed torque": ComputedTorque(**GAINS),
    "computed torque, full model": ComputedTorque(**GAINS, model="full"),
    "computed torque with friction feed-forward": ComputedTorque(**GAINS, **FEEDFORWARD),
    "computed torque, full model, with friction feed-forward": ComputedTorque(
        **GAINS, **FEEDFORWARD, model="full"
    ),
    "computed torque that holds the base": ComputedTorque(**GAINS, **HELD),
    "the same with friction feed-forward": ComputedTorque(**GAINS, **HELD, **FEEDFORWARD),
    "computed torque, full model, that holds the base": ComputedTorque(**GAINS, **HELD, model="full"),
    "voltage servo": VoltageServo(gain=8.0, supply=24.0),
    "sliding mode, constant rate": SlidingMode(**SLIDING),
    "sliding mode, exponential": SlidingMode(
        **SLIDING, reaching="exponential", proportional=(3.0, 5.0), model="full"
    ),
    "adaptive network": AdaptiveNetwork(**GAINS, **NETWORK),
    "adaptive network, wide, full model": AdaptiveNetwork(
        **GAINS, **{**NETWORK, "width": WIDE}, model="full"
    ),
}

_LEVELS = {"coulomb_torque": 0.8, "static_torque": 1.3, "stribeck_velocity": 0.05}
_BRISTLE = {**_LEVELS, "bristle_stiffness": 800.0, "bristle_damping": 2.0}
_LOADED = {
    "load_coefficient": 0.3,
    "load_static_coefficient": 0.5,
    "load_stiffness": 300.0,
    "load_damping": 2.0,
    "load_viscosity": 0.05,
}

#: Name to effect and parameters of every friction law.
FRICTION: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "viscous": ("viscous_friction", {"coefficient": 0.7}),
    "Coulomb": ("coulomb_friction", {"torque": 0.8}),
    "Stribeck": ("stribeck_friction", _LEVELS),
    "Stribeck with load and gear": (
        "stribeck_friction",
        {**_LEVELS, "load_coefficient": 0.3, "load_static_coefficient": 0.5, "gear_share": 0.05},
    ),
    "LuGre": ("lugre_friction", _BRISTLE),
    "LuGre with load": ("lugre_friction", {**_BRISTLE, **_LOADED}),
    "load-dependent": ("load_dependent_friction", {"coefficient": 0.4, "gear_share": 0.1}),
    "asymmetric": ("asymmetric_friction", {"coulomb_difference": 0.3, "viscous_difference": 0.2}),
    "position-dependent": ("position_dependent_friction", {"cosine": 0.3, "sine": 0.2, "order": 3.0}),
}


@dataclass(frozen=True)
class Subject:
    """A comparison.

    Attributes:
        name: for the page.
        robot: the description.
        states: number of random states.
        formulation: of Exudyn.
    """

    name: str
    robot: Robot
    states: int = 5
    formulation: str = "redundant"


@dataclass(frozen=True)
class Agreement:
    """The worst relative difference of one quantity over all states of a subject.

    Attributes:
        subject, quantity: what of what.
        worst: largest difference over the largest entry, of the worst state.
        bound: what it must stay below.
    """

    subject: str
    quantity: str
    worst: float
    bound: float

    @property
    def holds(self) -> bool:
        """Whether the difference is within its bound; NaN is not."""
        return self.worst <= self.bound


def agreements(subject: Subject, *, seed: int = 1) -> list[Agreement]:
    """Every common quantity of both engines at random states of a subject."""
    robot = subject.robot
    states = list(random_states(robot, subject.states, seed=seed))
    ours = of_reference(robot, states)
    theirs = of_exudyn(robot, states, formulation=subject.formulation)
    found = []
    for quantity in (name for name in ours[0] if name in theirs[0]):
        pairs = [(a[quantity], b[quantity]) for a, b in zip(ours, theirs)]
        worst = max(_relative(a, b) for a, b in pairs)
        found.append(Agreement(subject.name, quantity, worst, BOUNDS.get(quantity, ROUNDING)))
    return found


def _relative(first: Array, second: Array) -> float:
    if first.shape != second.shape:
        return float("inf")
    if not first.size:
        return 0.0
    gap, size = float(np.abs(first - second).max()), float(np.abs(first).max())
    return gap / size if size > 0 else gap


def equation_subjects() -> Iterator[Subject]:
    """Equations of motion of every robot."""
    for robot in ROBOTS:
        yield Subject(f"{robot.name}; constraints", robot)
        if not robot.flexible_links and not robot.spherical_joints:
            yield Subject(f"{robot.name}; tree", robot, formulation="tree")


def control_subjects() -> Iterator[Subject]:
    """Every controller, in motion, on rigid and flexible robots."""
    for name, controller in CONTROLLERS.items():
        for robot in (rigid(), rigid(base="fixed"), flexible(), ball_robot()):
            if robot.spherical_joints:
                controller = _for_one(controller)
            if robot.base.kind == "fixed" and getattr(controller, "base_kp", None) is not None:
                continue
            moving = robot.model_copy(
                update={
                    "controller": controller,
                    "reference": robot.reference.model_copy(  # type: ignore[union-attr]
                        update={"joints": MOTIONS[: len(robot.moving_joints)]}
                    ),
                }
            )
            yield Subject(f"{name}; {robot.name}", moving)


def _for_one(controller: Controller) -> Controller:
    """With the settings of the first joint alone."""
    kept = {key: value[:1] if isinstance(value, tuple) else value for key, value in dict(controller).items()}
    return controller.model_copy(update=kept)


def friction_subjects() -> Iterator[Subject]:
    """Every friction law in both joints, with bearing loads of Exudyn's constraints."""
    for name, (effect, parameters) in FRICTION.items():
        for robot in (rigid(), flexible()):
            rubbing = robot.model_copy(update={"controller": CONTROLLERS["PD"]}).with_effects(
                *(use(effect, joint.name, **parameters) for joint in robot.moving_joints)
            )
            yield Subject(f"{name}; {robot.name}", rubbing)
    effect, parameters = FRICTION["LuGre with load"]
    for robot in (chain(), imported("frame")):
        rubbing = robot.model_copy(update={"controller": JointPD(kp=50.0, kd=5.0)})
        loaded = [use(effect, joint.name, **parameters) for joint in robot.moving_joints]
        yield Subject(f"LuGre with load; {robot.name}", rubbing.with_effects(*loaded))
    guide = slide_robot(controller=JointPD(kp=50.0, kd=5.0)).with_effects(
        use("lugre_friction", "slide", **_BRISTLE, **_LOADED)
    )
    yield Subject(f"LuGre with load on a guide; {guide.name}", guide)

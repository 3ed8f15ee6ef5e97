"""Seeded faults: does the cross-validation detect errors?

Each fault is introduced into one engine by replacing a function while the checks run; no file is changed. All
of them are in `faults`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import reference_model.flexible.body as flexible_body
from benchmarks.cross_validation.gaps import by_quantity, exudyn_run, gaps, reference_run
from benchmarks.cross_validation.robots import (
    chain,
    coupled,
    flexible,
    imported,
    rigid,
    slide_robot,
    stiffening,
    use,
)
from benchmarks.cross_validation.statics import CONTROLLERS, FRICTION, MOTIONS, Subject, agreements
from exudyn_model.bodies import flexible_link
from exudyn_model.bodies.beam import beam_shapes
from robot_model import ComputedTorque, Reference, Robot

__all__ = ["Caught", "Fault", "caught", "quick_subjects", "scaled", "seeded"]

#: Relative difference of a short smooth motion that both engines integrate to rounding.
MOTION_BOUND = 1e-8


@dataclass(frozen=True)
class Fault:
    """A seeded fault.

    Attributes:
        engine: "Exudyn twin" or "reference".
        what: the fault in words.
        places: object and name of the replaced function, and the function that makes its replacement.
    """

    engine: str
    what: str
    places: Sequence[tuple[Any, str, Callable[[Any], Any]]]


@dataclass(frozen=True)
class Caught:
    """The first detection of a fault: subject, quantity, relative difference and its bound."""

    subject: str
    quantity: str
    difference: float
    bound: float


def quick_subjects() -> Iterator[Subject]:
    """A few robots that together exercise every term of the quick checks."""

    def with_all(robot: Robot, controller: str, *effects: tuple[str, str]) -> Robot:
        assert robot.reference is not None
        reference = robot.reference.model_copy(update={"joints": MOTIONS})
        made = robot.model_copy(update={"controller": CONTROLLERS[controller], "reference": reference})
        return made.with_effects(*(use(FRICTION[law][0], at, **FRICTION[law][1]) for law, at in effects))

    held = "the same with friction feed-forward"
    laws = ("LuGre with load", "shoulder"), ("Stribeck with load and gear", "elbow")
    yield Subject("free rigid arm, held", with_all(rigid(), held, *laws), states=2)
    laws = ("Stribeck", "one"), ("viscous", "two"), ("Coulomb", "elbow")
    yield Subject(
        "fixed arm on motors that move both joints",
        with_all(coupled(rigid(base="fixed")), "computed torque", *laws),
        states=2,
    )
    pid = with_all(
        flexible(base="fixed"), "PID with gravity feed-forward", ("Coulomb", "elbow"), ("LuGre", "shoulder")
    )
    yield Subject("flexible arm under gravity", pid, states=2)
    loaded = ("LuGre with load", "slide"), ("load-dependent", "elbow")
    branched = with_all(slide_robot(), "none", *loaded)
    branched = branched.model_copy(update={"controller": ComputedTorque(kp=60.0, kd=7.0)})
    yield Subject("branched arm", branched, states=2)
    yield Subject(
        "stiffening arm on a flexible arm",
        with_all(stiffening(chain()), "computed torque, full model"),
        states=2,
    )
    full = imported("frame").model_copy(update={"controller": ComputedTorque(kp=60.0, kd=6.0, model="full")})
    yield Subject("arm with an imported link", full, states=2)
    for name, controller in (
        ("fixed arm on servos", "voltage servo"),
        ("fixed arm in sliding mode", "sliding mode, exponential"),
        ("fixed arm that learns", "adaptive network, wide, full model"),
    ):
        yield Subject(name, with_all(rigid(base="fixed"), controller), states=2)


def smooth_motion() -> Robot:
    """A free arm that starts in motion, for a trajectory of some hundredths of a second."""
    robot = rigid(reference=Reference(duration=0.05, sample_rate=200.0, joints=MOTIONS))
    speeds = {"shoulder": 1.5, "elbow": -2.0}
    joints = [joint.model_copy(update={"initial_velocity": speeds[joint.name]}) for joint in robot.joints]
    return robot.model_copy(update={"joints": tuple(joints), "controller": CONTROLLERS["computed torque"]})


def caught() -> Caught | None:
    """The first quick check that fails, formulas before motion; None when all hold."""
    for subject in quick_subjects():
        for item in agreements(subject):
            if not item.holds:
                return Caught(item.subject, item.quantity, item.worst, item.bound)
    robot = smooth_motion()
    found = by_quantity(
        gaps(reference_run(robot), exudyn_run(robot, integrator="runge-kutta", formulation="tree", step=1e-3))
    )
    for quantity, difference in found.items():
        if not difference <= MOTION_BOUND:
            return Caught("free rigid arm in motion", quantity, difference, MOTION_BOUND)
    return None


@contextmanager
def seeded(fault: Fault) -> Iterator[None]:
    """Context in which the fault is active."""
    with ExitStack() as stack:
        for owner, name, made in fault.places:
            stack.enter_context(_exchanged(owner, name, made))
        yield


@contextmanager
def _exchanged(owner: Any, name: str, made: Callable[[Any], Any]) -> Iterator[None]:
    before = vars(owner)[name] if isinstance(owner, type) else getattr(owner, name)
    setattr(owner, name, made(before))
    _forget()
    try:
        yield
    finally:
        setattr(owner, name, before)
        _forget()


def _forget() -> None:
    """Clear bodies and modes cached by both engines."""
    beam_shapes.cache_clear()
    flexible_link._beam.cache_clear()
    flexible_link._read.cache_clear()
    for value in vars(flexible_body).values():
        if hasattr(value, "cache_clear"):
            value.cache_clear()


def scaled(factor: float) -> Callable[[Any], Any]:
    """Wraps a function so that its result is multiplied by a factor."""
    return lambda function: lambda *a, **k: factor * function(*a, **k)

"""Seeded faults: does the cross-validation see what it is there for?

Each fault is put into one engine by exchanging a function while the checks run; no file is changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

import exudyn_model.control as twin_control
import exudyn_model.motion as twin_motion
import exudyn_model.rigid_dynamics as twin_rigid
import reference_model.acting as acting
import reference_model.control as control
import reference_model.flexible.body as flexible_body
import reference_model.flexible.integrals as integrals
import reference_model.plant as plant
import reference_model.symbolic as symbolic
from benchmarks.cross_validation.gaps import by_quantity, exudyn_run, gaps, reference_run
from benchmarks.cross_validation.robots import chain, flexible, imported, rigid, slide_robot, stiffening, use
from benchmarks.cross_validation.statics import CONTROLLERS, FRICTION, MOTIONS, Subject, agreements
from exudyn_model import flexible_link, shortening
from exudyn_model import imported as twin_imported
from exudyn_model.beam import beam_shapes
from exudyn_model.bearing import Load
from exudyn_model.effects import friction as twin_friction
from exudyn_model.full_dynamics import FullDynamics
from exudyn_model.mechanism import Mass
from exudyn_model.moments import Surplus
from exudyn_model.redundant import bodies as twin_bodies
from exudyn_model.redundant import drive as twin_drive
from exudyn_model.redundant import modal_body, parts, weld
from exudyn_model.rotation import from_quaternion
from robot_model import ComputedTorque, Reference, Robot

__all__ = ["FAULTS", "Caught", "Fault", "caught", "quick_subjects", "seeded"]

#: Relative difference of a short smooth motion that both engines integrate to rounding.
MOTION_BOUND = 1e-8


@dataclass(frozen=True)
class Fault:
    """A seeded fault.

    Attributes:
        engine: "Exudyn twin" or "reference".
        what: is wrong.
        places: object and name of what is exchanged, and the function that makes its stand-in from it.
    """

    engine: str
    what: str
    places: Sequence[tuple[Any, str, Callable[[Any], Any]]]


@dataclass(frozen=True)
class Caught:
    """What saw a fault first: subject, quantity, and the relative difference there beside its bound."""

    subject: str
    quantity: str
    difference: float
    bound: float


def quick_subjects() -> Iterator[Subject]:
    """Few robots that together exercise every term the quick checks watch."""

    def with_all(robot: Robot, controller: str, *effects: tuple[str, str]) -> Robot:
        assert robot.reference is not None
        reference = robot.reference.model_copy(update={"joints": MOTIONS})
        made = robot.model_copy(update={"controller": CONTROLLERS[controller], "reference": reference})
        return made.with_effects(*(use(FRICTION[law][0], at, **FRICTION[law][1]) for law, at in effects))

    held = "the same with friction feed-forward"
    laws = ("LuGre with load", "shoulder"), ("Stribeck with load and gear", "elbow")
    yield Subject("free rigid arm, held", with_all(rigid(), held, *laws), states=2)
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
    yield Subject("fixed arm on servos", with_all(rigid(base="fixed"), "voltage servo"), states=2)


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
    """The fault is there inside this context."""
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
    """Bodies and modes made before, which both engines keep."""
    beam_shapes.cache_clear()
    flexible_link._beam.cache_clear()
    flexible_link._read.cache_clear()
    for value in vars(flexible_body).values():
        if hasattr(value, "cache_clear"):
            value.cache_clear()


def _scaled(factor: float) -> Callable[[Any], Any]:
    return lambda function: lambda *a, **k: factor * function(*a, **k)


def _without_steiner(_: Any) -> Any:
    def of(body: Any) -> Mass:
        return Mass(body.mass, body.mass * np.asarray(body.center_of_mass), body.inertia_matrix)

    return staticmethod(of)


def _products_exchanged(add_mass: Any) -> Any:
    def exchanged(mbs: Any, node: int, mass: Mass, **keys: Any) -> int:
        j = mass.inertia.copy()
        j[0, 2], j[1, 2] = mass.inertia[1, 2], mass.inertia[0, 2]
        j[2, 0], j[2, 1] = j[0, 2], j[1, 2]
        return int(add_mass(mbs, node, replace(mass, inertia=j), **keys))

    return exchanged


def _rotors_by(factor: float) -> Callable[[Any], Any]:
    def made(start: Any) -> Any:
        def changed(self: Any, *a: Any, rotors: Sequence[float], **k: Any) -> None:
            start(self, *a, rotors=[factor * rotor for rotor in rotors], **k)

        return changed

    return made


def _stribeck_exponent(_: Any) -> Any:
    def level(velocity: float, *, coulomb: float, static: float, stribeck_velocity: float) -> float:
        return coulomb + (static - coulomb) * float(np.exp(-abs(velocity) / stribeck_velocity))

    return level


def _arms_exchanged(moment: Any) -> Any:
    def exchanged(self: Load, bearing: Any) -> float:
        arms = {"radial_arm": bearing.axial_arm, "axial_arm": bearing.radial_arm}
        return float(moment(self, bearing.model_copy(update=arms)))

    return exchanged


def _bristle_with_sign(advance: Any) -> Any:
    def changed(self: Any, now: Any, memory: Any) -> Any:
        force, (z,) = advance(self, now, memory)
        level = self._floored(now.velocity, now.command, now.load)
        slip = self._stiffness(now.load) * now.velocity * z / level  # |v| z / g without the bars
        return force + 2 * self.bristle_damping * min(slip, 0.0), (z,)

    return changed


def _without_velocity(outward: Any) -> Any:
    return lambda *a, rate, **k: outward(*a, rate=0.0, **k)


def _hertz(shapes: Any) -> Any:
    return lambda beam: replace(shapes(beam), frequencies=shapes(beam).frequencies / (2 * pi))


def _unbent(add: Any) -> Any:
    """The weight's moment without S0 x: modes get their share, the frame that of the undeformed body."""

    def weigh(mbs: Any, nodes: Any, moments: Any, surplus: Any, gravity: Any) -> Any:
        moved, still = moments.first[:, 1:], moments.first.copy()
        still[:, 1:] = 0.0
        add(mbs, nodes, replace(moments, first=still), surplus, gravity)
        items = modal_body.items

        def pull(_: Any, time: float, item: int, q: Any, v: Any) -> Any:
            rest = np.array(mbs.GetNode(nodes[0])["referenceCoordinates"][3:7])
            down = from_quaternion(rest + np.array(q[3:7])).T @ gravity
            return np.concatenate([np.zeros(7), moved.T @ down])

        if np.any(gravity):
            mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=list(nodes), forceUserFunction=pull))

    return weigh


def _straight(motion: Any) -> Any:
    """Nodes where the straight link has them."""

    def changed(self: Any, node: int, x: Any, v: Any) -> Any:
        found = motion(self, node, x, v)
        still = np.zeros(3)
        return replace(found, place=self.nodes[node], slide=0 * found.slide, slides=still)

    return changed


def _unturned(motion: Any) -> Any:
    """A joint's frame that does not turn with its node."""

    def changed(self: Any, link: Any, index: int) -> None:
        motion(self, link, index)
        self._half = 0 * self._half

    return changed


def _modes_held(needed: Any) -> Any:
    """Modal rates forgotten in the controller's model."""

    def changed(self: Any, *a: Any, inner: Any = None, **k: Any) -> Any:
        return needed(self, *a, inner=inner and replace(inner, modal_rates=0 * inner.modal_rates), **k)

    return changed


def _without_gyroscopic(masses: Any) -> Any:
    def changed(*a: Any, **k: Any) -> Any:
        bodies, *rest = masses(*a, **k)
        still = {
            index: replace(body, force=ca.vertcat(body.force[:3], ca.SX(3, 1), body.force[6:]))
            for index, body in bodies.items()
        }
        return (still, *rest)

    return changed


def _without_bias(recursion: Any) -> Any:
    def changed(*a: Any, **k: Any) -> Any:
        return tuple(replace(state, bias=0 * state.bias) for state in recursion(*a, **k))

    return changed


def _first_only(error: Any) -> Any:
    def changed(*a: Any, **k: Any) -> Any:
        astray, drift = error(*a, **k)
        return -astray, drift

    return changed


def _with_apparent(rate: Any) -> Any:
    """omega x v of the base's velocity in base axes forgotten: put back what is taken off."""

    def changed(self: Any, parts: Any, *a: Any, **k: Any) -> Any:
        column = rate(self, parts, *a, **k)
        if self.layout.free_base:
            rows = self.layout.rows("base_velocity")
            linear, omega = parts["base_velocity"][:3], parts["base_velocity"][3:]
            column[rows.start : rows.start + 3] += ca.cross(omega, linear)
        return column

    return changed


def _half_span(load: Any) -> Any:
    def changed(kind: str, axis: Any, wrench: Any, bearing: Any) -> Any:
        span = None if bearing.span is None else bearing.span / 2
        return load(kind, axis, wrench, bearing.model_copy(update={"span": span}))

    return changed


def _turned_about_xyz(_: Any) -> Any:
    return lambda rpy: Rotation.from_euler("XYZ", rpy).as_matrix()


TWIN, REFERENCE = "Exudyn twin", "reference"

FAULTS: tuple[Fault, ...] = (
    Fault(
        TWIN,
        "Coulomb friction drives instead of braking",
        [(twin_friction.CoulombFriction, "force", _scaled(-1))],
    ),
    Fault(
        TWIN,
        "Stribeck friction falls with exponent 1",
        [(twin_friction, "stribeck_level", _stribeck_exponent)],
    ),
    Fault(
        TWIN,
        "LuGre's bristle rate with v z / g, without the bars of |v|",
        [(twin_friction.LuGreFriction, "advance", _bristle_with_sign)],
    ),
    Fault(
        TWIN, "radial and axial arm of the bearing exchanged", [(Load, "friction_moment", _arms_exchanged)]
    ),
    Fault(TWIN, "parallel-axis term of the inertia left out", [(Mass, "of", _without_steiner)]),
    Fault(
        TWIN,
        "products of inertia xz and yz exchanged",
        [
            (twin_bodies, "add_mass", _products_exchanged),
            (modal_body, "add_mass", _products_exchanged),
        ],
    ),
    Fault(
        TWIN,
        "rotor inertia with the gear ratio once, not squared",
        [(twin_drive.Drive, "__init__", _rotors_by(1 / 40))],
    ),
    Fault(TWIN, "joint frames by Rx Ry Rz instead of Rz Ry Rx", [(parts, "from_rpy", _turned_about_xyz)]),
    Fault(TWIN, "computed torque without velocity terms", [(twin_rigid, "_outward", _without_velocity)]),
    Fault(
        TWIN,
        "way back to the held attitude with the wrong sign",
        [(twin_control, "to_quaternion", lambda f: lambda r, **k: f(r.T, **k))],
    ),
    Fault(
        TWIN,
        "voltage servo without the gear ratio",
        [
            (
                twin_control,
                "_motor",
                lambda f: lambda name, motor: f(name, motor and motor.model_copy(update={"gear_ratio": 1.0})),
            )
        ],
    ),
    Fault(TWIN, "frequencies of a sine in rad/s for Hz", [(twin_motion, "pi", lambda _: 0.5)]),
    Fault(TWIN, "modal stiffness from frequencies in Hz", [(flexible_link, "beam_shapes", _hertz)]),
    Fault(TWIN, "modal damping zeta w for 2 zeta w", [(flexible_link, "damping_of", _scaled(0.5))]),
    Fault(
        TWIN,
        "gravity turns a bent link about its unbent centre of mass, as in Exudyn's own load",
        [(modal_body, "add_modal_weight", _unbent)],
    ),
    Fault(
        TWIN,
        "shortening by bending one per cent too large",
        [(shortening, "WEIGHTS", lambda weights: 1.01 * weights)],
    ),
    Fault(
        TWIN,
        "shortening takes no part in Coriolis and centrifugal forces",
        [(Surplus, "force", lambda force: lambda *a: 0 * force(*a))],
    ),
    Fault(
        TWIN,
        "masses that couple displacements with rotations left out",
        [(twin_imported, "_surplus", lambda _: lambda *a: None)],
    ),
    Fault(
        TWIN,
        "the full controller forgets the rates of bent links' modes",
        [(FullDynamics, "needed", _modes_held)],
    ),
    Fault(
        TWIN,
        "a joint stays where the straight link has it",
        [(flexible_link.FlexibleLink, "motion", _straight)],
    ),
    Fault(TWIN, "a joint's frame does not turn with its bent link", [(weld._Weld, "__init__", _unturned)]),
    Fault(
        REFERENCE, "gyroscopic moments of the bodies left out", [(symbolic, "masses", _without_gyroscopic)]
    ),
    Fault(
        REFERENCE,
        "velocity-dependent accelerations of the recursion left out",
        [(symbolic, "recursion", _without_bias)],
    ),
    Fault(
        REFERENCE,
        "rotary inertia of nodes kept constant in the link's axes",
        [(integrals, "_turned", lambda f: lambda *a: 0 * f(*a))],
    ),
    Fault(REFERENCE, "span of two bearings halved", [(symbolic, "bearing_load", _half_span)]),
    Fault(
        REFERENCE, "friction feed-forward with the wrong sign", [(control, "feedforward_sign", _scaled(-1))]
    ),
    Fault(REFERENCE, "gains in N m per degree", [(control, "_gains", _scaled(180 / pi))]),
    Fault(REFERENCE, "held base is pushed away", [(control, "base_error", _first_only)]),
    Fault(
        REFERENCE,
        "dry friction changes sign over ten times the speed",
        [(acting, "TRANSITION", lambda v: 10 * v)],
    ),
    Fault(
        REFERENCE,
        "omega x v of the base's velocity in base axes left out",
        [(plant.Plant, "_rate", _with_apparent)],
    ),
    Fault(REFERENCE, "quaternion rates with the wrong sign", [(plant, "quaternion_rate", _scaled(-1))]),
)

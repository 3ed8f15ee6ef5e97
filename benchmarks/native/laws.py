"""Joint control, viscous and Stribeck friction as symbolic user functions, which Exudyn evaluates in C++.

In Exudyn 1.13 those with vectors of more than seven numbers corrupt memory; forces on one joint need no
vectors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import exudyn.advancedUtilities

from benchmarks.native.bodies import Joined
from benchmarks.native.engine import exu, items
from benchmarks.native.lugre import Kept, add_bristles
from exudyn_model.bodies.mechanism import Mechanism
from robot_model import Cycloid, EffectUse, JointPD, MultiSine, NoController, Robot

__all__ = ["SymbolicLaws"]

sym: Any = exu.symbolic
#: Speed over which dry friction changes its sign: as in `reference_model`.
TRANSITION = 1e-4


@dataclass(frozen=True)
class SymbolicLaws:
    """The laws of a robot's joints."""

    robot: Robot

    def on_tree(self, mbs: Any, mechanism: Mechanism, first: int) -> Kept:
        """Add them to a tree whose joint coordinates start at `first`; returns objects to keep alive."""
        laws, kept = _laws(self.robot), []
        for member, k in enumerate(mechanism.coordinate, start=first):
            _coordinate_spring(mbs, member, laws[k], kept)
        add_bristles(mbs, self.robot, mechanism.coordinate, first, kept)
        return kept

    def on_bodies(self, mbs: Any, joined: Sequence[Joined]) -> Kept:
        """Add them between bodies; returns objects that must outlive the run."""
        laws, kept = _laws(self.robot), []
        order = [joint.name for joint in self.robot.moving_joints]
        for pair in joined:
            _torsional_spring(mbs, pair.markers, laws[order.index(pair.link.joint.name)], kept)
        return kept


@dataclass(frozen=True)
class Law:
    """Force on a joint: a constant damping, and a function for the rest.

    Attributes:
        damping: [N m s/rad].
        more: time, position and velocity to the rest; None without one.
    """

    damping: float
    more: Callable[[Any, Any, Any], Any] | None = None

    def __call__(self, t: Any, q: Any, v: Any) -> Any:
        found = -self.damping * v
        return found if self.more is None else found + self.more(t, q, v)


def _laws(robot: Robot) -> list[Law]:
    """Joint control, viscous and Stribeck friction of every moving joint."""
    found = []
    for k, joint in enumerate(robot.moving_joints):
        own = [use for use in robot.effects if use.at == joint.name]
        viscous = sum(use.parameters["coefficient"] for use in own if use.effect == "viscous_friction")
        parts = [] if isinstance(robot.controller, NoController) else [_control(robot, k)]
        parts += [_stribeck(use) for use in own if use.effect == "stribeck_friction"]
        found.append(Law(viscous, _sum(parts) if parts else None))
    return found


def _sum(parts: Sequence[Callable[[Any, Any, Any], Any]]) -> Callable[[Any, Any, Any], Any]:
    def law(t: Any, q: Any, v: Any) -> Any:
        total = parts[0](t, q, v)
        for part in parts[1:]:
            total = total + part(t, q, v)
        return total

    return law


def _stribeck(use: EffectUse) -> Callable[[Any, Any, Any], Any]:
    p = use.parameters
    peak = p["static_torque"] - p["coulomb_torque"]

    def law(t: Any, q: Any, v: Any) -> Any:
        ratio = v * (1 / p["stribeck_velocity"])
        return -(p["coulomb_torque"] + peak * sym.exp(-(ratio * ratio))) * sym.tanh(v * (1 / TRANSITION))

    return law


def _control(robot: Robot, k: int) -> Callable[[Any, Any, Any], Any]:
    control = robot.controller
    assert isinstance(control, JointPD)
    assert robot.reference is not None
    joint = robot.moving_joints[k]
    kp, kd = (gain if isinstance(gain, float) else gain[k] for gain in (control.kp, control.kd))
    goal = next(item for item in robot.reference.joints if item.joint == joint.name)
    motion = _multisine(goal) if isinstance(goal, MultiSine) else _cycloid(goal)

    def law(t: Any, q: Any, v: Any) -> Any:
        away, speed = motion(t)
        return kp * (joint.initial_position + away - q) + kd * (speed - v)

    return law


def _coordinate_spring(mbs: Any, coordinate: int, law: Law, kept: Kept) -> None:
    """The law as a spring between the ground and a coordinate of the first node."""
    ground = mbs.AddNode(items.NodePointGround())
    markers = [
        mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=k))
        for node, k in ((ground, 0), (0, coordinate))
    ]
    spring = mbs.AddObject(
        items.ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, damping=law.damping)
    )
    if law.more is None:
        return

    def force(
        mbs: Any,
        t: Any,
        itemNumber: Any,
        displacement: Any,
        velocity: Any,
        stiffness: Any,
        damping: Any,
        offset: Any,
    ) -> Any:
        return -law(t, displacement, velocity)

    _given(mbs, spring, "springForceUserFunction", force, kept)


def _multisine(item: MultiSine) -> Callable[[Any], tuple[Any, Any]]:
    phases = item.phases or (0.0,) * len(item.amplitudes)

    def motion(t: Any) -> tuple[Any, Any]:
        away, speed = 0.0, 0.0
        for a, f, p in zip(item.amplitudes, item.frequencies, phases):
            w = 2 * pi * f
            away, speed = away + a * sym.sin(w * t + p), speed + a * w * sym.cos(w * t + p)
        u = sym.min(t * (1 / item.ramp), sym.Real(1.0))
        fade = u * u * u * (10 + u * (6 * u - 15))
        rate = (30 / item.ramp) * (u * u) * ((1 - u) * (1 - u))
        return fade * away, fade * speed + rate * away

    return motion


def _cycloid(item: Any) -> Callable[[Any], tuple[Any, Any]]:
    assert isinstance(item, Cycloid)
    assert item.start == 0

    def motion(t: Any) -> tuple[Any, Any]:
        s = sym.min(t * (1 / item.duration), sym.Real(1.0))
        w = 2 * pi
        speed = (item.displacement / item.duration) * (1 - sym.cos(w * s))
        return item.displacement * (s - sym.sin(w * s) * (1 / w)), speed

    return motion


def _torsional_spring(mbs: Any, markers: Sequence[int], law: Law, kept: Kept) -> None:
    """The law as a spring between two bodies."""
    spring = mbs.AddObject(items.ObjectConnectorTorsionalSpringDamper(markerNumbers=markers))

    def torque(
        mbs: Any,
        t: Any,
        itemNumber: Any,
        rotation: Any,
        angularVelocity: Any,
        stiffness: Any,
        damping: Any,
        offset: Any,
    ) -> Any:
        return -law(t, rotation, angularVelocity)

    _given(mbs, spring, "springTorqueUserFunction", torque, kept)


def _given(mbs: Any, item: Any, name: str, law: Callable[..., Any], kept: Kept) -> None:
    made = exudyn.advancedUtilities.CreateSymbolicUserFunction(mbs, law, name, itemIndex=item)
    mbs.SetObjectParameter(item, name, made)
    kept.append(made)

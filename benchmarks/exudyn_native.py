"""Exudyn at its fastest: objects of its own and symbolic user functions, nothing in Python while it runs.

Rigid robots are `ObjectKinematicTree`; explicit Runge-Kutta methods can then run them, with or without
error control. Flexible ones are bodies, constraints and `ObjectFFRFreducedOrder`, for which Exudyn has
implicit methods of second order at fixed steps. Bodies and modes come from `exudyn_model`, joint control and
friction are written as symbolic user functions, which Exudyn evaluates in C++. In Exudyn 1.13 those with
vectors of more than seven numbers corrupt memory; what acts on one joint needs none, but LuGre friction
between two free bodies, whose coordinates are fourteen and a bristle, has no native form for that reason.

The bristle of LuGre friction is the rate of a coordinate w of unit mass of its own: w'' = dz/dt, w' = z.
"""

# ruff: noqa: E402  (the choice of Exudyn's module must come before its import)
from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from typing import Any

sys.exudynFast = True  # type: ignore[attr-defined]  # the module without range checks

import exudyn
import exudyn.advancedUtilities
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray

from benchmarks.manoeuvres import SAMPLES, Case, Course
from exudyn_model.mechanism import mechanism_of
from exudyn_model.redundant.bodies import Body
from exudyn_model.redundant.modal_body import ModalBody
from exudyn_model.redundant.parts import Connection, initial_poses, parts_of
from exudyn_model.redundant.system import LOCKED, made
from exudyn_model.rotation import from_quaternion, to_quaternion
from exudyn_model.simulation import initial_state
from exudyn_model.system import build
from robot_model import Cycloid, EffectUse, JointPD, MultiSine, NoController, Robot

__all__ = ["EXPLICIT", "IMPLICIT", "LONGEST_VECTOR", "NativeRun", "Setting", "module_name"]

Array = NDArray[np.float64]
exu: Any = exudyn
items: Any = exudyn.itemInterface
sym: Any = exudyn.symbolic

#: Exudyn's methods by the names used here; those with "tolerance" control their error.
EXPLICIT: Mapping[str, str] = {"RK44": "RK44", "RK67": "RK67", "DOPRI5, tolerance": "DOPRI5"}
IMPLICIT: Mapping[str, str] = {
    "trapezoidal, index 2": "TrapezoidalIndex2",
    "generalised alpha": "GeneralizedAlpha",
}
#: Exudyn 1.13 corrupts memory when a symbolic function takes vectors longer than this.
LONGEST_VECTOR = 7
#: Speed over which dry friction changes its sign, and the least level of bristles: as in `reference_model`.
TRANSITION, SMALLEST_LEVEL = 1e-4, 1e-9
#: Symbolic functions must live as long as the items that use them.
Kept = list[Any]


@dataclass(frozen=True)
class Setting:
    """How a run is made: a method and its number of steps, or its tolerance."""

    method: str
    steps: int = 0
    tolerance: float = 0.0


@dataclass
class NativeRun:
    """One assembled system, to be run once.

    Attributes:
        case: the motion.
        setting: method and step.
    """

    case: Case
    setting: Setting
    _kept: Kept = field(default_factory=list)

    def __post_init__(self) -> None:
        exu.config.printToConsole, exu.config.suppressWarnings = False, True
        self._make = _Tree if not self.case.flexible else _Bodies
        self._system = self._make(self.case.robot, self._kept)
        self._settings = _settings(self.case.duration, self.setting)
        name = {**EXPLICIT, **IMPLICIT}[self.setting.method]
        self._method = getattr(exu.DynamicSolverType, name)

    def __call__(self) -> None:
        """Run; this alone is timed."""
        self._done = self._system.mbs.SolveDynamic(self._settings, solverType=self._method)

    def course(self) -> Course:
        """What it gave."""
        return self._system.course()


def _settings(duration: float, setting: Setting) -> Any:
    found = exu.SimulationSettings()
    integration = found.timeIntegration
    integration.endTime = duration
    integration.numberOfSteps = setting.steps or SAMPLES
    integration.verboseMode = 0
    integration.automaticStepSize = bool(setting.tolerance)
    integration.relativeTolerance, integration.absoluteTolerance = setting.tolerance, 1e-2 * setting.tolerance
    integration.explicit.computeEndOfStepAccelerations = False
    integration.newton.useModifiedNewton = True
    found.solution.file.write = False
    found.solution.sensors.writePeriod = duration / SAMPLES
    return found


class _Tree:
    """A rigid robot in minimal coordinates."""

    def __init__(self, robot: Robot, kept: Kept) -> None:
        self._mechanism = mechanism_of(robot)
        state = initial_state(robot, self._mechanism)
        first = 6 if self._mechanism.free else 0
        system = build(self._mechanism, state, lambda t, x, v: [0.0] * (first + len(robot.moving_joints)))
        self.mbs, self._placement, self._container = system.mbs, system.placement, system.container
        # The tree's own force comes from Python; the joints' springs take its place.
        self.mbs.SetObjectParameter(0, "forceUserFunction", 0)
        laws = _laws(robot)
        for member, k in enumerate(self._mechanism.coordinate, start=first):
            _coordinate_spring(self.mbs, member, laws[k], kept)
        _bristles(self.mbs, robot, self._mechanism.coordinate, first, kept)
        self._sensor = _watched(self.mbs, 0)
        self.mbs.Assemble()

    def course(self) -> Course:
        rows = self.mbs.GetSensorStoredData(self._sensor)
        time, x = rows[:, 0], rows[:, 1:]
        first = self._placement.base_coordinates
        joints = np.empty((len(time), len(self._mechanism.coordinate)))
        joints[:, list(self._mechanism.coordinate)] = x[:, first:]
        if not first:
            return Course(time, joints)
        turns = [to_quaternion(self._placement.base(row, np.zeros_like(row)).rotation) for row in x]
        return Course(time, np.hstack([joints, x[:, :3], turns]))


def _watched(mbs: Any, node: int) -> Any:
    kind = exu.OutputVariableType.Coordinates
    return mbs.AddSensor(items.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind))


@dataclass(frozen=True)
class Law:
    """Force on a joint: a constant damping, and a function where that is not all.

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


class _Bodies:
    """A flexible robot as bodies and constraints."""

    def __init__(self, robot: Robot, kept: Kept) -> None:
        self._robot = robot
        self._parts, self._connections = parts_of(robot, {}, {})
        poses = initial_poses(robot, self._parts, self._connections)
        self._container = exu.SystemContainer()
        self.mbs = self._container.AddSystem()
        gravity = np.asarray(robot.gravity, dtype=float)
        still = robot.base.kind == "fixed"
        self._bodies: list[Body] = [
            made(self.mbs, part, pose, gravity=gravity, flexible="modal", fixed=still and k == 0)
            for k, (part, pose) in enumerate(zip(self._parts, poses))
        ]
        laws = _laws(robot)
        order = [joint.name for joint in robot.moving_joints]
        for link in self._connections:
            self._connect(link, laws[order.index(link.joint.name)], kept)
        self._frames = [_watched(self.mbs, body.frames[0]) for body in self._bodies]
        self._modes = {
            k: _watched(self.mbs, body.modal)
            for k, body in enumerate(self._bodies)
            if isinstance(body, ModalBody)
        }
        self.mbs.Assemble()

    def _connect(self, link: Connection, law: Law, kept: Kept) -> None:
        mbs = self.mbs
        outer = self._bodies[link.parent].place(mbs, link.origin, link.rotation @ link.align)
        inner = self._bodies[link.child].place(mbs, np.zeros(3), link.align)
        markers = [outer.marker, inner.marker]
        mbs.AddObject(
            items.ObjectJointGeneric(markerNumbers=markers, constrainedAxes=LOCKED[link.joint.kind])
        )
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

    def course(self) -> Course:
        data = [self.mbs.GetSensorStoredData(sensor) for sensor in self._frames]
        time = data[0][:, 0]
        frames = [self._whole(rows[:, 1:], body) for rows, body in zip(data, self._bodies)]
        turns = [np.array([from_quaternion(row[3:7]) for row in frame]) for frame in frames]
        joints = np.array([self._angle(link, turns) for link in self._connections]).T
        tips = [
            self.mbs.GetSensorStoredData(sensor)[:, 1:] @ self._bodies[k].link.shapes.translations[-1].T  # type: ignore[attr-defined]
            for k, sensor in self._modes.items()
        ]
        attitude = frames[0][:, 3:7] / np.linalg.norm(frames[0][:, 3:7], axis=1, keepdims=True)
        return Course(time, np.hstack([joints, frames[0][:, :3], attitude, *tips]))

    def _whole(self, rows: Array, body: Body) -> Array:
        """Coordinates with their reference values."""
        return rows + np.asarray(self.mbs.GetNode(body.frames[0])["referenceCoordinates"])

    def _angle(self, link: Connection, turns: Sequence[Array]) -> Array:
        outer, inner = turns[link.parent] @ (link.rotation @ link.align), turns[link.child] @ link.align
        relative = np.einsum("nji,nj->ni", outer, inner[:, :, 0])
        return np.arctan2(relative[:, 1], relative[:, 0])


def _given(mbs: Any, item: Any, name: str, law: Callable[..., Any], kept: Kept) -> None:
    made = exudyn.advancedUtilities.CreateSymbolicUserFunction(mbs, law, name, itemIndex=item)
    mbs.SetObjectParameter(item, name, made)
    kept.append(made)


def _bristles(mbs: Any, robot: Robot, coordinate: Sequence[int], first: int, kept: Kept) -> None:
    """LuGre friction without loads at the joints of a tree, by the formula of `reference_model`'s effect."""
    names = [joint.name for joint in robot.moving_joints]
    uses = [use for use in robot.effects if use.effect == "lugre_friction"]
    if not uses:
        return
    count, rows = first + len(names), [first + coordinate.index(names.index(use.at)) for use in uses]
    if count + len(uses) > LONGEST_VECTOR:
        raise ValueError(f"{count + len(uses)} coordinates are too many for a symbolic function")
    still = [0.0] * len(uses)
    memory = mbs.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=still,
            initialCoordinates=still,
            initialCoordinates_t=still,
            numberOfODE2Coordinates=len(uses),
        )
    )

    def law(mbs: Any, t: Any, itemNumber: Any, q: Any, q_t: Any) -> Any:
        found: list[Any] = [0.0] * (count + len(uses))
        for k, (row, use) in enumerate(zip(rows, uses)):
            found[row], found[count + k] = _lugre(use.parameters, q_t[row], q_t[count + k])
        return found

    mass = np.diag([0.0] * count + [1.0] * len(uses))
    item = mbs.AddObject(
        items.ObjectGenericODE2(nodeNumbers=[0, memory], massMatrix=mass, forceUserFunction=law)
    )
    _given_force(mbs, item, law, len(mass), kept)


def _lugre(p: Mapping[str, float], v: Any, z: Any) -> tuple[Any, Any]:
    """Force at speed v and deflection z, and the rate of z."""
    stiffness, speed, ratio = p["bristle_stiffness"], sym.abs(v), v * (1 / p["stribeck_velocity"])
    peak = p["static_torque"] - p["coulomb_torque"]
    level = p["coulomb_torque"] + SMALLEST_LEVEL + peak * sym.exp(-(ratio * ratio))
    rate = v - stiffness * speed * z / level
    limit = p.get("damping_limit", 1.0) * p["bristle_damping"] / 4
    damping = p["bristle_damping"] / (1 + limit * speed / level)
    return -(stiffness * z + damping * rate), rate


def _given_force(mbs: Any, item: Any, law: Callable[..., Any], size: int, kept: Kept) -> None:
    """A force on `size` coordinates. Exudyn's own helper records it with vectors of no length, and what
    comes out is beyond their end: the record is made here with vectors of the right one."""
    recording = sym.GetRecording()
    sym.SetRecording(True)
    arguments = [mbs, sym.Real("t", 0.0), sym.Real("itemNumber", 0.0)]
    arguments += [sym.Vector(name, [0.0] * size) for name in ("q", "q_t")]
    value = law(*arguments)
    record = {
        "functionName": "law",
        "argList": arguments,
        "argTypeList": ["MainSystem", "Real", "Index", "StdVector", "StdVector"],
        "returnValue": sym.Vector(value) if isinstance(value, list) else value,
        "returnType": "StdVector",
    }
    sym.SetRecording(recording)
    function = sym.UserFunction()
    function.SetUserFunctionFromDict(mbs, record, "forceUserFunction", item, "None")
    mbs.SetObjectParameter(item, "forceUserFunction", function)
    kept.append((function, record))


def module_name() -> str:
    """Which of its two compiled modules Exudyn runs on."""
    return str(exudyn.SystemContainer.__module__)

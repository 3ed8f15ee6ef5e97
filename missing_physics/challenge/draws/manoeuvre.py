"""Reference motions and controllers of the cases, inside the robot's limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exudyn_model.control.motion import motions
from missing_physics.challenge.cases.ranges import DRY, RARELY, Draw, Scale
from missing_physics.challenge.draws.robots import Kind, friction_at
from robot_model import (
    ComputedTorque,
    EffectUse,
    JointPD,
    MultiSine,
    Reference,
    Robot,
    Table,
    load_robot,
)

__all__ = [
    "draw_controller",
    "draw_reference",
    "reference_samples",
    "scales_of",
    "slow_sines",
    "with_feedforward",
]

Array = NDArray[np.float64]

#: Share of a limit of position or speed that a reference motion uses at most.
INSIDE = 0.9
#: How often a joint goes from point to point with pauses instead of in a sum of sines.
POINT_TO_POINT = 0.2
#: Time from one point to the next [s].
ARRIVAL = (1.2, 3.0)
#: Robots whose links bend: two sines at each joint, [rad] and [Hz], and way and time from point to point,
#: slow enough for a boom with 50 kg at its end, whose tip then bends by a hundredth of its length.
SLOW_AMPLITUDES = ((0.08, 0.12), (0.01, 0.025))
SLOW_FREQUENCIES = ((0.08, 0.13), (0.2, 0.3))
SLOW_SIZE, SLOW_ARRIVAL = (0.06, 0.15), (2.2, 3.2)
#: Instants at which a reference motion is looked at.
LOOKS = 600
#: Stiffer control of the family in which only the torque shows the effect.
STIFFER = (5.0, 12.0)
#: Slowest sampling of a stiff controller [s]; at two milliseconds some oscillate.
STIFF_PERIOD = 0.001
#: Share of a joint's sliding friction that its controller's feed-forward makes up for, and how often a
#: controller of another family has one: it must not reveal that friction is missing, nor where.
MADE_UP_FOR = (0.6, 0.95)
FEEDFORWARD = 0.2
#: Friction for which a joint that has none got a feed-forward [hundredths of the actuator's limit]: as of
#: hidden friction.
MIGHT_HAVE = (0.7, 6.0)
#: How often, and by how much, a feed-forward was set for another friction than the joint now has: the
#: friction of a robot file that was tuned is off by as much.
OLD, OFF = 0.3, (0.5, 2.0)


def draw_reference(robot: Robot, kind: Kind, d: Draw, *, like: Reference | None = None) -> Reference:
    """A reference motion of every joint; `like` gives duration and rate of a second recording."""
    described = load_robot(robot.name).reference
    assert described is not None
    duration = like.duration if like else d.even(*kind.durations)
    rate = like.sample_rate if like else float(d.chance.choice(kind.rates))
    shipped = {item.joint: item for item in described.joints}
    items = []
    for joint in robot.moving_joints:
        start = joint.initial_position
        if robot.flexible_links:
            item = _slow_item(joint.name, start, duration, d)
        else:
            item = _item(shipped[joint.name], start, duration, d)
        items.append(_scaled(robot, item, duration))
    return Reference(duration=duration, sample_rate=rate, joints=tuple(items))


def _slow_item(joint: str, start: float, duration: float, d: Draw) -> MultiSine | Table:
    if d.chance.random() < POINT_TO_POINT:
        return _points(joint, start, d.even(*SLOW_SIZE), duration, d, arrival=SLOW_ARRIVAL)
    return slow_sines(joint, d)


def slow_sines(joint: str, d: Draw) -> MultiSine:
    """Two slow sines at a joint of a robot whose links bend."""
    return MultiSine(
        joint=joint,
        amplitudes=tuple(d.even(*bounds) for bounds in SLOW_AMPLITUDES),
        frequencies=tuple(d.even(*bounds) for bounds in SLOW_FREQUENCIES),
        phases=tuple(float(x) for x in d.chance.uniform(0, 2 * np.pi, 2)),
        ramp=2.0,
    )


def _item(shipped: Any, start: float, duration: float, d: Draw) -> MultiSine | Table:
    assert isinstance(shipped, MultiSine)
    size = sum(shipped.amplitudes) * d.decades(0.6, 1.1)
    if d.chance.random() < POINT_TO_POINT:
        return _points(shipped.joint, start, size, duration, d)
    shares = np.array(shipped.amplitudes) * d.chance.uniform(0.5, 1.5, len(shipped.amplitudes))
    faster = d.decades(0.8, 1.7)
    return MultiSine(
        joint=shipped.joint,
        amplitudes=tuple(float(x) for x in size * shares / shares.sum()),
        frequencies=tuple(float(f * faster * d.even(0.85, 1.2)) for f in shipped.frequencies),
        phases=tuple(float(x) for x in d.chance.uniform(0, 2 * np.pi, len(shares))),
        ramp=2.0,
    )


def _points(
    joint: str,
    start: float,
    size: float,
    duration: float,
    d: Draw,
    *,
    arrival: tuple[float, float] = ARRIVAL,
) -> Table:
    """Random points with pauses between: three equal positions make the spline rest."""
    times, positions = [0.0, 0.5], [start, start]
    while times[-1] < duration:
        goal = start + size * d.even(-0.8, 0.8)
        there = times[-1] + d.even(*arrival)
        for pause in (0.0, 0.15, d.even(0.3, 0.7)):
            times.append(there + pause)
            positions.append(goal)
    return Table(joint=joint, times=tuple(times), positions=tuple(positions))


def _scaled(robot: Robot, item: MultiSine | Table, duration: float) -> MultiSine | Table:
    """The motion made smaller until it keeps the joint's limits."""
    joint = robot.joint(item.joint)
    one = robot.model_copy(update={"reference": Reference(duration=duration, joints=(item,))})
    place = [j.name for j in robot.moving_joints].index(item.joint)
    position, velocity, _ = (column[:, place] for column in reference_samples(one))
    start = joint.initial_position
    ratios = [float(np.abs(velocity).max()) / (joint.velocity_limit or math.inf)]
    if joint.position_limits:
        low, high = joint.position_limits
        ratios += [(position.max() - start) / max(high - start, 1e-9)]
        ratios += [(start - position.min()) / max(start - low, 1e-9)]
    smaller = min(1.0, INSIDE / max(*ratios, 1e-9))
    if isinstance(item, MultiSine):
        return item.model_copy(update={"amplitudes": tuple(smaller * a for a in item.amplitudes)})
    return item.model_copy(update={"positions": tuple(start + smaller * (x - start) for x in item.positions)})


def reference_samples(robot: Robot) -> tuple[Array, Array, Array]:
    """Reference positions, velocities and accelerations over the whole duration, (LOOKS, n) each."""
    assert robot.reference is not None
    times = np.linspace(0.0, robot.reference.duration, LOOKS)
    goals = motions(robot)
    table = np.array([[motion(float(t)) for motion in goals] for t in times])
    return table[:, :, 0], table[:, :, 1], table[:, :, 2]


def scales_of(robot: Robot, needed: Array) -> dict[str, Scale]:
    """Sizes at each joint in its reference motion; `needed` is the nominal torque along it, (any, n)."""
    assert robot.reference is not None
    position, velocity, _ = reference_samples(robot)
    scales = {}
    for k, joint in enumerate(robot.moving_joints):
        limit = joint.actuator.torque_limit if joint.actuator and joint.actuator.torque_limit else 100.0
        peak = float(np.abs(needed[:, k]).max())
        viscous = friction_at(robot, joint.name, "viscous_friction")
        coulomb = friction_at(robot, joint.name, "coulomb_friction")
        fastest = float(np.abs(velocity[:, k]).max())
        scales[joint.name] = Scale(
            torque=limit / 100,
            speed=max(fastest, 1e-6),
            low=float(position[:, k].min()),
            high=float(position[:, k].max()),
            peak=max(peak + coulomb + viscous * fastest, limit / 100),
            coulomb=coulomb,
            viscous=viscous,
            duration=robot.reference.duration,
            rarely=_rarely(position[:, k]),
        )
    return scales


def _rarely(position: Array) -> tuple[float, float]:
    low, high = np.quantile(position, [RARELY, 1 - RARELY])
    return float(low), float(high)


def draw_controller(
    robot: Robot, d: Draw, *, stiff: bool, firm: Draw | None = None
) -> JointPD | ComputedTorque:
    """The shipped controller with other gains, much stiffer ones if `stiff`; `firm` draws how much."""
    shipped = robot.controller
    assert isinstance(shipped, JointPD | ComputedTorque)
    firmer = d.decades(0.6, 1.8) * ((firm or d).even(*STIFFER) if stiff else 1.0)
    kp, kd = _times(shipped.kp, firmer), _times(shipped.kd, math.sqrt(firmer))
    digital = d.chance.random() < 0.3
    period = float(d.chance.choice([0.001, 0.002])) if digital else 0.0
    period = min(period, STIFF_PERIOD) if stiff else period
    if isinstance(shipped, ComputedTorque):
        return ComputedTorque(kp=kp, kd=kd, sample_time=period)
    weight = any(robot.gravity) and bool(d.chance.random() < 0.5)
    return JointPD(kp=kp, kd=kd, sample_time=period, gravity_feedforward=weight)


def with_feedforward(robot: Robot, hidden: Sequence[EffectUse], d: Draw, *, compensated: bool) -> Robot:
    """`robot` with friction feed-forward at every joint, if it is `compensated` or by chance.

    It makes up for most of the friction that the joint has, described or hidden. A joint without gets one for
    a friction that it might have had.
    """
    if not compensated and d.chance.random() > FEEDFORWARD:
        return robot
    assert isinstance(robot.controller, JointPD | ComputedTorque)
    laws = [use for use in (*robot.effects, *hidden) if use.effect in DRY]
    levels = []
    for joint in robot.moving_joints:
        limit = joint.actuator.torque_limit if joint.actuator and joint.actuator.torque_limit else 100.0
        own = [use.parameters for use in laws if use.at == joint.name]
        friction = limit / 100 * d.decades(*MIGHT_HAVE)
        for law in own:
            friction = law.get("torque", law.get("coulomb_torque", friction))
        old = d.decades(*OFF) if d.chance.random() < OLD and not compensated else 1.0
        levels.append(friction * old * d.even(*MADE_UP_FOR))
    changed = robot.controller.model_copy(update={"coulomb_feedforward": tuple(levels)})
    return robot.model_copy(update={"controller": changed})


def _times(gain: float | tuple[float, ...], factor: float) -> float | tuple[float, ...]:
    return tuple(factor * g for g in gain) if isinstance(gain, tuple) else factor * gain

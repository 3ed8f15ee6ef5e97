"""Temperature and bearing load: whether a residual depends on the conditions under which a joint runs.

Both change friction, so that what they make turns with the direction of motion or goes with the velocity.
A curve over either explains a residual also where it only stands in for something else that changes alike:
a thermometer for the time, a load for the pose. So each must explain more than a curve with as many knots
over any of these.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.location.shares import Account, more
from robot_model import Robot

__all__ = ["conditions", "depends_on_conditions"]

Array = NDArray[np.float64]

#: Knots of a curve.
KNOTS = 3
#: Part of the values at either end beyond the outermost knots.
ENDS = 0.02
#: Least change of the temperature [K], and in units of its noise; least change of the load by its mean.
LEAST_WARMING, LEAST_BEYOND_NOISE, LEAST_LOAD = 1.0, 4.0, 0.05
#: The rarer direction has this part of the rows at least.
LEAST_BACKWARD = 0.1


def depends_on_conditions(robot: Robot, account: Account) -> dict[str, tuple[Array, Array, float]]:
    """Values of each condition that is told, what a curve over it foretells, and its share.

    Values and foretold residual are of the account's rows, shape (K,). None where the joint moves in one
    direction only: what a condition does to friction is told from other forces by both.
    """
    forward = float(np.mean(account.direction > 0))
    asked = conditions(robot, account.problem, account.joint)
    if not asked or min(forward, 1.0 - forward) < LEAST_BACKWARD:
        return {}
    shown = {name: values[account.rows] for name, values in asked.items()}
    shares = {name: account.share(_columns(account, values)) for name, values in shown.items()}
    best = max(shares, key=lambda name: shares[name].share)
    if not account.is_clear(shares[best]):
        return {}
    rivals = (account.share(_columns(account, values)) for values in _rivals(account).values())
    if not all(more(shares[best], rival) for rival in rivals):
        return {}
    foretold = account.foretold(_columns(account, shown[best]))
    known = account.foretold(np.zeros((account.rows.size, 0)))
    return {best: (shown[best], foretold - known, shares[best].share)}


def conditions(robot: Robot, problem: Problem, joint: int) -> Mapping[str, Array]:
    """What is known of a joint's temperature [K] and bearing load [N m or N], where it changes; (R,) each."""
    name, found = problem.joints[joint], {}
    warm = [_filtered(s, s.motion.temperature[:, joint]) for s in problem.segments]
    if all(np.isfinite(part).all() for part in warm):
        values = np.concatenate(warm)
        noise = max(s.motion.noise.get(f"{name}.temperature", 0.0) for s in problem.segments)
        if _change(values) > max(LEAST_WARMING, LEAST_BEYOND_NOISE * noise):
            found[f"{name}.temperature"] = values
    if robot.moving_joints[joint].bearing is not None:
        values = np.concatenate([_filtered(s, _load(s, joint)) for s in problem.segments])
        if _change(values) > LEAST_LOAD * float(np.abs(values).mean()):
            found[f"{name}.load_moment"] = values
    return found


def _load(segment: Segment, joint: int) -> Array:
    """The bearing load as a moment, as load-dependent friction takes it, shape (N,)."""
    radial_arm, axial_arm = segment.places[joint].bearing_arms
    loads = segment.dynamics.loads[:, joint]
    return np.asarray(axial_arm * loads[:, 1] + radial_arm * loads[:, 3])


def _rivals(account: Account) -> Mapping[str, Array]:
    """What a condition may only stand in for, shape (K,) each."""
    problem, rows = account.problem, account.rows
    spans = [float(s.time[-1] - s.time[0]) for s in problem.segments]
    before = np.concatenate([[0.0], np.cumsum(spans)])[problem.segment_of]
    starts = np.array([s.time[0] for s in problem.segments])[problem.segment_of]
    rivals = {"time": problem.time, "running time": problem.time - starts + before}
    rivals |= {name: problem.position[:, k] for k, name in enumerate(problem.joints)}
    # What the actuator should have delivered: friction of the gear goes with it.
    rivals["torque"] = (problem.measured - problem.residual)[:, account.joint]
    return {name: values[rows] for name, values in rivals.items()}


def _columns(account: Account, values: Array) -> Array:
    """Curves over `values`: as they are, turning with the direction, and times the velocity, (K, k)."""
    low, high = np.quantile(values, [ENDS, 1 - ENDS])
    knots = np.linspace(low, high, KNOTS) if high > low else np.array([low])
    hats = np.column_stack([np.interp(values, knots, unit) for unit in np.eye(knots.size)])
    carriers = (np.ones(values.size), account.direction, account.velocity)
    return np.hstack([hats * carrier[:, None] for carrier in carriers])


def _filtered(segment: Segment, values: Array) -> Array:
    return segment.motion.low_pass.reduce(values)


def _change(values: Array) -> float:
    return float(np.ptp(np.quantile(values, [ENDS, 1 - ENDS])))

"""Friction of joints near rest, where it is what the torque says and not what the velocity says.

`Run.dry` is what dry friction has to be there by the standard model. Effects of the joint carry a part of it
themselves, and a law of friction has a level of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.sliding import SPEEDS
from missing_physics.hypotheses import Term
from missing_physics.inference.columns import level_over_speed, split
from missing_physics.inference.runs import Beyond, Run, directed, run_about
from missing_physics.standard.rows import FRICTION
from reference_model.effects.base import JointEffect

__all__ = ["about", "at_rest"]

Array = NDArray[np.float64]


def at_rest(run: Run, number: int, terms: Sequence[Term], numbers: Array) -> Array:
    """What the torques need more near rest than the columns of friction and of these terms say, shape (K, n).

    Args:
        run: the recording.
        number: of it.
        terms: effects with their numbers.
        numbers: of the standard model, shape (X,).
    """
    found = np.zeros_like(run.torque)
    for k, joint in enumerate(run.model.joints):
        own = [t for t in terms if _acts(t, joint, number)]
        near = np.flatnonzero(~np.isnan(run.dry[:, k]))
        if not (own or run.beyond[k]) or not near.size or any(_bristles(t) for t in own):
            continue
        series = np.zeros(run.motion.time.size)
        series[near] = _more(run, k, near, own, numbers)
        found[:, k] = run.reduce(series)
    return found


def about(run: Run, number: int, terms: Sequence[Term], numbers: Array) -> Run:
    """The recording about other numbers of the standard model and these effects, see `at_rest`."""
    force, level = np.zeros_like(run.direction), np.tile(_coulomb(run, numbers), (len(run.direction), 1))
    beyond = np.zeros(len(run.model.joints), dtype=bool)
    speeds = np.abs(run.motion.velocity).max(axis=0)[:, None] * SPEEDS
    curve = np.repeat(_coulomb(run, numbers)[:, None], SPEEDS.size, axis=1)
    for k, joint in enumerate(run.model.joints):
        for term in terms:
            if _acts(term, joint, number):
                rest, dry = split(term, run, k)
                force[:, k] += rest
                level[:, k] += dry
                curve[k] += level_over_speed(term, run, k, speeds[k])
                beyond[k] = True
    now = [np.interp(np.abs(v), *table) for v, table in zip(run.velocity.T, zip(speeds, curve))]
    still = np.maximum(level + curve[:, 0] - np.column_stack(now), 0.0)
    more = Beyond(force, np.maximum(level, 0.0), beyond, still, speeds, curve - curve[:, :1])
    return run_about(run.model, run.motion, run.rows, run.channels, run.temperature, numbers, more)


def _more(run: Run, k: int, near: NDArray[np.int_], terms: Sequence[Term], numbers: Array) -> Array:
    dry, level = run.dry[near, k] - run.force[near, k], np.full(near.size, _coulomb(run, numbers)[k])
    if run.is_rigid_and_fixed:
        dry += run.sliding(k, run.numbers) - run.sliding(k, numbers)
    for term in terms:
        rest, own = split(term, run, k, near)
        dry, level = dry + rest, level + own
    level = np.maximum(level, 0.0)
    return np.asarray(level * (directed(dry, level) - run.direction[near, k]))


def _coulomb(run: Run, numbers: Array) -> Array:
    first, joints = len(run.model.inertial_names), len(run.model.joints)
    own = numbers[first : first + joints * len(FRICTION)].reshape(joints, -1)
    return np.asarray(own[:, FRICTION.index("coulomb")])


def _acts(term: Term, joint: str, number: int) -> bool:
    return isinstance(term.effect, JointEffect) and term.at == joint and term.run in (None, number)


def _bristles(term: Term) -> bool:
    """Whether friction near rest is a state of its own."""
    return isinstance(term.effect, JointEffect) and bool(term.effect.family and term.effect.states)

"""Which motion would separate explanations that these data cannot.

Motions are drawn at random within the robot's limits; along each, both fitted explanations predict the
actuator torque. What counts is the part of their difference that the rival cannot imitate by changing its own
parameters, those of the other effects, and the inertial numbers.
"""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis.dynamics import MotionDynamics
from missing_physics.diagnosis.explanation import Explanation
from missing_physics.diagnosis.judge import AMBIGUOUS, Weighed
from missing_physics.diagnosis.motion import LowPass, Motion
from missing_physics.diagnosis.problem import Problem, Segment
from missing_physics.diagnosis.result import Experiment
from missing_physics.diagnosis.terms import Term
from reference_model.effects.catalogue import get_effect
from robot_model import Robot

__all__ = ["design_experiments"]

Array = NDArray[np.float64]

#: Motions drawn per pair, their length [s] and rate [Hz] in units of the recording's cut-off.
DRAWN = 24
LENGTH = 20.0
#: Pairs for which a motion is designed.
MOST_PAIRS = 3
#: Sines in a motion.
SINES = 4
#: Part of the allowed range and speed that a motion uses.
MARGIN = 0.9


def design_experiments(
    robot: Robot, problem: Problem, best: Explanation, weighed: Sequence[Weighed], *, seed: int
) -> tuple[tuple[Experiment, ...], dict[str, str]]:
    """One experiment for each finding that has a rival, with the motion as CSV text by file name."""
    experiments: list[Experiment] = []
    motions: dict[str, str] = {}
    pairs = [(item.term, rival) for item in weighed for rival, p in item.alternatives[:4] if p >= AMBIGUOUS]
    chance = np.random.default_rng(seed)
    for chosen, rival in pairs[:MOST_PAIRS]:
        drawn = [_draw(problem, chance) for _ in range(DRAWN)]
        scores = [_separation(problem, best, chosen, rival, motion) for motion in drawn]
        top = int(np.argmax(scores))
        name = f"experiment_{len(experiments) + 1}.csv"
        experiments.append(_told(chosen, rival, scores[top], name))
        motions[name] = _csv(problem, drawn[top])
    return tuple(experiments), motions


def _told(chosen: Term, rival: Term, score: float, name: str) -> Experiment:
    effect = get_effect(chosen.effect.id)
    if score < 1.0:
        return Experiment(
            (chosen.effect.id, rival.effect.id),
            f"{effect.experiment} No motion within the limits was found that separates them by the joint "
            f"torque alone; {name} is the best of those tried.",
            "on every motion that was tried the two predict torques that differ by less than the residual",
            name,
        )
    return Experiment(
        (chosen.effect.id, rival.effect.id),
        f"run the reference motion in {name} and diagnose again with both recordings; {effect.experiment}",
        f"along it the two explanations differ by {score:.3g} times the present residual, whatever their "
        "parameters are tuned to",
        name,
    )


def _draw(problem: Problem, chance: np.random.Generator) -> Motion:
    """A random multi-sine of random slowness within the limits of position and speed."""
    reference = problem.segments[0].motion
    rate = max(4.0 * reference.low_pass.cutoff, 20.0)
    time = np.arange(0.0, LENGTH, 1.0 / rate)
    columns = []
    slowness = float(np.exp(chance.uniform(np.log(0.05), 0.0)))
    for index, joint in enumerate(problem.segments[0].joints):
        low, high = joint.position_limits or (
            float(problem.position[:, index].min()),
            float(problem.position[:, index].max()),
        )
        speed = joint.velocity_limit or float(np.abs(problem.velocity[:, index]).max())
        frequency = np.exp(chance.uniform(np.log(0.05), np.log(2.0), SINES))
        weight = chance.dirichlet(np.ones(SINES))
        shape = np.sin(2 * np.pi * np.outer(time, frequency) + chance.uniform(0, 2 * np.pi, SINES)) @ weight
        shape -= 0.5 * (shape.max() + shape.min())
        shape *= 0.5 * MARGIN * (high - low) / max(np.abs(shape).max(), 1e-12)
        fastest = float(np.abs(np.gradient(shape, time)).max())
        shape *= min(1.0, MARGIN * slowness * speed / max(fastest, 1e-12))
        columns.append(0.5 * (low + high) + shape)
    position = np.column_stack(columns)
    spline = make_interp_spline(time, position, k=5)
    empty = np.full_like(position, np.nan)
    return Motion(
        source="experiment",
        time=time,
        position=position,
        velocity=spline(time, 1),
        acceleration=spline(time, 2),
        torque=empty,
        temperature=empty,
        position_noise=reference.position_noise,
        torque_noise=reference.torque_noise,
        low_pass=LowPass(rate, min(reference.low_pass.cutoff, 0.2 * rate)),
        motion_cutoff=min(reference.low_pass.cutoff, 0.2 * rate),
        raw_position=position,
        position_channels=reference.position_channels,
        torque_sensors=reference.torque_sensors,
    )


def _separation(problem: Problem, best: Explanation, chosen: Term, rival: Term, motion: Motion) -> float:
    """rms of the difference that the rival cannot imitate, in units of the present residual."""
    measured = problem.segments[0].dynamics
    dynamics = MotionDynamics(measured.model, motion, measured.further)
    segment = Segment(problem.robot, dynamics, motion)
    others = [t for t in best.terms if t.key != chosen.key]
    scale = np.sqrt(np.mean(best.residual**2, axis=0))
    target = segment.contribution(chosen, best.terms).value - segment.contribution(rival, others).value
    columns = [segment.contribution(t, others).jacobian for t in [*others, rival]]
    columns.append(segment.reduce(dynamics.regressor))
    flat = np.concatenate(columns, axis=2) / scale[None, :, None]
    flat = flat[:, problem.usable].reshape(-1, flat.shape[2])
    aim = (target / scale)[:, problem.usable].ravel()
    if not (np.all(np.isfinite(flat)) and np.all(np.isfinite(aim))):
        return 0.0
    norms = np.linalg.norm(flat, axis=0)
    flat = flat[:, norms > 0] / norms[norms > 0]
    left = aim - flat @ np.linalg.lstsq(flat, aim, rcond=1e-9)[0]
    return float(np.sqrt(np.mean(left**2)))


def _csv(problem: Problem, motion: Motion) -> str:
    text = io.StringIO()
    header = ",".join(["time", *(f"{joint}.reference_position" for joint in problem.joints)])
    np.savetxt(
        text,
        np.column_stack([motion.time, motion.position]),
        fmt="%.9g",
        delimiter=",",
        header=header,
        comments="",
    )
    return text.getvalue()

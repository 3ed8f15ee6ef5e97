"""Which motion would separate explanations that these data cannot.

Motions within the robot's limits are drawn at random, and the best for a pair of explanations is improved by
small random changes; along each, both fitted explanations predict the actuator torque. What counts is the
part of their difference that the rival cannot imitate by changing its own parameters, those of the other
effects, and the inertial numbers.

Flexible links are taken for rigid here: their vibration is not what separates the explanations, and to follow
it along fifty motions would take minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from scipy.interpolate import make_interp_spline

from missing_physics.answer.multisine import Limits, MultiSines, as_csv
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.experiments.runs import RunBench
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.motion.estimate import Motion
from missing_physics.diagnosis.motion.low_pass import LowPass
from missing_physics.diagnosis.naming.judge import AMBIGUOUS, Weighed
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Experiment, Result
from reference_model.effects.catalogue import get_effect
from reference_model.evaluation.model import RobotModel
from reference_model.flexible.undeformed import undeformed
from robot_model import Robot

__all__ = ["design_experiments", "still_needed"]

#: Why there is no file.
NOT_DESIGNED = (
    "no motion was designed: the two were not held against each other by joint torques alone and could not "
    "be run in closed loop, or other pairs came first"
)
#: Length of a motion [s]; its rate [Hz] is this many times the cut-off, which need not be higher than so.
LENGTH = 20.0
PER_CUTOFF, LOWEST_RATE = 4.0, 20.0
HIGHEST_CUTOFF = 20.0
#: Motions drawn, for all pairs together.
DRAWN = 16
#: Changes of the best motion that are tried for each pair, so many at each spread.
TRIED = 6
SPREADS = (0.5, 0.25)
#: Pairs for which a motion is designed, those first that some motion of the drawn ones can separate.
MOST_PAIRS = 3
#: Part of the largest torque of an actuator that a motion may need.
MARGIN = 0.9


def design_experiments(
    robot: Robot, problem: Problem, best: Explanation, weighed: Sequence[Weighed], *, seed: int
) -> tuple[tuple[Experiment, ...], dict[str, str]]:
    """One experiment for each finding that has a rival, with the motion as CSV text by file name."""
    pairs = [(item.term, rival) for item in weighed for rival, p in item.alternatives if p >= AMBIGUOUS]
    if not pairs:
        return (), {}
    chance = np.random.default_rng(seed)
    bench = _Bench(robot, problem, best)
    drawn = [bench.run(MultiSines.drawn(len(problem.joints), chance)) for _ in range(DRAWN)]
    first = [_best([_Scored(bench.separation(tried, *pair), tried) for tried in drawn]) for pair in pairs]
    order = sorted(range(len(pairs)), key=lambda index: first[index].score < 1.0)  # what can be told first
    experiments: list[Experiment] = []
    motions: dict[str, str] = {}
    for index in order[:MOST_PAIRS]:
        pair, top = pairs[index], first[index]
        for spread in SPREADS:
            near = [bench.run(top.tried.numbers.near(spread, chance)) for _ in range(TRIED)]
            top = _best([top, *(_Scored(bench.separation(tried, *pair), tried) for tried in near)])
        name = f"experiment_{len(experiments) + 1}.csv"
        experiments.append(_told(*pair, top.score, name))
        if top.score > 0:
            motion = top.tried.segment.motion
            motions[name] = as_csv(problem.joints, motion.time, motion.position)
    return tuple(experiments), motions


def still_needed(result: Result, bench: RunBench | None = None) -> Result:
    """`result` with experiments for what it still calls ambiguous.

    What runs in closed loop have told apart meanwhile needs none. Rivals that show elsewhere than in a
    joint's torque (gears, links, base) get a motion by runs, else words.

    Args:
        bench: makes these runs; None where none are possible.
    """
    diagnosis = result.diagnosis
    rivals = [(f, label) for f in diagnosis.findings for label in f.ambiguous_with]
    pairs = {frozenset((f.effect, label.partition("@")[0])): (f, label) for f, label in rivals}
    kept = [experiment for experiment in diagnosis.experiments if frozenset(experiment.separates) in pairs]
    motions = {e.motion: result.experiment_motions[e.motion] for e in kept if e.motion is not None}
    designed = {frozenset(experiment.separates) for experiment in kept}
    free = (name for k in count(1) if (name := f"experiment_{k}.csv") not in result.experiment_motions)
    for finding, label in (pair for key, pair in pairs.items() if key not in designed):
        name = next(free)
        made = bench.designed(result, finding, label, name) if bench is not None else None
        if made is None:
            effects = finding.effect, label.partition("@")[0]
            ways = dict.fromkeys(get_effect(effect).experiment for effect in effects)
            kept.append(Experiment(effects, "; or ".join(ways), NOT_DESIGNED))
            continue
        kept.append(made[0])
        motions[name] = made[1]
    return replace(result, diagnosis=replace(diagnosis, experiments=tuple(kept)), experiment_motions=motions)


def _told(chosen: Term, rival: Term, score: float, name: str) -> Experiment:
    effect = get_effect(chosen.effect.id)
    if score == 0.0:
        return Experiment(
            (chosen.effect.id, rival.effect.id),
            f"{effect.experiment}. No motion within the limits of range, speed and torque was found that "
            "tells the two apart by the joint torque alone.",
            "on every motion tried the two can predict the same torque, or need more torque than there is",
            None,
        )
    if score < 1.0:
        return Experiment(
            (chosen.effect.id, rival.effect.id),
            f"{effect.experiment}. No motion within the limits was found that separates them by the joint "
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


@dataclass(frozen=True)
class _Tried:
    """A motion along which predictions are made."""

    numbers: MultiSines
    segment: Segment


@dataclass(frozen=True)
class _Scored:
    score: float
    tried: _Tried


def _best(scored: Sequence[_Scored]) -> _Scored:
    return max(scored, key=lambda item: item.score)


class _Bench:
    """Runs motions on the robot as it was fitted, with its links rigid."""

    def __init__(self, robot: Robot, problem: Problem, best: Explanation) -> None:
        self.problem, self.best = problem, best
        self.robot = undeformed(robot)
        measured = problem.segments[0]
        self.further = measured.dynamics.further
        self.model = RobotModel(self.robot) if robot.flexible_links else measured.dynamics.model
        names = self.model.inertial_names
        self.inertial = [i for i, name in enumerate(names) if not name.startswith("gravity")]
        self.limits = Limits.of(measured.joints, problem.position, problem.velocity)
        counted = problem.sliding  # friction may hold any torque at standstill
        left = np.sqrt((counted * best.residual**2).sum(axis=0) / np.maximum(counted.sum(axis=0), 1e-9))
        # an output of which nothing counts separates nothing
        self.weight = np.divide(1.0, left, out=np.zeros_like(left), where=left > 0)
        actuators = [joint.actuator for joint in measured.joints]
        self.torque = np.array([a.torque_limit if a and a.torque_limit else np.inf for a in actuators])

    def run(self, numbers: MultiSines) -> _Tried:
        """The motion of these numbers, and what the robot needs for it."""
        reference = self.problem.segments[0].motion
        cutoff = min(reference.low_pass.cutoff, HIGHEST_CUTOFF)
        rate = max(PER_CUTOFF * cutoff, LOWEST_RATE)
        time = np.arange(0.0, LENGTH, 1.0 / rate)
        position = numbers.positions(time, self.limits)
        spline = make_interp_spline(time, position, k=5)
        unknown = np.full_like(position, np.nan)
        motion = Motion(
            source="experiment",
            time=time,
            position=position,
            velocity=spline(time, 1),
            acceleration=spline(time, 2),
            torque=unknown,
            temperature=unknown,
            position_noise=reference.position_noise,
            torque_noise=reference.torque_noise,
            low_pass=LowPass(rate, min(cutoff, 0.2 * rate)),
            motion_cutoff=min(cutoff, 0.2 * rate),
            raw_position=position,
            position_channels=reference.position_channels,
            torque_sensors=reference.torque_sensors,
        )
        dynamics = MotionDynamics(self.model, motion, self.further)
        return _Tried(numbers, Segment(self.robot, dynamics, motion))

    def separation(self, tried: _Tried, chosen: Term, rival: Term) -> float:
        """rms of the difference that the rival cannot imitate, in units of the present residual.

        Nothing for a motion that needs more torque than the actuators have.
        """
        segment, terms = tried.segment, self.best.terms
        others = [t for t in terms if t.key != chosen.key]
        own = segment.contribution(chosen, terms).value
        target = own - segment.contribution(rival, others).value
        needed = segment.inverse + own + sum(segment.contribution(t, terms).value for t in others)
        if np.any(np.abs(needed[:, : self.torque.size]) > MARGIN * self.torque):
            return 0.0
        columns = [segment.contribution(t, others).jacobian for t in [*others, rival]]
        columns.append(segment.reduce(segment.dynamics.regressor[:, :, self.inertial]))
        flat = np.concatenate(columns, axis=2) * self.weight[None, :, None]
        flat = flat[:, self.problem.usable].reshape(-1, flat.shape[2])
        aim = (target * self.weight)[:, self.problem.usable].ravel()
        if not (np.all(np.isfinite(flat)) and np.all(np.isfinite(aim))):
            return 0.0
        norms = np.linalg.norm(flat, axis=0)
        flat = flat[:, norms > 0] / norms[norms > 0]
        left = aim - flat @ np.linalg.lstsq(flat, aim, rcond=1e-9)[0]
        return float(np.sqrt(np.mean(left**2)))

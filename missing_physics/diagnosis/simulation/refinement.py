"""Step 5 of the chain, in simulation, as a diagnosis uses it: whether it is possible, and what came of it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from missing_physics.checks.actuation import actuator_torque
from missing_physics.diagnosis.candidates.fitted import present
from missing_physics.diagnosis.free_run.problem import Trial
from missing_physics.diagnosis.free_run.recordings import Parts, obstacle, parts_of, trial_of
from missing_physics.diagnosis.free_run.score import position_fits, position_series, rms_positions
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.naming.search import ODDS, Progress
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.energies import farther
from missing_physics.diagnosis.simulation.fit import Bench
from missing_physics.diagnosis.simulation.ladder import Climb, Objection, climb
from missing_physics.diagnosis.simulation.results import changed_numbers, simulated_stages
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import ChannelFit, ChannelSeries, ParameterChange, Rung, Stage
from missing_physics.wording.numbers import interval_text
from robot_model import InputError, Recording, Robot

__all__ = ["Given", "Simulated", "refit_in_simulation"]

#: Why a refit in simulation was given up.
FARTHER = (
    "with the refit in simulation runs in closed loop are farther off, so the numbers found before it stand"
)


@dataclass(frozen=True)
class Given:
    """What the regression hands over.

    Attributes:
        nominal: the robot of the user.
        robot: with the regression's findings in it; the refit starts from it.
        written: what the robot file gets where no refit is kept.
        replay: runs in closed loop along all recordings; None where that is not possible.
        recorded: recordings of the user that are fitted, those that are held out, and the motions of all.
        problem, best: the regression and where it ended.
        nuisance: whether the inertial numbers are free in it.
        ladder: what it tried.
        joints: where something differs.
        finished: whether the regression explains everything down to the noise.
        seed: of everything that involves chance.
    """

    nominal: Robot
    robot: Robot
    written: Robot
    replay: Replay | None
    recorded: tuple[Sequence[Recording], Sequence[Recording], Sequence[Segment]]
    problem: Problem
    best: Explanation
    nuisance: bool
    ladder: Sequence[Rung]
    joints: Collection[str]
    finished: bool
    seed: int

    @property
    def recordings(self) -> Sequence[Recording]:
        """Those that are fitted."""
        return self.recorded[0]

    @property
    def every(self) -> Sequence[Recording]:
        """All recordings, in the order of `segments`."""
        return (*self.recorded[0], *self.recorded[1])

    @property
    def segments(self) -> Sequence[Segment]:
        """The motions of all recordings."""
        return self.recorded[2]


@dataclass(frozen=True)
class Simulated:
    """What came of the refit in simulation.

    Attributes:
        robot: the robot that a user gets.
        climb: what was tried; None when no refit was made.
        channels: errors of the positions in free runs, by channel.
        series: the free runs themselves.
        notes: sentences.
        stages: of the robots that were kept.
        numbers: of the nominal robot that were freed.
    """

    robot: Robot
    climb: Climb | None = None
    channels: dict[str, ChannelFit] = field(default_factory=dict)
    series: tuple[ChannelSeries, ...] = ()
    notes: tuple[str, ...] = ()
    stages: tuple[Stage, ...] = ()
    numbers: tuple[ParameterChange, ...] = ()


def refit_in_simulation(given: Given, progress: Progress) -> Simulated:
    """Refit in simulation where that is possible and needed; score free runs where they are possible."""
    if not given.joints:
        return Simulated(given.robot)
    made = _refitted(given, progress)
    if farther(given.replay, made.robot, given.robot):
        return Simulated(given.robot, notes=(FARTHER,))
    return made


def _refitted(given: Given, progress: Progress) -> Simulated:
    every = given.every
    reason = obstacle(given.nominal, every) or obstacle(given.robot, every)
    if reason:
        return Simulated(given.robot, notes=(_impossible(reason),))
    progress("looking at the controller")
    try:
        pairs = [trial_of(given.nominal, r, s.motion) for r, s in zip(every, given.segments)]
        trials = [trial for trial, _ in pairs]
        count = len(given.recordings)
        parts = parts_of(trials[:count], trials[count:])
        told = tuple(words for _, words in pairs if words)
        if given.finished:
            done = (
                "the regression explains the torques down to the noise, so nothing was refitted in simulation"
            )
            return _scored(given, trials, parts, given.robot, None, (*told, done, _scoring(parts)))
        reached = _climbed(given, parts, progress)
    except InputError as error:
        return Simulated(given.robot, notes=(_impossible(str(error).rstrip(".")),))
    notes = [*told, parts.words]
    if reached.exhausted:
        notes.append("the ladder in simulation ended because the work allowed for it was done")
    robot = reached.reached.robot if reached.kept else given.robot
    if reached.kept:
        notes.append("the robot file, and the parameters that say so, are those of the refit in simulation")
    else:
        notes.append("no refit in simulation was kept, so the numbers found before it stand")
    return _scored(given, trials, parts, robot, reached, notes)


def _impossible(reason: str) -> str:
    return f"a refit in simulation was not possible: {reason}; the numbers found before it stand"


def _scoring(parts: Parts) -> str:
    if parts.score:
        return "positions' errors are those of free runs, which had no part in any choice"
    return "positions' errors are those of free runs of the recordings that the regression fitted"


def _climbed(given: Given, parts: Parts, progress: Progress) -> Climb:
    noise = np.max([s.motion.position_noise for s in given.segments], axis=0)
    scale = np.maximum(noise, 1e-12)
    bench = Bench(parts, scale, given.seed, progress)
    return climb(
        bench,
        given.robot,
        given.problem,
        given.best,
        given.ladder,
        joints=given.joints,
        objection=_objection(given),
    )


def _objection(given: Given) -> Objection:
    """What a measured torque has to say about an effect that free runs ask for.

    A torque computed from a voltage is no witness: it rests on the motor constants that are in doubt.
    """

    def objection(term: Term) -> str:
        joint = term.at.split(".")[0]
        sources = {actuator_torque(given.nominal, r, joint)[0] for r in given.recordings}
        if not all(source and source.endswith(".torque") for source in sources):
            return ""
        rest = [t for t in given.best.terms if t.key != term.key]
        fitted = explain(given.problem, given.best.view, [*rest, term], nuisance=given.nuisance)
        if fitted.evidence_over(given.best) < np.log(ODDS) or not present(fitted, term):
            return "the measured torque does not show it"
        for name, (low, high) in fitted.intervals(term).items():
            value = term.parameters[name]
            if not low <= value <= high:
                told, lower, upper = interval_text(value, (low, high))
                return (
                    f"the measured torque contradicts it: with it in the regression {name.replace('_', ' ')} "
                    f"is between {lower} and {upper}, not {told}"
                )
        return ""

    return objection


def _scored(
    given: Given,
    trials: Sequence[Trial],
    parts: Parts,
    robot: Robot,
    reached: Climb | None,
    notes: Sequence[str],
) -> Simulated:
    """With the errors of free runs, before and after; without them where the runs do not converge."""
    ran = given.written if robot is given.robot else robot
    stages = simulated_stages(given.nominal, reached, rms_positions(given.nominal, parts)) if reached else ()
    numbers = changed_numbers(given.nominal, reached) if reached else ()
    made = Simulated(robot, reached, notes=tuple(notes), stages=stages, numbers=numbers)
    noise = np.max([s.motion.position_noise for s in given.segments], axis=0)
    try:
        crossed = reached.reached.rms[1] if reached else None
        channels = position_fits(given.nominal, ran, parts, noise, crossed)
        series = position_series(given.nominal, ran, trials, len(given.recordings), noise)
    except InputError as error:
        failed = f"positions' errors are not given: {str(error).rstrip('.')}"
        return replace(made, notes=(*notes, failed))
    return replace(made, channels=channels, series=series)

"""The diagnosis by regression and by runs in closed loop: joints without torque, two encoders at a gear."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

from threadpoolctl import threadpool_limits

from missing_physics.diagnosis.calibration import calibrated
from missing_physics.diagnosis.comparison.credible import credible
from missing_physics.diagnosis.comparison.rows import rows_of
from missing_physics.diagnosis.comparison.stage import compared, judged
from missing_physics.diagnosis.comparison.timing import aligned, with_timing
from missing_physics.diagnosis.coverage import coverage, prepared, require_same_torques, without_unscored
from missing_physics.diagnosis.coverage.contradictions import require_no_contradiction
from missing_physics.diagnosis.coverage.no_data import without_data
from missing_physics.diagnosis.experiments.design import still_needed
from missing_physics.diagnosis.experiments.runs import RunBench
from missing_physics.diagnosis.free_run.in_force import another_controller
from missing_physics.diagnosis.gear.transmission import diagnose_transmission
from missing_physics.diagnosis.gear_runs.applied import at_the_joints, found_gears
from missing_physics.diagnosis.gear_runs.merge import with_transmission
from missing_physics.diagnosis.gear_runs.rivals import gaps_in_runs
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.diagnosis.not_searched import not_searched, not_searched_for_want_of_channels
from missing_physics.diagnosis.one_look import OneLook
from missing_physics.diagnosis.options import Options
from missing_physics.diagnosis.passive.results import PassiveResult, diagnose_passive
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.reproduction import reproduction
from missing_physics.diagnosis.runs.confirmation import confirmed
from missing_physics.diagnosis.runs.headline import as_runs_show
from missing_physics.diagnosis.second_look import clearer_cutoff, named_by, nameless
from missing_physics.diagnosis.written.file import with_file
from missing_physics.results.result import Result
from robot_model import InputError, Recording, Robot

__all__ = ["by_regression", "check_input"]


@threadpool_limits.wrap(limits=1, user_api="blas")
def by_regression(
    robot: Robot,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    options: Options | None = None,
    progress: Callable[[str], None] | None = None,
) -> Result:
    """Find what the robot's description leaves out.

    Linear algebra runs on one thread meanwhile: its matrices are small, so that more threads wait for each
    other, and sums do not depend on how many processors there are.

    Args:
        robot: the nominal robot.
        recordings: what is fitted; must hold every moving joint's position.
        validation: what is only scored; when empty, one stretch in four of each recording is held out.
        options: see `Options`.
        progress: called with a phrase whenever something new is tried.

    Raises:
        InputError: a recording lacks what a diagnosis needs, or its channels contradict each other
            (`ContradictionError`), or one is given twice.
    """
    began = time.monotonic()
    chosen = options or Options()
    tell: Progress = progress or (lambda phrase: None)
    tell("estimating motion and torque")
    every = [*recordings, *validation]
    check_input(every, len(recordings), chosen)
    runnable = chosen.simulation and Replay.of(robot, recordings, validation) is not None
    in_time = aligned(robot, every, len(recordings), runs=runnable)
    ready = prepared(robot, in_time.recordings, cutoff=chosen.cutoff, as_recorded=chosen.as_recorded)
    every, along = [*ready.recordings], ready.dynamics
    recordings, validation = every[: len(recordings)], every[len(recordings) :]
    if not chosen.as_recorded:
        tell("checking the channels against each other")
        require_no_contradiction(robot, every, along, cutoff=chosen.cutoff)
    segments = tuple(Segment(robot, dynamics, dynamics.motion) for dynamics in along)
    require_same_torques(robot, recordings, along[: len(recordings)])
    covered = coverage(robot, every, along, fitted=len(recordings), dead=ready.dead)
    names = tuple(r.source for r in recordings), tuple(r.source for r in validation)
    tell("simulating the robot as described")
    reproduced = reproduction(robot, every) if covered.enough else None
    gap = None
    if reproduced is None or not reproduced.complete:
        gap = diagnose_transmission(
            robot, recordings, validation, segments=segments, seed=chosen.seed, progress=tell
        )
    if not covered.enough:
        alone = without_data(robot, names, covered)
        between = compared(with_transmission(alone, gap, robot), robot, every, len(recordings), None)
        between = judged(between, robot)
        return replace(calibrated(between, robot), seconds=time.monotonic() - began)
    motions = [segment.motion for segment in segments]
    gears = found_gears(robot, gap)
    segments = at_the_joints(robot, every, segments, gears.joints)
    described = robot.with_effects(*gears.uses)
    replay = Replay.of(described, recordings, validation) if chosen.simulation else None
    foreign = another_controller(robot, every, motions) if replay is not None else ""
    replay = None if foreign else replay

    passive = PassiveResult()
    own, others = segments[: len(recordings)], segments[len(recordings) :]
    if reproduced is None or not reproduced.complete:
        passive = diagnose_passive(robot, own, others, inertial_basis(robot, own), tell, replay)

    def look(segments: tuple[Segment, ...]) -> Result:
        basis = inertial_basis(robot, segments[: len(recordings)])
        data = split(segments, len(recordings), basis, seed=chosen.seed)
        work = OneLook(described, names, data, basis, covered, chosen, tell)
        work.recordings = tuple(recordings), tuple(validation), segments
        work.reproduced, work.replay, work.passive = reproduced, replay, passive
        work.between = gap is not None and bool(gap.findings)
        if passive.terms:
            work.given = split(passive.beside(segments), len(recordings), basis, seed=chosen.seed)
        return as_runs_show(replace(work.run(), rows=rows_of(data)), described, replay)

    found = look(segments)
    if chosen.cutoff is None and not (gap and gap.findings) and nameless(found):
        tell("searching for the band in which the mismatch is clearest")
        wider = clearer_cutoff(robot, recordings, segments[: len(recordings)], seed=chosen.seed)
        if wider is not None:
            sharper = make_segments(robot, every, cutoff=wider)
            found = named_by(found, look(at_the_joints(robot, every, sharper, gears.joints)))
    found, gap = gaps_in_runs(found, gap, robot, replay, tell)
    gears = found_gears(robot, gap)
    whole = with_transmission(found, gap, robot, (*gears.words, *([foreign] if foreign else [])))
    tell("running what was found in closed loop")
    sure = calibrated(confirmed(whole, robot, replay), robot)
    if reproduced is not None and reproduced.complete:  # nothing was looked for, which is said
        skipped = not_searched_for_want_of_channels(robot, every, own, gears.joints)
    else:
        skipped = not_searched(robot, every, segments, len(recordings), replay, gears.joints)
    told = without_unscored(sure.diagnosis, covered)
    told = replace(told, could_not_tell=(*told.could_not_tell, *skipped))
    whole = replace(sure, diagnosis=told)
    if chosen.experiments:
        tell("designing motions")
        whole = still_needed(whole, None if replay is None else RunBench(robot, replay, chosen.seed))
    whole = with_file(whole, robot, every)
    tell("fitting the standard model")
    whole = with_timing(credible(whole, robot), in_time.timing, every)
    lacking = [joint.name for joint in covered.joints if joint.reason is not None]
    whole = judged(compared(whole, robot, every, len(recordings), replay), robot, lacking)
    return replace(whole, seconds=time.monotonic() - began)


def check_input(every: Sequence[Recording], fitted: int, options: Options) -> None:
    """Raises `InputError` for a cut-off that cannot be, or a recording that is given twice.

    Args:
        every: recordings, those that are fitted first.
        fitted: how many these are.
        options: of the diagnosis.
    """
    _check_cutoff(options.cutoff, every)
    _require_different(every, fitted)


def _require_different(recordings: Sequence[Recording], fitted: int) -> None:
    """Raises `InputError` where one of the recordings is another one again; the first `fitted` are fitted."""
    for (i, one), (j, other) in combinations(enumerate(recordings), 2):
        if not one.same_values(other):
            continue
        name = other.source or f"recording {j + 1}"
        if i < fitted <= j:
            raise InputError(
                f"{name} is given with --validate and holds what is fitted (recording {i + 1}), so it would "
                "prove nothing; give another one, or none, and a quarter of each recording is held out."
            )
        raise InputError(f"{name} holds the same as recording {i + 1}; give each recording once.")


def _check_cutoff(cutoff: float | None, recordings: Sequence[Recording]) -> None:
    """Raises `InputError` for a cut-off [Hz] that no low-pass filter of these recordings can have."""
    slowest = min(recordings, key=lambda recording: recording.sample_rate)
    if cutoff is not None and not 0.0 < cutoff < slowest.sample_rate / 2:
        raise InputError(
            f"the cut-off of {cutoff:g} Hz is not between 0 and {slowest.sample_rate / 2:.6g} Hz, half the "
            f"sampling rate of {slowest.source or 'the recording'}; give another one, or leave it out."
        )

"""From recordings to a diagnosis."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from missing_physics.answer import answered, has_two_encoders, why_not_weighed
from missing_physics.checks.transmissions import on_both_sides
from missing_physics.diagnosis.comparison.credible import with_priors
from missing_physics.diagnosis.comparison.stage import compared, judged
from missing_physics.diagnosis.coverage import coverage, prepared, require_same_torques
from missing_physics.diagnosis.coverage.contradictions import require_no_contradiction
from missing_physics.diagnosis.coverage.no_data import without_data
from missing_physics.diagnosis.gear.transmission import TransmissionResult, diagnose_transmission
from missing_physics.diagnosis.gear_runs.applied import found_gears
from missing_physics.diagnosis.gear_runs.merge import with_transmission
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.options import Options
from missing_physics.diagnosis.regression import by_regression, check_input
from missing_physics.results.result import Result
from robot_model import InputError, Recording, Robot, robot_from_toml, robot_to_toml

__all__ = ["Options", "by_weighing", "diagnose"]

Said = Callable[[str], None]


def diagnose(
    robot: Robot,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    options: Options | None = None,
    progress: Said | None = None,
) -> Result:
    """Find what the robot's description leaves out.

    Args:
        robot: the nominal robot.
        recordings: what is fitted; must hold every moving joint's position.
        validation: what is only predicted; when empty, a quarter of each recording is held out.
        options: see `Options`.
        progress: called with a phrase whenever something new is tried.

    Raises:
        InputError: a recording lacks what a diagnosis needs, or its channels contradict each other
            (`ContradictionError`), or one is given twice.
    """
    recordings, validation = (
        tuple(on_both_sides(robot, one) for one in several) for several in (recordings, validation)
    )
    reason = why_not_weighed(robot, (*recordings, *validation))
    if not reason:
        with suppress(np.linalg.LinAlgError):  # numbers that no fit tells apart: the other way shrinks them
            return by_weighing(robot, recordings, validation, options=options, progress=progress)
    if robot.transmissions:
        reason = (
            reason or "the recordings do not determine its parameters; record a faster motion of more joints"
        )
        raise InputError(
            f"robot '{robot.name}' has transmissions and cannot be diagnosed with them as it is: {reason}."
        )
    return by_regression(robot, recordings, validation, options=options, progress=progress)


@threadpool_limits.wrap(limits=1, user_api="blas")
def by_weighing(
    robot: Robot,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    options: Options | None = None,
    progress: Said | None = None,
) -> Result:
    """The diagnosis by weighed hypotheses, see `diagnose`, where nothing is against it (`why_not_weighed`).

    Linear algebra runs on one thread meanwhile: its matrices are small, so that more threads wait for each
    other, and sums do not depend on how many processors there are.
    """
    began, chosen = time.monotonic(), options or Options()
    every, fitted = (*recordings, *validation), len(recordings)
    tell: Said = progress or (lambda phrase: None)
    tell("estimating motion and torque")
    check_input(every, fitted, chosen)
    ready = prepared(robot, every, cutoff=chosen.cutoff, as_recorded=chosen.as_recorded)
    used, along = ready.recordings, ready.dynamics
    if not chosen.as_recorded:
        tell("checking the channels against each other")
        require_no_contradiction(robot, used, along, cutoff=chosen.cutoff)
    require_same_torques(robot, used[:fitted], along[:fitted])
    covered = coverage(robot, used, along, fitted=fitted, dead=ready.dead)
    names = tuple(r.source for r in used[:fitted]), tuple(r.source for r in used[fitted:])
    if not covered.enough:
        return replace(without_data(robot, names, covered), seconds=time.monotonic() - began)
    found, moved = answered(robot, used[:fitted], used[fitted:], cutoff=chosen.cutoff, progress=tell)
    told = found.diagnosis
    told = replace(
        told,
        findings=tuple(with_priors(finding, robot) for finding in told.findings),
        could_not_tell=(*covered.sentences, *told.could_not_tell),
    )
    tell("comparing with the standard model")
    lacking = [joint.name for joint in covered.joints if joint.reason is not None]
    whole = compared(replace(found, diagnosis=told), robot, moved, fitted, None, beside=True)
    if has_two_encoders(robot, used):
        segments = tuple(Segment(robot, dynamics, dynamics.motion) for dynamics in along)
        gap = diagnose_transmission(
            robot, used[:fitted], used[fitted:], segments=segments, seed=chosen.seed, progress=tell
        )
        whole = _with_gears(whole, gap, robot)
    return replace(judged(whole, robot, lacking), seconds=time.monotonic() - began)


def _with_gears(result: Result, gap: TransmissionResult | None, robot: Robot) -> Result:
    """`result` with what lies between two encoders; errors of torques are those of the file without it."""
    gears = found_gears(robot, gap)
    whole = with_transmission(result, gap, robot, gears.words)
    if not gears.uses:
        return whole
    file = robot_from_toml(whole.augmented_robot_toml).with_effects(*gears.uses)
    told = whole.diagnosis
    told = replace(told, fit=replace(told.fit, bands=()))
    return replace(whole, augmented_robot_toml=robot_to_toml(file), diagnosis=told)

"""The pipeline from recordings to a diagnosis."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from missing_physics.answer import answered
from missing_physics.checks.stamps import on_even_clock
from missing_physics.checks.transmissions import on_both_sides
from missing_physics.coverage import Coverage, Prepared, coverage, prepared, require_same_torques
from missing_physics.coverage.contradictions import require_no_contradiction
from missing_physics.coverage.no_data import without_data
from missing_physics.diagnosis.base.file import with_base, without_base_effects
from missing_physics.diagnosis.base.information import of_bodies
from missing_physics.diagnosis.base.stage import diagnose_base
from missing_physics.diagnosis.comparison.credible import with_priors
from missing_physics.diagnosis.comparison.stage import compared, judged
from missing_physics.diagnosis.gear.transmission import TransmissionResult, diagnose_transmission
from missing_physics.diagnosis.gear_file.effects import compliant_joints
from missing_physics.diagnosis.gear_file.merge import with_transmission
from missing_physics.diagnosis.given import has_two_encoders, require_usable, require_weighable
from missing_physics.diagnosis.known.effects import ignored_gears, restored, stripped
from missing_physics.diagnosis.known.gears import behind_gears
from missing_physics.diagnosis.known.sensors import without_sensor_errors
from missing_physics.diagnosis.options import Options
from missing_physics.diagnosis.ripple.stage import with_ripple
from missing_physics.results.result import Result
from missing_physics.standard.layout import Information
from robot_model import InputError, Recording, Robot, robot_from_toml, robot_to_toml

__all__ = ["Options", "diagnose"]

Progress = Callable[[str], None]


@threadpool_limits.wrap(limits=1, user_api="blas")
def diagnose(
    robot: Robot,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    options: Options | None = None,
    progress: Progress | None = None,
) -> Result:
    """Find the physics that the robot's description leaves out.

    Linear algebra runs on one thread: the matrices are small, so more threads would only wait for each other,
    and results do not depend on the number of processors.

    Args:
        robot: the nominal robot.
        recordings: those that are fitted, with the position of every moving joint.
        validation: those that are only predicted; if empty, a quarter of each recording is held out.
        options: see `Options`.
        progress: called with a phrase at each step.

    Raises:
        InputError: the robot or a recording cannot be diagnosed (`require_weighable`), a recording is given
            twice, or channels contradict each other (`ContradictionError`).
    """
    began, chosen, fitted = time.monotonic(), options or Options(), len(recordings)
    report_progress: Progress = progress or (lambda phrase: None)
    timed = [on_even_clock(one) for one in (*recordings, *validation)]
    given = tuple(on_both_sides(robot, one) for one, _ in timed)
    require_weighable(robot, given)
    require_usable(given, fitted, chosen.cutoff)
    report_progress("estimating motion and torque")
    nominal, every = stripped(robot, given), [without_sensor_errors(robot, one) for one in given]
    ready = prepared(nominal, every, cutoff=chosen.cutoff, as_recorded=chosen.as_recorded)
    used, along = ready.recordings, ready.dynamics
    if not chosen.as_recorded:
        report_progress("checking the channels against each other")
        require_no_contradiction(nominal, used, along, cutoff=chosen.cutoff)
    require_same_torques(nominal, used[:fitted], along[:fitted])
    covered = coverage(nominal, used, along, fitted=fitted, dead=ready.dead)
    gap = _between_encoders(robot, ready, fitted, report_progress)
    base = diagnose_base(nominal, used, fitted, along=along, progress=report_progress)
    result = without_data(nominal, used[:fitted], used[fitted:], covered)
    if covered.enough:
        without_base = without_base_effects(nominal, used, along, base)
        rigid = behind_gears(nominal, without_base, along, compliant_joints(robot, gap))
        searched = () if base is None else base.searched
        result = _weighed(nominal, rigid, fitted, covered, chosen, searched, of_bodies(base), report_progress)
    if gap is not None:
        result = with_transmission(result, gap, robot)
    if base is not None:
        result = with_base(result, base, nominal)
    lacking = [joint.name for joint in covered.joints if joint.reason is not None]
    result = judged(result, nominal, lacking)
    open_ = (*result.diagnosis.could_not_tell, *ignored_gears(robot, given))
    file = restored(robot_from_toml(result.augmented_robot_toml), robot, given)
    return replace(
        result,
        diagnosis=replace(
            result.diagnosis,
            could_not_tell=open_,
            notes=(*result.diagnosis.notes, *filter(None, (words for _, words in timed))),
        ),
        augmented_robot_toml=robot_to_toml(file),
        seconds=time.monotonic() - began,
    )


def _weighed(
    robot: Robot,
    used: Sequence[Recording],
    fitted: int,
    covered: Coverage,
    options: Options,
    searched: Collection[str],
    extra: Information | None,
    report_progress: Progress,
) -> Result:
    """The diagnosis of the torques, compared with the standard model."""
    try:
        found, in_time = answered(
            robot,
            used[:fitted],
            used[fitted:],
            cutoff=options.cutoff,
            experiments=options.seed if options.experiments else None,
            searched=searched,
            extra=extra,
            progress=report_progress,
        )
    except np.linalg.LinAlgError:
        raise InputError(
            f"the recordings do not determine the parameters of robot '{robot.name}'; record a faster motion "
            "of more joints, or check the masses and inertias in the robot file."
        ) from None
    diagnosis = replace(
        found.diagnosis,
        findings=tuple(with_priors(finding, robot) for finding in found.diagnosis.findings),
        could_not_tell=(*covered.sentences, *found.diagnosis.could_not_tell),
    )
    report_progress("comparing with the standard model")
    whole = compared(replace(found, diagnosis=diagnosis), robot, in_time, fitted)
    slow = min(band.torque for band in whole.diagnosis.fit.bands)
    return with_ripple(whole, robot, in_time, fitted, slow, report_progress)


def _between_encoders(
    robot: Robot, ready: Prepared, fitted: int, report_progress: Progress
) -> TransmissionResult | None:
    """Diagnosis of the transmissions of joints with two encoders; None without any."""
    used = ready.recordings
    if not has_two_encoders(robot, used):
        return None
    return diagnose_transmission(
        robot, used[:fitted], used[fitted:], along=ready.dynamics, progress=report_progress
    )

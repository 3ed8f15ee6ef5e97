"""Diagnosis of what turns a free base: its gyros compared with hypotheses as torques are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.answer.answer import dismissed, rung
from missing_physics.checks.gyros import gyro_channels
from missing_physics.diagnosis.base.candidates import on_board
from missing_physics.diagnosis.base.data import BaseData
from missing_physics.diagnosis.base.findings import left_by, left_by_file, stated_terms, told_by
from missing_physics.diagnosis.base.rates import Rates
from missing_physics.diagnosis.coverage.joints import FEWEST_ROWS
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.further.errors import beyond_noise
from missing_physics.diagnosis.further.findings import Reading, findings_of
from missing_physics.diagnosis.further.merge import Further
from missing_physics.hypotheses import BODIES, Term
from missing_physics.inference import Fit, search, weighed
from missing_physics.inference.fit import residuals
from missing_physics.results.comparison import AT_NOISE
from missing_physics.results.result import Mismatch
from robot_model import Recording, Robot

__all__ = ["BaseResult", "diagnose_base"]

Array = NDArray[np.float64]

TURNED = (
    "The base does not turn as the joints' motion and conservation of momentum demand: something on board "
    "moves, something outside the robot acts on it, or bodies differ from the robot file's."
)


@dataclass(frozen=True, kw_only=True)
class BaseResult(Further):
    """What the gyros of a free base say, whose zeros are free in the errors.

    Attributes:
        terms: the findings, as fitted.
        searched: ids of the effects on board that were compared.
        data, answer: rows and the most probable hypothesis; None where there are none.
    """

    terms: tuple[Term, ...] = ()
    searched: tuple[str, ...] = ()
    data: BaseData | None = None
    answer: Fit | None = None

    def written(self, file: Robot) -> BaseResult:
        """The same with the errors and series of a robot file, with other bodies too."""
        if self.data is None or self.answer is None:
            return self
        data, runs = self.data, range(len(self.data.runs))
        before = [left_by(data, self.answer, (), i) for i in runs]
        after = [left_by_file(data, self.answer, self.terms, file, i) for i in runs]
        fit, shown = told_by(data, before, after)
        return replace(self, fit=fit, series=shown)


def diagnose_base(
    robot: Robot,
    recordings: Sequence[Recording],
    fitted: int,
    *,
    along: Sequence[MotionDynamics],
    progress: Callable[[str], None] | None = None,
) -> BaseResult | None:
    """Name what makes a free base turn otherwise than momentum demands.

    Args:
        robot: the nominal robot.
        recordings: those that are fitted first; a quarter of each is held out where there are no others.
        fitted: how many are fitted.
        along: motion and dynamics of each recording.
        progress: called with a phrase whenever something new is tried.

    Returns:
        None for a fixed base, and where no gyro is in all recordings.
    """
    channels = gyro_channels(robot, recordings)
    runs = [Rates(*each, channels) for each in zip(along, recordings)]
    if not channels or min(run.time.size for run in runs) < FEWEST_ROWS:
        return None
    if progress:
        progress("weighing what turns the base")
    found = search(BaseData.of(runs, fitted), progress)
    known = weighed(found)
    data, fit = found.data, known.answer
    findings = findings_of(found, known, Reading(lambda _: range(len(channels))))
    terms = stated_terms(fit, findings)
    before, after = ([left_by(data, fit, own, i) for i in range(len(runs))] for own in ((), terms))
    errors, series = told_by(data, before, after)
    return BaseResult(
        mismatch=tuple(_located(data, before)),
        findings=findings,
        terms=terms,
        fit=errors,
        could_not_tell=(*_open_questions(data, fit, terms), *dismissed(found, findings)),
        searched=tuple(effect.id for effect in on_board()),
        ladder=tuple(rung(found, step) for step in found.steps),
        series=series,
        data=data,
        answer=fit,
    )


def _located(data: BaseData, left: Sequence[Array]) -> Iterator[Mismatch]:
    """Gyros that the robot file does not predict, largest share first."""
    for k, rms, floor, share, p_value in beyond_noise(data, left[: data.fitted]):
        words = (
            f"base: {data.joints[k]} differs by {rms:.3g} rad/s rms from what the robot file predicts, "
            f"where noise and the error of any model make {floor:.2g} rad/s. {TURNED}"
        )
        yield Mismatch("base", data.joints[k], share, p_value, words=words)


def _open_questions(data: BaseData, fit: Fit, terms: tuple[Term, ...]) -> Iterator[str]:
    """What gyros leave open."""
    yield (
        "base: the zero of each gyro was left free: a constant rate of the base and an error of its sensor "
        "look the same."
    )
    started = sorted(set(data.further) - fit.hypothesis.from_file)
    if started:
        runs = sorted({1 + int(name.rsplit(" ", 1)[1]) for name in started})
        yield (
            f"base: it turned already at the start of recording {', '.join(map(str, runs))}, which no robot "
            "file holds: its prediction starts at rest."
        )
    floor = np.hypot(data.noise, data.error)
    rows = [data.fitted_rows(i) for i in range(data.fitted)]
    file = np.concatenate([left_by(data, fit, terms, i)[own] for i, own in enumerate(rows)])
    free = np.concatenate([residuals(data, fit, i)[own] for i, own in enumerate(rows)])
    with_file, with_fit = (np.sqrt(np.mean((part / floor) ** 2)) for part in (file, free))
    if with_file > AT_NOISE * max(with_fit, 1.0):
        how = "within 10 %" if BODIES in fit.hypothesis.from_file else "by more than 10 %"
        better = with_file / max(with_fit, 1.0)
        yield (
            f"base: masses, centres or inertias that differ {how} from the robot file's would predict its "
            f"gyros {better:.2g} times better; which of them do, they cannot tell, and the "
            "robot file keeps its own."
        )

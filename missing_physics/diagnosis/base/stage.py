"""Diagnosis of a free base from its gyros, by the same inference as for torques."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.answer.answer import dismissed, rung
from missing_physics.checks.gyros import gyro_channels
from missing_physics.coverage.joints import FEWEST_ROWS
from missing_physics.diagnosis.base.candidates import on_board
from missing_physics.diagnosis.base.data import BaseData
from missing_physics.diagnosis.base.findings import (
    errors_and_series,
    residual_of,
    residual_of_file,
    stated_terms,
)
from missing_physics.diagnosis.further.errors import beyond_noise
from missing_physics.diagnosis.further.findings import Reading, findings_of
from missing_physics.diagnosis.further.merge import Further
from missing_physics.hypotheses import BODIES, Term
from missing_physics.inference import Fit, search, weighed
from missing_physics.inference.fit import residuals
from missing_physics.motion.base.rates import Rates
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.results.comparison import AT_NOISE
from missing_physics.results.result import Mismatch
from robot_model import Recording, Robot

__all__ = ["BaseResult", "diagnose_base"]

Array = NDArray[np.float64]

TURNED = (
    "The base does not turn as the joints' motion and conservation of momentum require: something on board "
    "moves, an external force acts on the robot, or bodies differ from the robot file."
)


@dataclass(frozen=True, kw_only=True)
class BaseResult(Further):
    """Diagnosis of the gyros of a free base; errors are relative to free gyro offsets.

    Attributes:
        terms: fitted terms of the findings.
        searched: ids of the effects at the base that were compared.
        data, answer: rows and most probable hypothesis; None without any.
    """

    terms: tuple[Term, ...] = ()
    searched: tuple[str, ...] = ()
    data: BaseData | None = None
    answer: Fit | None = None

    def written(self, file: Robot) -> BaseResult:
        """The result with errors and series of a robot file, which may have other bodies."""
        if self.data is None or self.answer is None:
            return self
        data, runs = self.data, range(len(self.data.runs))
        before = [residual_of(data, self.answer, (), i) for i in runs]
        after = [residual_of_file(data, self.answer, self.terms, file, i) for i in runs]
        fit, shown = errors_and_series(data, before, after)
        return replace(self, fit=fit, series=shown)


def diagnose_base(
    robot: Robot,
    recordings: Sequence[Recording],
    fitted: int,
    *,
    along: Sequence[MotionDynamics],
    progress: Callable[[str], None] | None = None,
) -> BaseResult | None:
    """Find the effects that make a free base deviate from momentum conservation.

    Args:
        robot: the nominal robot.
        recordings: the fitted ones first; a quarter of each is held out if there are no others.
        fitted: number of recordings that are fitted.
        along: motion and dynamics of each recording.
        progress: called with a phrase whenever something new is tried.

    Returns:
        None for a fixed base, and if no gyro is in all recordings.
    """
    channels = gyro_channels(robot, recordings)
    runs = [Rates(*each, channels) for each in zip(along, recordings)]
    if not channels or min(run.time.size for run in runs) < FEWEST_ROWS:
        return None
    if progress:
        progress("weighing hypotheses on the rates of the base")
    found = search(BaseData.of(runs, fitted), progress)
    known = weighed(found)
    data, fit = found.data, known.answer
    findings = findings_of(found, known, Reading(lambda _: range(len(channels))))
    terms = stated_terms(fit, findings)
    before, after = ([residual_of(data, fit, own, i) for i in range(len(runs))] for own in ((), terms))
    errors, series = errors_and_series(data, before, after)
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
    """Gyros whose residual exceeds the noise, largest share first."""
    for k, rms, floor, share, p_value in beyond_noise(data, left[: data.fitted]):
        words = (
            f"base: {data.joints[k]} differs by {rms:.3g} rad/s rms from the robot file's prediction; "
            f"noise and the error of any model account for {floor:.2g} rad/s. {TURNED}"
        )
        yield Mismatch("base", data.joints[k], share, p_value, words=words)


def _open_questions(data: BaseData, fit: Fit, terms: tuple[Term, ...]) -> Iterator[str]:
    """Sentences on what the gyros cannot determine."""
    yield (
        "base: the offset of each gyro was left free: a constant rate of the base and an offset of its "
        "sensor are indistinguishable."
    )
    started = sorted(set(data.further) - fit.hypothesis.from_file)
    if started:
        runs = sorted({1 + int(name.rsplit(" ", 1)[1]) for name in started})
        yield (
            f"base: it was already turning at the start of recording {', '.join(map(str, runs))}, which a "
            "robot file cannot state: its prediction starts at rest."
        )
    floor = np.hypot(data.noise, data.error)
    rows = [data.fitted_rows(i) for i in range(data.fitted)]
    file = np.concatenate([residual_of(data, fit, terms, i)[own] for i, own in enumerate(rows)])
    free = np.concatenate([residuals(data, fit, i)[own] for i, own in enumerate(rows)])
    with_file, with_fit = (np.sqrt(np.mean((part / floor) ** 2)) for part in (file, free))
    if with_file > AT_NOISE * max(with_fit, 1.0):
        how = "within 10 %" if BODIES in fit.hypothesis.from_file else "by more than 10 %"
        better = with_file / max(with_fit, 1.0)
        yield (
            f"base: masses, centres or inertias that differ {how} from the robot file's would predict its "
            f"gyros {better:.2g} times better; the gyros do not determine which of them differ, so the "
            "robot file keeps its values."
        )

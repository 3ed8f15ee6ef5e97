"""What runs in closed loop say of names between two encoders, and of their rivals.

Along the recorded motion the torque of a gear is an estimate: inverse dynamics knows nothing of a stop that
the joint ran into, and the motor's torque holds the friction in front of the gear. What such an estimate
lacks may be read as physics of the gear. In a run everything that was found acts at once, and the gear winds
up under its own torque. So each name is run with and without, and with its rivals in its place; the gap of a
run is held against the recorded one through the same filter, and every other channel as in
`runs/confirmation.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.gear.causes import Cause
from missing_physics.diagnosis.gear.findings import AMBIGUOUS, numbers_of_gap
from missing_physics.diagnosis.gear.fit import GapFit, fit_gap
from missing_physics.diagnosis.gear.gap import Gap
from missing_physics.diagnosis.gear.refinement import with_exact_hysteresis, with_exact_shapes
from missing_physics.diagnosis.gear.search import clashes, plausible_shapes
from missing_physics.diagnosis.gear.transmission import JointWork, TransmissionResult, result_of
from missing_physics.diagnosis.gear_runs.applied import found_gears, found_sensors
from missing_physics.diagnosis.gear_runs.play import play_in_runs
from missing_physics.diagnosis.naming.judge import ruled_out
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.confirmation import EXCHANGE, REGRESSION
from missing_physics.diagnosis.runs.energies import CONFIRMED, INDEPENDENT, INEXACT, beyond, evidence_for
from missing_physics.diagnosis.runs.rivals import RUN
from missing_physics.results.result import Alternative, Finding, Result
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Robot, robot_from_toml, robot_to_toml

__all__ = ["gaps_in_runs"]

Array = NDArray[np.float64]
Key = tuple[str, str]

#: A run does as well as another where no recording brings more evidence against it.
AS_WELL = 0.5
#: Mean square of the filtered gap's error, in units of the encoders' noise, that is called down to the noise:
#: the noise is known to 15 % (`transmission.FLOOR_TOLERANCE`).
QUIET = 1.15**2
#: Exchanges at one joint at most.
MOST = 2


def gaps_in_runs(
    found: Result,
    gap: TransmissionResult | None,
    robot: Robot,
    replay: Replay | None,
    progress: Progress,
) -> tuple[Result, TransmissionResult | None]:
    """`found` and `gap` with names between encoders, and their chances, as runs in closed loop leave them.

    A name without which no recording is run worse goes. A rival that runs clearly better takes the name's
    place. Runs are heard where the better one of two leaves little of the gap.

    Args:
        found: of the torques; its augmented robot has the gears of `gap`.
        gap: of the encoders; None without two at any joint.
        robot: as the user described it.
        replay: runs along all recordings; None where that is not possible: nothing changes then.
    """
    if replay is None or gap is None or not found.real:
        return found, gap
    written = robot_from_toml(found.augmented_robot_toml)
    written = written.with_effects(*_new(written, found_sensors(gap.findings)))
    works = []
    for work in gap.works:
        if not any(_geared(finding.effect) for finding in work.findings):
            works.append(work)
            continue
        progress(f"running what lies between motor and {work.name} in closed loop")
        held = _Joint(work, robot, written, replay)
        works.append(held.with_play(work) or held.settled())
        written = held.robot_told(works[-1]) or written
    if works == list(gap.works):
        return found, gap
    own = {(use.effect, use.at) for use in robot_from_toml(found.augmented_robot_toml).effects}
    kept = [u for u in written.effects if _geared(u.effect) or (u.effect, u.at) in own]
    changed = robot_to_toml(written.model_copy(update={"effects": tuple(kept)}))
    return replace(found, augmented_robot_toml=changed), result_of(works, gap.known)


@dataclass
class _Joint:
    """What lies between the encoders of one joint, in runs."""

    work: JointWork
    nominal: Robot
    written: Robot
    replay: Replay
    _energies: dict[str, list[Array] | None] = field(default_factory=dict)

    def settled(self) -> JointWork:
        """`work` with what runs leave of its names."""
        fit, remarks = self._needed(self.work.best)
        for _ in range(MOST):
            findings, better = self._weighed(fit)
            if better is None:
                break
            fit = better
        else:
            findings, _ = self._weighed(fit)
        if fit is self.work.best and findings == self.work.findings:
            return self.work
        fits = self.work.fits
        if fit is not self.work.best:
            fits = plausible_shapes(self.work.data, fit, self.work.causes)
        return replace(self.work, fits=fits, by_runs=findings, remarks=(*self.work.remarks, *remarks))

    def with_play(self, work: JointWork) -> JointWork | None:
        """`work` with play that a regression does not tell from its spring; None where no run shows it."""
        others = self._without_gear(self.written)
        fitted = [gap.difference for gap in work.data.gaps[: self.replay.fitted]]
        told = play_in_runs(work.findings, work.name, fitted, others, self.replay)
        return None if told is None else replace(work, by_runs=told)

    def robot_told(self, work: JointWork) -> Robot | None:
        """The robot with all that was found, at this joint what is told of it."""
        if work.by_runs is not None and any(f.effect not in _effects(work.best) for f in work.by_runs):
            return self._robot(work.by_runs)
        return self.robot_of(work.best)

    def _without_gear(self, robot: Robot) -> Robot:
        return robot.model_copy(update={"effects": tuple(u for u in robot.effects if not self._in_gear(u))})

    def robot_of(self, fit: GapFit) -> Robot | None:
        """The robot with all that was found, at this joint what a fit says; None where no file holds that."""
        shown = {_key(finding) for finding in self.work.findings}
        return self._robot([f for f in numbers_of_gap(fit) if f.effect != "sensor_delay" or _key(f) in shown])

    def _robot(self, numbers: Sequence[Finding]) -> Robot | None:
        gears = found_gears(self.nominal, TransmissionResult(findings=tuple(numbers)))
        uses = (*gears.uses, *found_sensors(numbers))
        if {(use.effect, use.at) for use in uses} != {_key(finding) for finding in numbers}:
            return None
        own = {cause.key for cause in self.work.best.causes}
        kept = [u for u in self.written.effects if (u.effect, u.at) not in own and not self._in_gear(u)]
        return self.written.model_copy(update={"effects": (*kept, *uses)})

    def _in_gear(self, use: EffectUse) -> bool:
        return use.at == self.work.name and _geared(use.effect)

    def _needed(self, fit: GapFit) -> tuple[GapFit, list[str]]:
        """A fit without the names that no run needs, and what is said of these."""
        remarks: list[str] = []
        while True:
            trials = [(self._support(fit, rest), cause, rest) for cause, rest in _shorter(self.work, fit)]
            least, cause, rest = min(trials, key=lambda item: item[0], default=(np.inf, None, None))
            if cause is None or rest is None or least > AS_WELL:
                return fit, remarks
            remarks.append(
                f"{cause.effect} at {cause.location} is not named: run in closed loop along all recordings, "
                "the robot without it does as well."
            )
            fit = rest

    def _support(self, fit: GapFit, rest: GapFit) -> float:
        """The most that any recording says for a fit against a shorter one; inf where runs say nothing."""
        heard = self._heard(self._runs(fit), self._runs(rest))
        if heard is None:
            return np.inf
        return max(
            0.5 * INDEPENDENT * float(np.log(beyond(b, INEXACT) / beyond(a, INEXACT)).sum())
            for a, b in zip(*heard)
        )

    def _weighed(self, fit: GapFit) -> tuple[tuple[Finding, ...], GapFit | None]:
        """What a fit says, with chances of rivals by their runs; and a fit that is clearly likelier."""
        found, mine = self._told(fit), self._runs(fit)
        if mine is None:
            return found, None
        best: tuple[float, GapFit | None] = EXCHANGE, None
        told = []
        for finding in found:
            odds: dict[Key, float] = {}
            left: dict[Key, float] = {}
            for rival, trial in self._rivals(fit, finding):
                theirs = self._runs(trial)
                heard = self._heard(mine, theirs)
                if theirs is None or heard is None:
                    continue
                before = np.log(max(_chance(finding, rival), 1e-300) / max(finding.probability, 1e-300))
                evidence = evidence_for(*heard)
                if evidence < 0.0 and not _told(trial, rival):
                    continue  # one of many sizes was run: the others may do better
                odds[rival] = float(np.clip(before, -REGRESSION, REGRESSION)) + evidence
                left[rival] = self._left(theirs)
                if odds[rival] > best[0]:
                    best = odds[rival], trial
            told.append(_with_odds(finding, odds, self._left(mine), left))
        return tuple(told), best[1]

    def _told(self, fit: GapFit) -> tuple[Finding, ...]:
        """Findings of a fit by regression."""
        if fit is self.work.best:
            return self.work.findings
        shown = plausible_shapes(self.work.data, fit, self.work.causes)
        return replace(self.work, fits=shown, by_runs=None).findings

    def _rivals(self, fit: GapFit, finding: Finding) -> Iterator[tuple[Key, GapFit]]:
        """Those of the gear that the regression cannot tell apart, each in the finding's place."""
        order = sorted(finding.alternatives, key=lambda other: -other.probability)
        equal = [o for o in order if o.probability >= AMBIGUOUS * finding.probability][:RUN]
        for other in equal:
            trial = _in_place(self.work, fit, _key(finding), (other.effect, other.location))
            if trial is not None:
                yield (other.effect, other.location), trial

    def _heard(
        self, mine: Sequence[Array] | None, theirs: Sequence[Array] | None
    ) -> tuple[list[Array], list[Array]] | None:
        """Energies of two runs in channels of which the better one leaves next to nothing.

        What else is wrong rules the others. None where the gap is not among them, in all recordings.
        """
        before = self._energies_of(self.nominal)
        if mine is None or theirs is None or before is None:
            return None
        ones, others = [], []
        for none, one, two in zip(before, mine, theirs):
            better = np.minimum(one, two)
            good = (better <= QUIET) | (better - 1.0 <= CONFIRMED * (none - 1.0))
            if not good[-1]:
                return None
            ones.append(one[good])
            others.append(two[good])
        return ones, others

    def _left(self, energies: Sequence[Array]) -> float:
        """Part of what the encoders differ by beyond their noise that a run leaves, over all recordings."""
        there = sum(_mean_square(gap, gap.difference) - 1.0 for gap in self.work.data.gaps)
        return max(sum(float(e[-1]) - 1.0 for e in energies), 0.0) / max(there, 1e-300)

    def _runs(self, fit: GapFit) -> list[Array] | None:
        """Energies of each recording's channels, then of the gap; None where a fit cannot be run."""
        robot = self.robot_of(fit)
        return None if robot is None else self._energies_of(robot)

    def _energies_of(self, robot: Robot) -> list[Array] | None:
        key = robot_to_toml(robot)
        if key not in self._energies:
            found = [self._run(robot, which) for which in range(len(self.replay.asked))]
            known = [energies for energies in found if energies is not None]
            self._energies[key] = known if len(known) == len(found) else None
        return self._energies[key]

    def _run(self, robot: Robot, which: int) -> Array | None:
        gap, names = (
            self.work.data.gaps[which],
            (f"{self.work.name}.position", f"{self.work.name}.motor_position"),
        )
        if not set(names) <= set(self.replay.channels):
            return None
        errors, energies = self.replay.errors(robot, which), self.replay.energies(robot, which)
        if errors is None or energies is None:
            return None
        # Zero errors of encoders look like play under a load of one sign, and are left free as in the fit.
        for name in names:
            energies[self.replay.channels.index(name)] = np.var(errors[name])
        link, motor = (errors[name] * self.replay.sizes(name)[which] for name in names)
        left = np.interp(gap.time, self.replay.asked[which].recording.time, link - motor)
        return np.append(energies, _mean_square(gap, left))


def _key(item: Finding | Alternative) -> Key:
    return item.effect, item.location


def _effects(fit: GapFit) -> set[str]:
    return {cause.effect for cause in fit.causes}


def _geared(effect: str) -> bool:
    return isinstance(get_effect(effect), GearEffect)


def _new(robot: Robot, uses: Sequence[EffectUse]) -> list[EffectUse]:
    there = {(use.effect, use.at) for use in robot.effects}
    return [u for u in uses if (u.effect, u.at) not in there and robot.sensor(u.at) is not None]


def _mean_square(gap: Gap, difference: Array) -> float:
    """Of a difference of encoders through the filter, about its mean, in units of their noise."""
    left = gap.reduce(difference)
    return float(np.var(left)) / max(gap.noise_floor, 1e-300) ** 2


def _shorter(work: JointWork, fit: GapFit) -> Iterator[tuple[Cause, GapFit]]:
    """A fit without each of its names in the gear."""
    for cause in fit.causes:
        if _geared(cause.effect):
            rest = fit_gap(work.data, [c for c in fit.causes if c.key != cause.key])
            if rest.admissible:
                yield cause, rest


def _in_place(work: JointWork, fit: GapFit, own: Key, rival: Key) -> GapFit | None:
    """A fit with a rival in the place of a name, or beside it where one gear may have both."""
    rest = [cause for cause in fit.causes if cause.key != own]
    best: GapFit | None = None
    for shape in (c for c in work.causes if c.key == rival):
        for others in (rest, fit.causes):
            if clashes(shape, [c.key for c in others]) or rival in {c.key for c in others}:
                continue
            trial = fit_gap(work.data, [*others, shape])
            if trial.admissible and (best is None or trial.evidence_over(best) > 0):
                best = trial
    if best is None:
        return None
    return with_exact_hysteresis(work.data, with_exact_shapes(work.data, best), work.causes)


def _told(fit: GapFit, key: Key) -> bool:
    """Whether the data tell that a cause is not nothing."""
    values, halves = fit.values(next(cause for cause in fit.causes if cause.key == key))
    return bool((np.abs(values) > halves).any())


def _chance(finding: Finding, rival: Key) -> float:
    return sum(o.probability for o in finding.alternatives if (o.effect, o.location) == rival)


def _with_odds(finding: Finding, odds: Mapping[Key, float], own: float, left: Mapping[Key, float]) -> Finding:
    """A finding whose rivals have these log odds against it; the others keep theirs.

    `own` and `left` are the parts of the gap that runs with it, and with the rivals, leave.
    """
    if not odds:
        return finding

    def weight(other: Alternative) -> float:
        if _key(other) in odds:
            return float(np.exp(np.clip(odds[_key(other)], -700, 700)))
        return other.probability / max(finding.probability, 1e-300)

    def why(other: Alternative, chance: float) -> str:
        if chance >= AMBIGUOUS or _key(other) not in left:
            return other.why_not
        return ruled_out(left[_key(other)], own)

    others = finding.alternatives
    whole = finding.probability + sum(o.probability for o in others)
    share = whole / (1.0 + sum(weight(o) for o in others))
    told = [replace(o, probability=share * weight(o), why_not=why(o, share * weight(o))) for o in others]
    return replace(
        finding,
        probability=share,
        ambiguous_with=tuple(f"{o.effect}@{o.location}" for o in told if o.probability >= AMBIGUOUS),
        alternatives=tuple(sorted(told, key=lambda o: -o.probability)),
    )

"""Which motion would separate explanations that show in whole runs: of gears, links, a base, or sensors.

What joint torques do not tell apart (`experiments`) is held against each other as the robot itself does it:
both explanations run in closed loop along motions within the limits. Of the two, the one with fewer numbers
is tuned to do what the other one does, to first order; what is left of their difference then counts, in
units of the sensors' noise. A rival's own numbers are those with which it runs closest to the recordings.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from missing_physics.answer.multisine import Limits, MultiSines, as_csv
from missing_physics.diagnosis.least_squares.explanation import TOLD
from missing_physics.diagnosis.replay.references import table_of
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.sensor_errors import as_measured, dear
from missing_physics.diagnosis.runs.fit import RunFit, errors_of, fit_in_runs, linearised
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written.augment import uses_of, with_findings
from missing_physics.results.result import Experiment, Finding, Result
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from robot_model import InputError, Reference, Robot, robot_from_toml

__all__ = ["RunBench"]

Array = NDArray[np.float64]

#: Length of a motion [s] and its rate [Hz].
LENGTH, RATE = 10.0, 200.0
#: Motions drawn, changes of the best one at each spread, and runs for the numbers of a rival; of robots whose
#: runs take long.
DRAWN, TRIED, MOST_RUNS = 6, 2, 40
DRAWN_DEAR, TRIED_DEAR, MOST_DEAR = 3, 1, 12
SPREADS = (0.5, 0.25)
#: Pairs for which a motion is designed.
MOST_PAIRS = 2
#: Part of the largest torque of an actuator that a motion may need.
MARGIN = 0.9
#: Difference of the two runs, in units of the noise, from which a motion is called a separating one.
SEPARATE = 1.0


@dataclass(frozen=True)
class _Explanation:
    """A robot with some terms whose numbers may be tuned, and all else.

    Attributes:
        centred: encoders whose zeros say nothing, as of those on both sides of a gear.
    """

    others: Robot
    terms: tuple[Term, ...]
    centred: frozenset[str] = frozenset()

    def robot(self, terms: Sequence[Term]) -> Robot:
        return self.others.with_effects(*uses_of(terms))

    @property
    def whole(self) -> Robot:
        return self.robot(self.terms)

    @property
    def size(self) -> int:
        return sum(len(term.free) for term in self.terms)


@dataclass(frozen=True)
class _Tried:
    """A motion, and the channel in which explanations differ most along it, in units of its noise (rms)."""

    numbers: MultiSines
    score: float
    channel: str


@dataclass
class RunBench:
    """Designs motions by runs.

    Attributes:
        robot: as the user described it.
        replay: runs along all recordings.
        seed: of the motions that are drawn.
        made: pairs for which one was designed so far.
    """

    robot: Robot
    replay: Replay
    seed: int = 0
    made: int = 0

    def designed(
        self, result: Result, finding: Finding, rival: str, name: str
    ) -> tuple[Experiment, str] | None:
        """The experiment for a finding and the label of its rival, and its motion as CSV text.

        Args:
            result: of the diagnosis; its augmented robot holds what was found.
            name: of the file.

        Returns:
            None where one of the two cannot be run, or where enough pairs have a motion.
        """
        if self.made >= MOST_PAIRS:
            return None
        try:
            pair = self._pair(result, finding, rival)
        except InputError:
            return None
        if pair is None:
            return None
        self.made += 1
        best = self._best(*pair)
        if best is None:
            return None
        time, position = self._positions(best.numbers)
        joints = [joint.name for joint in self.robot.moving_joints]
        sizes = ", ".join(f"{term.label}: {_numbers(term)}" for term in pair[1].terms if term.label == rival)
        return _told(finding, rival, best, name, sizes), as_csv(joints, time, position)

    def _pair(self, result: Result, finding: Finding, rival: str) -> tuple[_Explanation, _Explanation] | None:
        """What was found, and the rival in its place or, in a gear, beside it; None where they cannot run."""
        whole = with_findings(robot_from_toml(result.augmented_robot_toml), result.diagnosis.findings)
        key = finding.effect, finding.location
        own = next((use for use in whole.effects if (use.effect, use.at) == key), None)
        effect, _, at = rival.partition("@")
        if own is None or any((use.effect, use.at) == (effect, at) for use in whole.effects):
            return None
        rest = tuple(use for use in whole.effects if use is not own)
        others = whole.model_copy(update={"effects": rest})
        mine = _term(own.effect, own.at, own.parameters, finding.parameters)
        other = _term(effect, at, mine.parameters if at == own.at else {})
        trials: list[tuple[Term, ...]] = [(other,)]
        if at == own.at and all(isinstance(term.effect, GearEffect) for term in (mine, other)):
            trials.append((mine, _term(effect, at)))
        gears = [term.at for term in (mine, other) if isinstance(term.effect, GearEffect)]
        centred = frozenset(f"{joint}.{kind}" for joint in gears for kind in ("position", "motor_position"))
        replay = self.replay.about_means(centred) if centred else self.replay
        without = errors_of(replay, self.robot)
        if without is None:
            return None
        found = self._fitted(replay, others, trials, without)
        if not found:  # its defaults may be a robot that cannot be
            found = self._fitted(replay, others, [(_usual(effect, at),)], without)
        if not found:
            return None
        _, nearest = min(found, key=lambda item: item[0])
        return _Explanation(others, (mine,), centred), _Explanation(others, nearest, centred)

    def _fitted(
        self, replay: Replay, others: Robot, trials: Sequence[tuple[Term, ...]], without: Array
    ) -> list[tuple[float, tuple[Term, ...]]]:
        """Terms with the numbers that runs tell, and what these leave, of those that can be run."""
        found = []
        most = MOST_DEAR if dear(self.robot) else MOST_RUNS
        for terms in trials:
            built = _Explanation(others, terms).robot
            fit = fit_in_runs(replay, terms, built, without, most_runs=most)
            if fit is not None:
                found.append((fit.energy, _sized(terms, fit)))
        return found

    def _best(self, mine: _Explanation, other: _Explanation) -> _Tried | None:
        """The motion along which they differ most."""
        chance = np.random.default_rng(self.seed)
        count, changes = (DRAWN_DEAR, TRIED_DEAR) if dear(self.robot) else (DRAWN, TRIED)
        joints = len(self.robot.moving_joints)
        tuned, fixed = (mine, other) if mine.size <= other.size else (other, mine)
        tried = [self._tried(MultiSines.drawn(joints, chance), tuned, fixed) for _ in range(count)]
        best = max((one for one in tried if one is not None), key=lambda one: one.score, default=None)
        for spread in SPREADS if best is not None else ():
            assert best is not None
            near = [self._tried(best.numbers.near(spread, chance), tuned, fixed) for _ in range(changes)]
            best = max([best, *(one for one in near if one is not None)], key=lambda one: one.score)
        return best

    def _tried(self, numbers: MultiSines, tuned: _Explanation, fixed: _Explanation) -> _Tried | None:
        """One motion; None where it cannot be run, or needs more torque than there is."""
        time, position = self._positions(numbers)
        names = [joint.name for joint in self.robot.moving_joints]
        tables = tuple(table_of(name, time, column) for name, column in zip(names, position.T))
        reference = Reference(duration=float(time[-1]), sample_rate=RATE, joints=tables)
        try:
            shown = as_measured(fixed.whole.model_copy(update={"reference": reference}))
        except InputError:
            return None
        if self._too_much(shown.channels):
            return None
        along = Replay.of(self.robot.model_copy(update={"reference": reference}), [shown])
        if along is None:
            return None
        linear = linearised(along.about_means(tuned.centred), tuned.terms, tuned.robot)
        if linear is None:
            return None
        left = (linear.errors + linear.columns @ linear.step).reshape(len(along.channels), -1)
        energies = np.mean(left**2, axis=1)
        top = int(np.argmax(energies))
        return _Tried(numbers, float(np.sqrt(energies[top])), along.channels[top])

    def _positions(self, numbers: MultiSines) -> tuple[Array, Array]:
        time = np.arange(0.0, LENGTH + 0.5 / RATE, 1.0 / RATE)
        return time, numbers.positions(time, self._limits)

    @cached_property
    def _limits(self) -> Limits:
        """Of the robot file, else what was asked in the recordings."""
        joints, position, velocity = self.robot.moving_joints, [], []
        for recording in (asked.recording for asked in self.replay.asked):
            names = (f"{joint.name}.reference_position" for joint in joints)
            known = (n if n in recording else n.replace(".reference_", ".") for n in names)
            position.append(np.column_stack([recording[name] for name in known]))
            velocity.append(np.gradient(position[-1], recording.time, axis=0))
        return Limits.of(joints, np.concatenate(position), np.concatenate(velocity))

    def _too_much(self, channels: Mapping[str, Array]) -> bool:
        """Whether an actuator needs more torque than it has."""
        for joint in self.robot.moving_joints:
            limit = joint.actuator.torque_limit if joint.actuator else None
            torque = channels.get(f"{joint.name}.torque")
            if limit and torque is not None and float(np.abs(torque).max()) > MARGIN * limit:
                return True
        return False


def _term(
    effect: str, at: str, known: Mapping[str, float] = MappingProxyType({}), free: Collection[str] = ()
) -> Term:
    """An effect with what is known of its numbers, else with usual ones.

    Args:
        free: numbers that count although the effect does without.
    """
    law = get_effect(effect)
    usual = {p.name: p.typical if p.default is None else p.default for p in law.parameters}
    unseen = tuple(p.name for p in law.estimated if p.default is not None and p.name not in free)
    return Term(law, at, {**usual, **{name: known[name] for name in usual if name in known}}, unseen=unseen)


def _usual(effect: str, at: str) -> Term:
    """An effect all of whose numbers count, as large as they usually are."""
    law = get_effect(effect)
    return Term(law, at, {p.name: p.typical if p.estimated else p.default or 0.0 for p in law.parameters})


def _sized(starts: Sequence[Term], fit: RunFit) -> tuple[Term, ...]:
    """Fitted terms; one whose size came out as nothing as it began: nothing looks like anything."""
    spread = iter(fit.spread)
    sized = []
    for start, term in zip(starts, fit.terms):
        nothing = False
        for parameter in term.estimated:
            value, known = term.parameters[parameter.name], float(next(spread))
            if parameter.name in term.effect.essential and parameter.absent is not None:
                nothing |= abs(value - parameter.absent) <= TOLD * known
        sized.append(start if nothing else term)
    return tuple(sized)


def _numbers(term: Term) -> str:
    return " ".join(f"{name} {term.parameters[name]:.3g}" for name in term.free)


def _told(finding: Finding, rival: str, best: _Tried, name: str, sizes: str) -> Experiment:
    effect = rival.partition("@")[0]
    ways = "; or ".join(dict.fromkeys(get_effect(e).experiment for e in (finding.effect, effect)))
    pair = finding.effect, effect
    if best.score < SEPARATE:
        return Experiment(
            pair,
            f"{ways}. No motion within the limits was found along which runs of the two clearly differ; "
            f"{name} is the best of those tried.",
            "on every motion that was tried runs of the two differ by less than the sensors' noise",
            name,
        )
    return Experiment(
        pair,
        f"run the reference motion in {name} and diagnose again with all recordings; {ways}",
        f"run along it, the two ({sizes}) differ by {best.score:.3g} times the noise of {best.channel}, "
        "whatever the numbers of the simpler one are tuned to",
        name,
    )

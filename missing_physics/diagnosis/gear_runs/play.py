"""What runs say of play in a gear that a regression cannot tell from its spring.

Under a load of one sign a gear with play gives as its spring does: the flanks stay where they are, and an
encoder's zero takes the play's half width. If the load turns now and then, the flanks part for a moment that
is short beside the filter, and a hardening spring imitates that. A run has all of it: how the flanks meet at
first, the moments apart, and the blows. So the spring with play is fitted in runs to what the two encoders
differ by at every sample, and so is the spring alone, and both are held against all recordings. What else is
wrong with the robot moves both encoders alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.gear.findings import AMBIGUOUS
from missing_physics.diagnosis.least_squares.explanation import TOLD
from missing_physics.diagnosis.replay.replay import Asked, Replay
from missing_physics.diagnosis.replay.sensor_errors import dear, spread
from missing_physics.diagnosis.runs.energies import CONFIRMED, DOWN_TO_NOISE, evidence_for, runs_of
from missing_physics.diagnosis.runs.fit import RunFit, errors_of, fit_in_runs
from missing_physics.diagnosis.terms.term import Term
from missing_physics.recordings import sensor_of
from missing_physics.results.result import Alternative, Estimate, Finding
from reference_model.effects.catalogue import get_effect
from reference_model.steppers.effort import Effort
from robot_model import EffectUse, InputError, Robot

__all__ = ["play_in_runs"]

Array = NDArray[np.float64]

SPRING, PLAY = "joint_elasticity", "backlash"
#: Evidence from which a play is named.
SHOWN = 5.0
#: Most that is believed of what runs say.
SUREST = 6.0
#: Play is tried from these parts of what the encoders differ by, and with so many times the stiffness: a
#: spring that imitates the moments apart is softer.
PARTS, STIFFER = (1.0, 0.5, 0.25), (1.0, 3.0, 10.0)
#: No step of a fit is begun after so many runs.
MOST_RUNS = 60
#: Part of critical damping of the flanks, to begin with.
DAMPED = 0.1


def play_in_runs(
    findings: Sequence[Finding], joint: str, difference: Sequence[Array], others: Robot, replay: Replay
) -> tuple[Finding, ...] | None:
    """The findings at a joint with its play, where runs show it.

    Args:
        findings: at the joint.
        joint: its name.
        difference: of its encoders in the fitted recordings [rad or m].
        others: the robot with all that was found but for this joint's gear.
        replay: runs along all recordings.

    Returns:
        None where the regression does not leave the two open, or runs do not tell them apart.
    """
    spring = _open(findings, joint)
    both = {f"{joint}.position", f"{joint}.motor_position"}
    actuator = others.joint(joint).actuator
    if spring is None or actuator is None or actuator.rotor_inertia <= 0:
        return None  # a motor without inertia does not move by itself
    if dear(others) or not both <= set(replay.channels):
        return None
    between = _Between(replay.robot, replay.asked, (f"{joint}.position",), replay.fitted, joint=joint)
    trial = _Trial(joint, others, between)
    without = errors_of(trial.replay, others)
    stiffness = spring.parameters["stiffness"].value
    alone = {name: spring.parameters[name].value for name in spring.parameters}
    if without is None or not 0 < stiffness < np.inf:
        return None
    mine = trial.best([(trial.spring(alone),)], without)
    width = max(max(abs(float(np.median(d))), float(np.ptp(d)) / 2) for d in difference)
    starts = [trial.with_play(stiffness * more, part * width) for part in PARTS for more in STIFFER]
    theirs = trial.best(starts, without)
    if theirs is None:
        return None
    evidence = trial.evidence(mine, theirs)
    if evidence is None or evidence < SHOWN or not _told(theirs):
        return None
    chance = float(1.0 / (1.0 + np.exp(-min(evidence, SUREST))))
    unit = "m" if others.joint(joint).kind == "prismatic" else "rad"
    named = _named(theirs, spring, chance, unit)
    return tuple(item for f in findings for item in (named if f is spring else (f,)))


def _open(findings: Sequence[Finding], joint: str) -> Finding | None:
    """The spring beside which play is as probable as none; None where there is no such spring."""
    gear = [f for f in findings if f.location == joint]
    if [f.effect for f in gear] != [SPRING] or f"{PLAY}@{joint}" not in gear[0].ambiguous_with:
        return None
    return gear[0]


@dataclass
class _Between(Replay):
    """Runs of which only the difference of two encoders counts, about its mean, as the encoder's channel.

    Attributes:
        joint: between whose encoders.
    """

    joint: str = ""

    def _run(self, robot: Robot, asked: Asked, effort: Effort) -> dict[str, Array] | None:
        names = f"{self.joint}.position", f"{self.joint}.motor_position"
        errors = self.found(robot, asked, names, effort)
        if errors is None:
            return None
        sensors = (sensor_of(robot, asked.recording, name) for name in names)
        one, other = (spread(sensor) for sensor in sensors if sensor is not None)
        apart = (errors[names[0]] * one - errors[names[1]] * other) / float(np.hypot(one, other))
        return {names[0]: apart - apart.mean()}


@dataclass
class _Trial:
    """One gear in runs."""

    joint: str
    others: Robot
    replay: Replay

    def spring(self, numbers: dict[str, float]) -> Term:
        """The spring alone, with usual damping to begin with."""
        law = get_effect(SPRING)
        known = {p.name: numbers.get(p.name, p.default or 0.0) for p in law.parameters}
        known["damping"] = self._damping(known["stiffness"])
        unseen = tuple(p.name for p in law.estimated if p.name not in {*numbers, "damping"})
        return Term(law, self.joint, known, unseen=unseen)

    def with_play(self, stiffness: float, width: float) -> tuple[Term, Term]:
        law = get_effect(PLAY)
        numbers = {p.name: p.default or 0.0 for p in law.parameters}
        return self.spring({"stiffness": stiffness}), Term(law, self.joint, {**numbers, "half_width": width})

    def _damping(self, stiffness: float) -> float:
        actuator = self.others.joint(self.joint).actuator
        assert actuator is not None
        return 2 * DAMPED * float(np.sqrt(stiffness * actuator.gear_ratio**2 * actuator.rotor_inertia))

    def robot(self, terms: Sequence[Term]) -> Robot | None:
        uses = []
        for term in terms:
            try:
                uses.append(
                    EffectUse.model_validate({"effect": term.key[0], "at": term.at, **term.parameters})
                )
            except (InputError, ValueError):
                return None
        return self.others.with_effects(*uses)

    def best(self, starts: Sequence[tuple[Term, ...]], without: Array) -> RunFit | None:
        """The fit from the start whose run comes nearest."""
        runs = []
        for terms in starts:
            errors = errors_of(self.replay, self.robot(terms))
            if errors is not None:
                runs.append((float(errors @ errors), terms))
        if not runs:
            return None
        _, terms = min(runs, key=lambda run: run[0])
        return fit_in_runs(self.replay, terms, self.robot, without, most_runs=MOST_RUNS)

    def evidence(self, mine: RunFit | None, theirs: RunFit) -> float | None:
        """For play by runs along all recordings; None where these leave much of what differs."""
        energies, before = runs_of(self.replay, self.robot(theirs.terms)), runs_of(self.replay, self.others)
        if energies is None or before is None:
            return None
        mean = [float(np.mean(e)) - 1.0 for e in energies], [float(np.mean(e)) - 1.0 for e in before]
        if sum(mean[0]) > CONFIRMED * sum(mean[1]):
            return None
        own = None if mine is None else runs_of(self.replay, self.robot(mine.terms))
        return SUREST if own is None else max(evidence_for(own, energies), self._by_noise(own, energies))

    def _by_noise(self, own: Sequence[Array], energies: Sequence[Array]) -> float:
        """Log of the odds by the sensors' noise, one number more paid for (Schwarz); 0 beyond the noise."""
        if max(float(np.max(e)) for e in energies) > DOWN_TO_NOISE:
            return 0.0
        rows = [len(asked.recording) for asked in self.replay.asked]
        gained = sum(0.5 * n * float((a - b).sum()) for n, a, b in zip(rows, own, energies))
        return gained - 0.5 * float(np.log(sum(rows)))


def _told(fit: RunFit) -> bool:
    """Whether runs tell that there is play."""
    return all(bool(told) for name, told in zip(_names(fit), fit.told) if name != "damping")


def _named(fit: RunFit, spring: Finding, chance: float, unit: str) -> tuple[Finding, Finding]:
    """The spring with the number that the runs with play told, and the play."""
    values = {
        name: (float(value), float(TOLD * error))
        for name, value, error in zip(_names(fit), fit.values, fit.spread)
    }
    # runs whose flanks part and meet are not smooth in the stiffness, of which a derivative may tell too much
    before = spring.parameters["stiffness"]
    stiffness, known = values["stiffness"]
    regressed = max(before.value - before.ci95[0], before.ci95[1] - before.value) / before.value
    values["stiffness"] = stiffness, max(known, stiffness * regressed if regressed < 1 else 0.0)
    rest = tuple(o for o in spring.alternatives if o.effect != PLAY)
    plain = replace(
        spring,
        parameters={"stiffness": _estimate(*values["stiffness"], spring.parameters["stiffness"].unit)},
        probability=max(chance, spring.probability),
        ambiguous_with=tuple(f"{o.effect}@{o.location}" for o in rest if o.probability >= AMBIGUOUS),
        alternatives=rest,
    )
    play = Finding(
        PLAY,
        spring.location,
        chance,
        {"half_width": _estimate(*values["half_width"], unit)},
        alternatives=(
            Alternative(SPRING, spring.location, 1.0 - chance, "the spring alone leaves more in closed loop"),
        ),
        validation_improvement=spring.validation_improvement,
        note="Found by runs in closed loop: along the recorded motion the spring alone fits equally well.",
    )
    return plain, play


def _estimate(value: float, half: float, unit: str) -> Estimate:
    return Estimate(value, (max(value - half, 0.0), value + half), unit)


def _names(fit: RunFit) -> Iterator[str]:
    return (name for term in fit.terms for name in term.free)

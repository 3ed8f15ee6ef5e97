"""Whose mass properties are wrong, and by what: a load or the link's own, of one link or another.

Along a noisy motion a wrong mass of one link looks much like that of its neighbour, and a load like a link
that is heavier as a whole: what tells them is the smallest of their numbers. Runs in closed loop know it as
well as the sensors do, once each explanation has the numbers with which its own runs come nearest. So these
are fitted, and the likelihoods of all those that leave nothing but noise are held against each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from missing_physics.diagnosis.candidates.walls import tip_of
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.energies import DOWN_TO_NOISE, Build, down_to_noise, runs_of
from missing_physics.diagnosis.runs.fit import errors_of
from missing_physics.diagnosis.runs.numbers import MOST_NUMBERS, as_given, in_runs, refined
from missing_physics.diagnosis.terms.point_masses import as_wrong, nearest_point
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written import words
from reference_model.effects.catalogue import get_effect
from robot_model import Robot

__all__ = ["masses_told"]

#: Effects of mass properties.
MASSES = ("payload", "inertia")
#: Runs after which the fit of one of them begins no further step.
MOST_RUNS = 80
#: Part of its own mass by which a link that was not named starts heavier.
HEAVIER = 0.03
#: Numbers that move torques by less than this, relative to the one that moves them most, are not shown.
NOTHING = 1e-9
#: What a model errs by, as a part of the noise's energy: so much of a likelihood says nothing.
ERRS = 1e-4


@dataclass(frozen=True)
class _Told:
    """One explanation, the term in question, and the logarithm of its evidence or odds."""

    explanation: Explanation
    term: Term
    evidence: float


def masses_told(
    replay: Replay | None, best: Explanation, weighed: Sequence[Weighed], build: Build, progress: Progress
) -> tuple[Explanation, tuple[Weighed, ...], tuple[tuple[Term, str], ...]]:
    """`best` with the load or the wrong inertia that runs tell, beside those that they cannot tell from it.

    It alone, with the robot file's own numbers, where that is enough in every octave of every channel; else
    beside whatever else is named, the numbers of which are fitted with its own.

    Args:
        replay: runs along all recordings; None, or runs that take long, change nothing.
        weighed: the names, with their probabilities.
        build: the robot of an explanation; None where its numbers are not those of a real one.

    Returns:
        The explanation; its names; and those that no run needs then, with the reason.
    """
    named = [item for item in weighed if item.term.effect.id in MASSES]
    unchanged = best, tuple(weighed), ()
    if replay is None or replay.costly or len(named) != 1 or _done(named[0]):
        return unchanged
    [item] = named
    if item.term.key not in {term.key for term in best.found if not term.nominal}:
        return unchanged
    samples = float(sum(len(asked.recording) for asked in replay.asked) * len(replay.channels))
    others = [term for term in best.found if term.key != item.term.key]
    for beside in ([], others) if others else ([],):
        progress("fitting masses in closed loop")
        told = _told(replay, best, item.term, beside, build)
        if not told:
            continue
        told = _ordered(told, 0.5 * ERRS * samples)
        first = told[0]
        robot = build(first.explanation)
        if others and not beside and not (robot and down_to_noise(replay, robot)):
            continue
        names = {term.key for term in first.explanation.found}
        rest = [w for w in weighed if w is not item]
        kept = (_shared(item, told), *(w for w in rest if w.term.key in names))
        gone = tuple((w.term, words.NO_RUN_NEEDS) for w in rest if w.term.key not in names)
        return first.explanation, kept, gone
    return unchanged


def _told(replay: Replay, best: Explanation, own: Term, beside: Sequence[Term], build: Build) -> list[_Told]:
    """Explanations by masses that leave nothing but noise.

    A load is wrong mass properties that a point can have: it is fitted where these leave noise, and begins
    where they are.
    """
    robot, errors = replay.robot, errors_of(replay, replay.robot)
    kept = {term.key for term in beside}
    bare = best
    for term in best.found:
        if term.key not in kept:  # in its place that of the robot file
            bare = replace(bare, terms=tuple(bare.terms_without(term)))

    def fitted(start: Term) -> _Told | None:
        start = _shown(best, start)
        if errors is None or not start.free or start.key in {term.key for term in bare.terms}:
            return None
        trial = as_given(explain(best.problem, best.view, [*bare.terms, start], nuisance=False))
        free = [start, *(term.released for term in beside)]
        free = free if sum(len(in_runs(term).free) for term in free) <= MOST_NUMBERS else [start]
        better = refined(replay, trial, free, build, errors, most_runs=MOST_RUNS)
        energies = None if better is None else runs_of(replay, build(better))
        if better is None or energies is None or max(float(e.max()) for e in energies) > DOWN_TO_NOISE:
            return None
        term = next(t for t in better.found if t.key == start.key)
        return _Told(better, term, _evidence(replay, term, [float(e.sum()) for e in energies]))

    found: list[_Told] = []
    for link in sorted({joint.child for joint in robot.moving_joints}, key=lambda name: name != own.at):
        wrong = fitted(as_wrong(own) if link == own.at else _heavier(robot, link))
        if wrong is not None:
            load = Term(get_effect("payload"), link, {"mass": 0.0, **dict(zip("xyz", tip_of(robot, link)))})
            found += [wrong, *filter(None, [fitted(nearest_point(wrong.term, wrong.term.held, load))])]
    return found


def _shown(best: Explanation, term: Term) -> Term:
    """The term with the numbers free that the motion shows."""
    term = replace(term.released, unseen=())
    _, columns = best.problem.evaluate([term])
    size = np.sqrt(np.mean(columns**2, axis=(0, 1)))
    unseen = (name for name, s in zip(term.free, size) if s <= NOTHING * max(float(size.max()), NOTHING))
    return replace(term, unseen=tuple(unseen))


def _heavier(robot: Robot, link: str) -> Term:
    """A link with some more of its own mass where it has it."""
    body = robot.link(link)
    place = dict(zip("xyz", body.center_of_mass))
    return as_wrong(Term(get_effect("payload"), link, {"mass": HEAVIER * body.mass, **place}))


def _evidence(replay: Replay, term: Term, energies: Sequence[float]) -> float:
    """Logarithm of the likelihood of all recordings, less what the term's numbers cost.

    Each costs half the logarithm of the samples, or what it brings where that is less: one that might as well
    be nothing is none.
    """
    rows = [len(asked.recording) for asked in replay.asked]
    likelihood = -0.5 * sum(n * e for n, e in zip(rows, energies))
    samples = float(np.log(sum(rows) * len(replay.channels)))
    return likelihood - 0.5 * sum(
        min((term.parameters[name] / max(size, 1e-300)) ** 2, samples) for name, size in term.held.items()
    )


def _ordered(told: Sequence[_Told], allowed: float) -> list[_Told]:
    """The likeliest first, and of those that are as likely a load, unless something was taken off.

    Args:
        allowed: what a likelihood may owe to errors of the model: so much tells nothing.
    """
    most = max(t.evidence for t in told)
    told = [replace(t, evidence=min(t.evidence - most + allowed, 0.0)) for t in told]
    return sorted(told, key=lambda t: (-t.evidence, *_rank(t.term)))


def _rank(term: Term) -> tuple[bool, bool]:
    """A load, what is wrong, and what nobody took off as nobody put it on."""
    load, lighter = term.effect.id == "payload", term.parameters["mass"] < 0
    return load and lighter, not load


def _done(item: Weighed) -> bool:
    """Whether runs have told it from others already."""
    return bool(item.term.held) and any(t.held and t.effect.id in MASSES for t, _ in item.alternatives)


def _shared(item: Weighed, told: Sequence[_Told]) -> Weighed:
    """What a name and its rivals among masses were worth together, shared by what runs say of them."""
    keys = {t.term.key for t in told}
    rest = tuple((term, p) for term, p in item.alternatives if term.key not in keys)
    whole = item.probability + sum(p for term, p in item.alternatives if term.key in keys)
    odds = [t.evidence for t in told]
    shares = whole * np.exp(np.array(odds) - logsumexp(odds))
    first, *others = ((t.term, float(share)) for t, share in zip(told, shares))
    alternatives = sorted((*rest, *others), key=lambda pair: -pair[1])
    return Weighed(*first, tuple(alternatives))

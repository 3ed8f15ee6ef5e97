"""Which physics is missing from a base that floats and from links that bend, where more than encoders tell.

Each candidate is fitted by the likelihood of torques and further channels (`passive/fit.py`), and enters
only if

- its evidence (Bayesian information criterion) beats a hundred times the number of candidates, and what
  errors of the smoother can gain, both against the robot as described with offsets and loads that drift as
  they like, and beside masses, inertias, springs and friction of the joints that are free, whatever they are;
- its numbers differ from "absent" by a jackknife over blocks of time and stay off their bounds;
- the stretches in which every joint moves bear it out alone, with the same numbers: a joint at rest or at a
  reversal sticks, and bristles that yield by less than its encoder tells restrain and damp the modes;
- what it makes likelier is more than what random walks have to stand for beside it: else something is missing
  that has no name here;
- recordings that were not fitted become more likely with its numbers held where every joint moves, and lose
  a part of their errors that is more than noise is known to.

Nothing is looked for where offsets that stay do for the channels of the robot as described: then nothing is
missing there, and what likelihood is left to gain is that of the model of vibration itself. Nor without a
recording that is held out, nor in long recordings.

Numbers are those with walks of greatest likelihood; intervals span those without walks, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.modal.smoother import TORQUE, VibrationSmoother
from missing_physics.diagnosis.naming.search import cut_off
from missing_physics.diagnosis.passive.checks import beside_others, borne_out, moving, needed_of
from missing_physics.diagnosis.passive.fit import PassiveFit, fit_passive, smoother_of
from missing_physics.diagnosis.passive.search import SEARCHED
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Rung
from reference_model.effects.catalogue import get_effect
from robot_model import Robot

__all__ = ["MOST_SAMPLES", "Named", "PassiveSearch", "asked_for", "search_passive", "too_long"]

Array = NDArray[np.float64]
Progress = Callable[[str], None]

#: Effects named at most.
MOST_EFFECTS = 2
#: Times that walks are chosen anew and numbers fitted again.
ROUNDS = 2
#: Part of the held-out errors' energy that has to go. Noise is known to some 5 % of itself: innovations of
#: robots in which nothing is missing came out with an rms of 0.94 to 1.04 where one is right.
LEAST_GAIN = 0.1
#: Largest p-values: of absence, before division by the number of candidates, and of no gain in held-out data.
SIGNIFICANCE, HELD_OUT = 0.01, 0.05
#: Fewest blocks of time of held-out recordings in which every joint moves: fewer hardly tell how they differ.
FEWEST_BLOCKS = 5
#: From this p-value of absence on, a first fit is not gone on with.
HOPELESS = 0.1
#: Longer recordings, all together, would take minutes.
MOST_SAMPLES = 8000
#: Smallest part of what differs that a name is; from the second on nothing more is looked for.
BELIEVED, WHOLE = 2.0 / 3.0, 0.9
#: Rivals that reach this part of the best one's evidence are fitted with its walks.
WORTH_FITTING = 0.2


@dataclass(frozen=True)
class Named:
    """A term that was found.

    Attributes:
        term: with its numbers.
        evidence: for it, beside what else was found.
        belief: of what is missing there, the part that is this.
        rivals: evidence of others in its place.
        intervals: of its numbers, of 95 %.
        gain: part of the held-out error that goes with it.
        by_runs: whether runs in closed loop told it (`passive/runs.py`).
        whole: whether they leave nothing but the sensors' noise with it.
    """

    term: Term
    evidence: float
    belief: float
    rivals: tuple[tuple[Term, float], ...]
    intervals: dict[str, tuple[float, float]]
    gain: float
    by_runs: bool = False
    whole: bool = False


@dataclass
class PassiveSearch:
    """What was found and tried.

    Attributes:
        described: the recordings, nothing added.
        best: with what was found.
        held_out: recordings that only judge.
        named: in the order of naming.
        ladder: every step.
        tried: each effect's numbers in the last search, named or not.
    """

    described: PassiveFit
    best: PassiveFit
    held_out: tuple[Segment, ...]
    named: list[Named] = field(default_factory=list)
    ladder: list[Rung] = field(default_factory=list)
    tried: dict[tuple[str, str], Term] = field(default_factory=dict)


def search_passive(
    robot: Robot,
    fitted: Sequence[Segment],
    held_out: Sequence[Segment],
    directions: Array,
    progress: Progress,
) -> PassiveSearch | None:
    """Name what is missing; None where channels and held-out recordings do not ask for anything.

    Args:
        robot: as described.
        fitted: recordings.
        held_out: those that only judge; nothing is named without.
        directions: combinations of inertial numbers that are free beside every candidate, shape (P, B).
        progress: told what is tried.
    """
    every = (*fitted, *held_out)
    if not held_out or too_long(every) or not asked_for(every):
        return None
    smoothers = [smoother_of(segment) for segment in fitted]
    described = PassiveFit(tuple(fitted), tuple(dict(s.walks) for s in smoothers if s is not None), ())
    search = PassiveSearch(described, described, tuple(held_out))
    for _ in range(MOST_EFFECTS):
        # Walks of the robot as described may take over all that is missing: it stands out without them.
        grown = any(_grow(robot, search, start, directions, progress) for start in _starts(search.best))
        if not grown or search.named[-1].belief > WHOLE:
            break
    return search


def too_long(segments: Sequence[Segment]) -> bool:
    """Whether a search would take minutes."""
    return sum(segment.motion.time.size for segment in segments) > MOST_SAMPLES


def asked_for(segments: Sequence[Segment]) -> bool:
    """Whether the channels of every recording ask for something."""
    smoothers = [smoother_of(segment) for segment in segments]
    return all(smoother is not None and _suspicious(smoother) for smoother in smoothers)


def _starts(best: PassiveFit) -> Iterator[PassiveFit]:
    """The fit so far without loads that walk, and without offsets that do."""
    yield best.walking([{**walks, "load": 0.0} for walks in best.walks])
    yield _without_walks(best)


def _suspicious(smoother: VibrationSmoother) -> bool:
    """Whether offsets or loads have to walk to make its channels of the robot as described likely."""
    return any(rate > 0.0 for what, rate in smoother.walks.items() if what != TORQUE)


def _grow(
    robot: Robot, search: PassiveSearch, start: PassiveFit, directions: Array, progress: Progress
) -> bool:
    """Whether one more effect is named, looked for beside the fit so far with the walks of `start`."""
    best = search.best
    present = {term.key for term in best.terms}
    tried: dict[tuple[str, str], PassiveFit] = {}
    for effect, starts in SEARCHED.items():
        progress(f"weighing {effect.replace('_', ' ')} by all channels")
        gained = max([trial.likelihood - start.likelihood for trial in tried.values()], default=0.0)
        for term in starts(robot, start, get_effect(effect), gained):
            if term.key in present:
                continue
            trial = fit_passive(start.at((*best.terms, term)))
            if term.key not in tried or trial.likelihood > tried[term.key].likelihood:
                tried[term.key] = trial
    if not tried:
        return False
    search.tried.update({key: trial.terms[-1] for key, trial in tried.items()})
    first = {key: _evidence(trial, start) for key, trial in tried.items()}
    key = max(first, key=lambda k: first[k])
    needed = needed_of(tried[key].errors.size, len(tried))
    if first[key] < needed or _absence(tried[key]) > HOPELESS:
        return False
    progress(f"fitting {key[0].replace('_', ' ')} by all channels")
    trial = tried[key]
    evidence = first[key]
    for _ in range(ROUNDS):
        if evidence < needed:
            break
        trial = fit_passive(trial.rewalked())
        evidence = min(_evidence(trial, best), _evidence(trial, best.walking(trial.walks)))
    term = trial.terms[-1]
    why, named = _judged(search, trial, term, evidence, needed, directions, len(tried))
    search.ladder.append(
        Rung(
            effect=key[0],
            location=key[1],
            added_to=tuple(t.label for t in best.terms),
            train_rms=float(np.sqrt(np.mean(trial.errors**2))),
            validation_rms=float("nan"),
            evidence=evidence,
            kept=not why,
            why=why or "strong evidence by all channels, significant, and holds in unseen recordings",
        )
    )
    if why or named is None:
        return False
    rivals = []
    for other, fit in tried.items():
        if other != key and first[other] > WORTH_FITTING * first[key]:
            again = fit_passive(fit.walking(trial.walks))
            rivals.append((again.terms[-1], _evidence(again, best)))
    search.named.append(replace(named, rivals=tuple(rivals)))
    search.best = trial
    return True


def _evidence(trial: PassiveFit, simpler: PassiveFit) -> float:
    """Difference of the Bayesian information criteria."""
    extra = trial.size - simpler.size
    return trial.likelihood - simpler.likelihood - 0.5 * extra * float(np.log(trial.errors.size))


def _absence(trial: PassiveFit) -> float:
    """P-value of the last term's numbers where it is absent."""
    term = trial.terms[-1]
    first = trial.size - len(term.free)
    absent = [first + k for k, p in enumerate(term.estimated) if p.absent is not None]
    return trial.regression.wald_p_value(np.array(absent))


def _judged(
    search: PassiveSearch,
    trial: PassiveFit,
    term: Term,
    evidence: float,
    needed: float,
    directions: Array,
    tried: int,
) -> tuple[str, Named | None]:
    """Why the term may not enter, or what it is."""
    if evidence < needed:
        return f"evidence {evidence:.1f} is below the {needed:.1f} needed", None
    if outermost := cut_off(term):
        return outermost, None
    place = slice(trial.size - len(term.free), trial.size)
    p_value = _absence(trial)
    if p_value > SIGNIFICANCE / tried:
        return f"not significant over blocks of time (p = {p_value:.2g})", None
    beside = beside_others(trial, place, directions)
    if beside < needed:
        return f"masses, inertias and joints do as well (evidence {beside:.1f} beside them)", None
    if unlike := borne_out(trial, place, directions, tried):
        return unlike, None
    still = _without_walks(trial)
    belief = _belief(trial, still, search.best)
    if belief < BELIEVED:
        return f"most of what differs is something else ({belief:.2f} of it is this)", None
    p_value, gain = _in_unseen(search, trial)
    if p_value > HELD_OUT:
        return f"does not lower the held-out error where joints move (p = {p_value:.2g})", None
    if gain < LEAST_GAIN:
        return f"lowers the energy of held-out errors by {100 * gain:.1f} %, as errors of noise may", None
    return "", Named(term, min(evidence, beside), belief, (), _intervals(trial, still, term, place), gain)


def _without_walks(trial: PassiveFit) -> PassiveFit:
    """Offsets constant and no load, the joints' torques walking as they do."""
    return trial.walking([_still(walks) for walks in trial.walks])


def _still(walks: dict[str, float]) -> dict[str, float]:
    return {what: rate if what == "torque" else 0.0 for what, rate in walks.items()}


def _belief(trial: PassiveFit, still: PassiveFit, before: PassiveFit) -> float:
    """R / (R + L): R what the last term makes likelier where nothing walks, L what walks add to that."""
    removed = still.likelihood - still.at(before.terms).likelihood
    left = trial.likelihood - still.likelihood
    return float(removed / (removed + max(left, 0.0))) if removed > 0 else 0.0


def _in_unseen(search: PassiveSearch, trial: PassiveFit) -> tuple[float, float]:
    """Chance that unseen data become no likelier, and the part of their errors' energy that goes."""
    walks = tuple(dict(s.walks) for s in map(smoother_of, search.held_out) if s is not None)
    before = PassiveFit(search.held_out, walks, search.best.terms)
    own = tuple(trial.walks[0] if set(w) == set(trial.walks[0]) else w for w in walks)
    after = PassiveFit(search.held_out, own, trial.terms).rewalked()
    free = moving(search.held_out)
    places, block = np.unique(before.blocks[free], return_inverse=True)
    if places.size < FEWEST_BLOCKS:
        return 1.0, 0.0
    sums = [np.asarray(np.bincount(block, -part.likelihoods[free]), dtype=float) for part in (before, after)]
    plain = [part.walking([_still(w) for w in own]) for part in (before, after)]
    energies = [float(part.errors @ part.errors) for part in plain]
    return paired_block_p_value(sums[0], sums[1]), 1.0 - energies[1] / max(energies[0], 1e-300)


def _intervals(
    trial: PassiveFit, still: PassiveFit, term: Term, place: slice
) -> dict[str, tuple[float, float]]:
    """Of 95 %, with the walks and without."""
    found: dict[str, tuple[float, float]] = {}
    for fit in (trial, fit_passive(still)):
        spread = np.sqrt(np.maximum(np.diagonal(fit.regression.covariance())[place], 0.0))
        for name, value, error in zip(term.free, fit.terms[-1].values, spread):
            low, high = found.get(name, (value, value))
            found[name] = float(min(low, value - 2.0 * error)), float(max(high, value + 2.0 * error))
    return found

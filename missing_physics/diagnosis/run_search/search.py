"""A search by runs in closed loop alone, where a regression along the motion shows nothing, or names nothing.

Torques along an estimated motion carry the noise of twice a derivative. Under a stiff controller with fine
encoders, what a law does to the recorded channels may stand far out of their sensors' noise all the same. So
every effect at every place is held against what differs in closed loop, linearly about the numbers that the
regression gives it, and those that promise most get the numbers that runs tell. What then gives every
recording down to the noise, held-out ones among them, is there. Where no effect alone does, the robot file's
own numbers may, if they are off (`run_search/own_numbers.py`); or they move beside it, as they may have been
tuned to a recording without it (`runs/nominal.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.effects import Sight
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.location.orders import spatial_peaks
from missing_physics.diagnosis.location.residual import outstanding_windows
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.naming.search import Progress, cut_off, incredible
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.sensor_errors import dear
from missing_physics.diagnosis.run_search.own_numbers import by_own_numbers
from missing_physics.diagnosis.run_search.trials import trials
from missing_physics.diagnosis.runs.energies import CONFIRMED, Build, left_in_runs, run_of, runs_of
from missing_physics.diagnosis.runs.fit import RunFit, errors_of, linearised, promise
from missing_physics.diagnosis.runs.nominal import own_numbers
from missing_physics.diagnosis.runs.numbers import (
    NEAR,
    NEARLY,
    Run,
    allowed_in,
    as_given,
    in_runs,
    loudest,
    plainer,
    refined,
    with_numbers,
)
from missing_physics.diagnosis.runs.rivals import HEARD
from missing_physics.diagnosis.terms.real_bodies import unreal
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.structure import StructureEffect

__all__ = ["FoundInRuns", "found_by_runs"]

Array = NDArray[np.float64]

#: Runs after which no other effect is looked at; beside names; of robots whose runs take long.
MOST_LOOKS, MOST_LOOKS_BESIDE, MOST_LOOKS_DEAR = 250, 150, 40
#: Runs after which no step of a fit is begun, and effects that are fitted; of robots whose runs take long.
MOST_FITTED, FITTED = 60, 4
MOST_FITTED_DEAR, FITTED_DEAR = 20, 2
#: Numbers of the robot file that are fitted beside an effect, runs after which no step is begun then, and
#: effects that are fitted so.
MOST_OWN, MOST_FITTED_OWN, FITTED_OWN = 20, 150, 2
#: Runs in the place of names after which nothing is looked for beside the one that comes nearest.
MOST_IN_PLACE = 400
#: What leaves more to first order is no rival of an effect that is found.
NO_RIVAL = 0.02
#: Part of what differs that an effect leaves at most, to first order, which is fitted to such robots.
CLEAR = 0.2


@dataclass(frozen=True)
class FoundInRuns:
    """What a search by runs names.

    Attributes:
        explanation: with the name.
        beaten: names that do not give what was recorded, whatever their numbers.
        beside: what was named before, in the place of which nothing was run.
        equals: names that do so in the place of `name`, with their log odds against it, none above nothing.
        weighed: the names with their probabilities, where the file's own numbers are named.
        cost: of errors and numbers; the less, the likelier.
    """

    explanation: Explanation
    beaten: frozenset[tuple[str, str]]
    beside: frozenset[tuple[str, str]]
    name: tuple[str, str]
    equals: tuple[tuple[Term, float], ...] = ()
    weighed: tuple[Weighed, ...] = ()
    cost: float = np.inf


def found_by_runs(
    replay: Replay | None,
    best: Explanation,
    nothing: Explanation,
    basis: InertialBasis,
    build: Build,
    progress: Progress,
) -> FoundInRuns | None:
    """What a search by runs adds to what is named, or puts in its place.

    Several names of a regression may stand for one beside numbers of the file that were tuned without it,
    and so may one that leaves much in closed loop. So one effect in their place is looked for as well: first
    where there are several, else where nothing is found beside the one; not in the place of a link that bends
    or a base that gives way, with which runs take long.

    Args:
        best, nothing: the explanation with what is named, and without.

    Returns:
        None where there is nothing.
    """
    structures = any(isinstance(term.effect, StructureEffect) for term in best.found)
    if replay is None or not best.found or structures or dear(replay.robot):
        return _found_from(replay, best, basis, build, progress)
    energies = runs_of(replay, build(best))
    several = len(best.found) > 1 and (energies is None or _differ(replay, energies))
    if several:
        found = _found_from(replay, nothing, basis, build, progress, most_runs=MOST_IN_PLACE)
        if found is not None:
            return found
    found = _found_from(replay, best, basis, build, progress)
    if found is not None or several or loudest(replay, build(best)) <= NEARLY:
        return found
    return _found_from(replay, nothing, basis, build, progress, most_runs=MOST_IN_PLACE)


def _found_from(
    replay: Replay | None,
    start: Explanation,
    basis: InertialBasis,
    build: Build,
    progress: Progress,
    *,
    most_runs: float = np.inf,
) -> FoundInRuns | None:
    """The effect with which runs give every recording down to the noise in closed loop, with its numbers.

    Args:
        replay: runs along all recordings; held-out ones only judge, and nothing is looked for without them.
        basis: combinations of the robot's inertial numbers.
        start: the explanation without any name; or with some, to which one is added, their numbers fitted
            with its own, of robots whose runs are quick.
        most_runs: after so many nothing is looked for beside the one that comes nearest.

    Returns:
        None where there is none, and where runs of the robot of `start` do not differ in all recordings.
        Where no effect alone is enough, the robot file's own numbers, or two effects of which one alone
        leaves little, of such robots.
    """
    if replay is None or replay.fitted == len(replay.asked):
        return None
    costly, last = dear(replay.robot), replay.made + most_runs
    begins: Sequence[Explanation]
    if start.found:
        few = not costly and _count([in_runs(term) for term in start.found]) <= MOST_OWN
        begins = (plainer(replay, start, build),) if few else ()
    else:
        begins = (plainer(replay, start, build), as_given(start)) if costly else (as_given(start),)
    for begin in begins:
        start, before = run_of(replay, begin, build)
        if before is not None and _differ(replay, before):
            break
    else:
        return None
    errors = errors_of(replay, build(start))
    if errors is None:
        return None
    bench = _Bench(replay, start, basis, errors, build, progress)
    looks = bench.looks()
    alone = [look for look in looks if look.left <= (CLEAR if costly else NEAR)]
    found = bench.fitted(sorted(alone, key=lambda look: look.left), bench.names)
    nearest = bench.nearest  # beside the file's own numbers as they are
    if bench.own_leave <= CONFIRMED and (bench.names or found is None):
        found = bench.beside_names(found) if bench.names else bench.by_own_numbers()
    if found is None and bench.own:
        beside = [look for look in looks if look.beside <= NEAR * min(bench.own_leave, 1.0)]
        found = bench.fitted(sorted(beside, key=lambda look: look.beside), (*bench.names, *bench.own))
    nearest = nearest or bench.nearest
    if found is None and nearest is not None and not (costly or start.found) and replay.made < last:
        return _found_from(replay, nearest.explanation, basis, build, progress)
    return found


@dataclass(frozen=True)
class _Look:
    """An effect with the numbers a fit goes from, and what it leaves to first order: with the numbers of
    what is named already, and with the robot file's own numbers moved as well."""

    left: float
    beside: float
    trial: Explanation
    term: Term


@dataclass
class _Bench:
    """Runs of a robot with one effect more.

    Attributes:
        start: the explanation without it.
        basis: combinations of inertial numbers.
        errors: of its runs in the fitted recordings.
        nearest: what comes nearest to all recordings of what is not enough, where runs speak for it.
    """

    replay: Replay
    start: Explanation
    basis: InertialBasis
    errors: Array
    build: Build
    progress: Progress
    nearest: Run | None = None

    @cached_property
    def before(self) -> list[Array] | None:
        """Energies of the runs from which an effect has to bring the robot down to the noise."""
        return runs_of(self.replay, self.build(self.start))

    @cached_property
    def names(self) -> tuple[Term, ...]:
        """What is named already, its numbers free."""
        return tuple(term.released for term in self.start.found)

    @property
    def own(self) -> tuple[Term, ...]:
        """The robot file's own numbers; nothing where that takes long."""
        return () if self._own_runs is None else self._own_runs.terms

    @cached_property
    def own_leave(self) -> float:
        """Part of what differs that the file's own numbers alone promise to leave."""
        return 1.0 if self._own_runs is None else promise(self._own_runs, self.errors)

    @cached_property
    def _own_runs(self) -> RunFit | None:
        terms = own_numbers(self.start, self.basis, MOST_OWN)
        if dear(self.replay.robot) or not 0 < _count(terms) <= MOST_OWN:
            return None
        return linearised(self.replay, terms, with_numbers(self.start, self.build))

    def by_own_numbers(self) -> FoundInRuns | None:
        """The file's own numbers alone, where no name is there."""
        if self._own_runs is None or self.names:
            return None
        self.progress("fitting the robot file's own numbers in closed loop")
        own = self._own_runs.terms
        told = by_own_numbers(self.replay, self.start, own, self.basis, self.errors, self.build)
        if told is None:
            return None
        nothing: frozenset[tuple[str, str]] = frozenset()
        return FoundInRuns(told.explanation, nothing, nothing, told.weighed[-1].term.key, (), told.weighed)

    def beside_names(self, found: FoundInRuns | None) -> FoundInRuns | None:
        """Nothing but the file's own numbers beside the names, where that does and is likelier than `found`.

        Numbers that were tuned come out as one more effect else, of next to no size.
        """
        self.progress("fitting the robot file's own numbers beside what is named in closed loop")
        terms = (*self.names, *self.own)
        better = refined(self.replay, self.start, terms, self.build, self.errors, most_runs=MOST_FITTED_OWN)
        energies = None if better is None else runs_of(self.replay, self.build(better))
        if better is None or energies is None:
            return found
        left = left_in_runs(self.replay, energies, self.before)
        whole = Run(better, energies, left, allowed_in(self.replay, self.before)).whole
        if not whole or not _possible(self.replay, better):
            return found
        cost = _cost(self.replay, self.build, better, _count(self.own))
        if found is not None and cost >= found.cost:
            return found
        beside = frozenset(term.key for term in self.names)
        return FoundInRuns(better, frozenset(), beside, self.names[-1].key, cost=cost)

    def _by_names(self) -> Array:
        """Derivatives of the errors by the names' numbers, shape (R, K)."""
        free = tuple(in_runs(term) for term in self.names)
        linear = linearised(self.replay, free, with_numbers(self.start, self.build)) if free else None
        return np.zeros((self.errors.size, 0)) if linear is None else linear.columns

    def looks(self) -> list[_Look]:
        """Each effect at each place."""
        replay, costly, found = self.replay, dear(self.replay.robot), []
        most = MOST_LOOKS_DEAR if costly else MOST_LOOKS_BESIDE if self.names else MOST_LOOKS
        own, named, last = self._own_runs, self._by_names(), replay.made + most
        everything = None if own is None else np.hstack([named, own.columns])
        for trial, term in trials(self.start, self._sights(), structures=not costly):
            if replay.made >= last:
                break
            self.progress(f"looking for {term.effect.id.replace('_', ' ')} at {term.at} in closed loop")
            linear = linearised(replay, (in_runs(term),), with_numbers(trial, self.build))
            if linear is not None:
                left = promise(linear, self.errors, named)
                beside = left if everything is None else promise(linear, self.errors, everything)
                found.append(_Look(left, beside, trial, _at_amplitudes(term, linear)))
        return found

    def _sights(self) -> dict[str, Sight]:
        """When, and in which cycles of the way, positions differ in closed loop, where they do."""
        replay, problem, found = self.replay, self.start.problem, {}
        robot = (self.build(self.start) if self.names else None) or replay.robot
        errors = replay.errors(robot, 0) or {}
        recording, cutoff = replay.asked[0].recording, problem.segments[0].motion.low_pass.cutoff
        for name in problem.joints:
            channel = f"{name}.position"
            if channel in errors and float(np.mean(errors[channel] ** 2)) > HEARD:
                position = recording[channel]
                velocity = np.gradient(position, recording.time)
                orders = spatial_peaks(position, velocity, errors[channel], cutoff=cutoff, count=1)
                found[name] = Sight(outstanding_windows(recording.time, errors[channel])[:1], orders)
        return found

    def fitted(self, looks: Sequence[_Look], others: Sequence[Term]) -> FoundInRuns | None:
        """The effect that brings every recording down to the noise, numbers of `others` free as well."""
        costly, replay, build = dear(self.replay.robot), self.replay, self.build
        most = MOST_FITTED_DEAR if costly else MOST_FITTED_OWN if others else MOST_FITTED
        own = any(term.nominal for term in others)
        found: list[tuple[float, Explanation, Term]] = []
        beaten, allowed = set(), allowed_in(replay, self.before)
        for look in looks[: FITTED_DEAR if costly else FITTED_OWN if own else FITTED]:
            if found and (look.beside if own else look.left) > NO_RIVAL:
                break
            self.progress(f"running {look.term.effect.id.replace('_', ' ')} at {look.term.at} in closed loop")
            made = replay.made
            better = refined(replay, look.trial, (look.term, *others), build, self.errors, most_runs=most)
            arrived = replay.made - made < most
            energies = None if better is None else runs_of(replay, build(better))
            if better is None or energies is None:
                continue
            run = Run(better, energies, left_in_runs(replay, energies, self.before), allowed)
            possible = _possible(replay, better)
            if possible and run.whole:
                term = next(t for t in better.terms if t.key == look.term.key)
                found.append((_cost(replay, build, better, _count([in_runs(look.term)])), better, term))
                continue
            if arrived:
                beaten.add(look.term.key)
            least = NEAR if self.nearest is None else self.nearest.left or 0.0
            if possible and run.left is not None and run.left <= least:
                self.nearest = run
        if not found:
            return None
        (least, best, named), *others_too = sorted(found, key=lambda item: item[0])
        equals = tuple((term, least - cost) for cost, _, term in others_too)
        beside = frozenset(term.key for term in self.names)
        return FoundInRuns(best, frozenset(beaten), beside, named.key, equals, cost=least)


def _possible(replay: Replay, explanation: Explanation) -> bool:
    """Whether names have numbers that real bodies can have, and not those at which a search was cut off."""
    return not any(
        unreal(replay.robot, term) or cut_off(term) or incredible(term, explanation.problem)
        for term in explanation.found
    )


def _count(terms: Sequence[Term]) -> int:
    return sum(len(term.free) for term in terms)


def _at_amplitudes(term: Term, linear: RunFit) -> Term:
    """The term with the amplitudes that runs ask for, its other numbers as they are: a fit goes from there.

    A cycle of next to no amplitude would else be moved about before it has any.
    """
    [own] = linear.terms
    amplitudes = np.array([p.linear for p in own.estimated])
    step = replace(linear, columns=linear.columns * amplitudes).step
    return replace(term, parameters={**term.parameters, **own.at_values(own.values + step).parameters})


def _differ(replay: Replay, energies: Sequence[Array]) -> bool:
    """Whether runs differ from every recording: numbers that were moved to fit one may hide it there."""
    return all(bool((e > HEARD + replay.doubt(which)).any()) for which, e in enumerate(energies))


def _cost(replay: Replay, build: Build, explanation: Explanation, numbers: int) -> float:
    """Energy of the fitted recordings' errors, and what so many numbers cost (Schwarz).

    A channel that beams may move otherwise than described says so much less (`Replay.doubt`).
    """
    energies = runs_of(replay, build(explanation))
    assert energies is not None
    rows = [len(asked.recording) for asked in replay.asked[: replay.fitted]]
    energy = sum(
        n * float((e / (1.0 + replay.doubt(k))).sum()) for k, (n, e) in enumerate(zip(rows, energies))
    )
    return 0.5 * energy + 0.5 * numbers * float(np.log(sum(rows) * len(replay.channels)))

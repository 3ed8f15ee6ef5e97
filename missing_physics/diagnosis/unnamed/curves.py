"""Whether a curve without a law foretells what the named laws leave.

Every law that is named competes with saturated models of the same force: curves over each coordinate on
which a force at the joint may depend, and its own numbers, free to change with time. A curve is fitted
together with everything that the explanation fits, the inertial numbers with their prior included, and
foretells blocks of time that were left out of the fit. Folds are long stretches of both parts of the data: a
curve must know the range in which it is asked. What it is worth is read from the held-out part, on which no
law was chosen, against what the explanation as named leaves there; how rich it may be (a ridge on its
coefficients) from the other part. Chance is judged over blocks, so that neither noise nor the errors' memory
is taken for structure.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.structural import hidden
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.repetition import repeats
from missing_physics.diagnosis.location.residual import FLOOR_TOLERANCE
from missing_physics.diagnosis.preparation.proof import HeldOut
from missing_physics.diagnosis.statistics.correlated_errors import effective_samples, paired_block_p_value
from missing_physics.diagnosis.statistics.folds import LATER, Folds, forecast_error, jackknife, solved
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.unnamed.coordinates import Coordinate, Seen, Wandering, coordinates, directions
from missing_physics.diagnosis.unnamed.histories import History, histories

__all__ = ["LawFree", "Leftover"]

Array = NDArray[np.float64]

#: Ridges tried, in units of the mean square of a curve's columns.
RIDGES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
#: Largest chance, over all coordinates tried, that a curve's gain on unseen data is none.
CHANCE = 0.05
#: and the same for a gain that is sure, with the draws of the bootstrap that can tell it.
SURELY, DRAWS = 0.01, 20_000
#: A curve's gain stands out from so many standard deviations of what is left on.
STANDS_OUT = 3.5
#: What a curve leaves beyond noise, in units of the floor's energy, is known to within the floor.
LEAST_REST = FLOOR_TOLERANCE**2 - 1.0
#: Fewest rows of either part of the data that can tell anything.
FEWEST_ROWS = 50
#: From this rung on a law of dry friction has states that show at reversals, which are not counted here.
BRISTLES = 3


class Foretold(NamedTuple):
    """Energies of left-out blocks of both parts of the data; the curve.

    `half` is half the width of the curve's 95 % interval, by the delete-a-group jackknife over the folds
    (Shao and Wu, A General Theory for Jackknife Variance Estimation, 1989), whose stretches are so long that
    the errors' memory does not narrow it; infinite where the ridge says more than the data. What the ridge
    takes from a curve's size it does not hold.
    """

    seen: Array
    unseen: Array
    curve: Array
    half: Array


def _chance(before: Foretold, after: Foretold, *, draws: int = 2000) -> float:
    """Chance that `after` foretells left-out stretches no better, of the held-out data or of both parts.

    Both count where the held-out data by themselves say so at the level of one test.
    """
    unseen = paired_block_p_value(before.unseen, after.unseen, draws=draws)
    if unseen > CHANCE:
        return unseen
    both = [np.concatenate([part.seen, part.unseen]) for part in (before, after)]
    return min(unseen, paired_block_p_value(*both, draws=draws))


@dataclass(frozen=True)
class Leftover:
    """What an explanation leaves at a joint on unseen data, and the best curve over it.

    Attributes:
        joint: index of the joint.
        left: mean square of what is left, in units of the noise floor's.
        share: of it that the best curve foretells; 0 where none does beyond chance.
        fitted_share: the same by cross-validation within the fitted data.
        coordinate: what that curve is over; None where there is none.
        best: what it foretells, block by block.
        again: whether the held-out data repeat the fitted motion, so that any law's force comes back.
        sure: whether it is next to impossible that noise makes the curve's gain.
        fitted_left: mean square of what is left within the fitted data.
    """

    joint: int
    left: float
    share: float = 0.0
    fitted_share: float = 0.0
    coordinate: Coordinate | History | Wandering | None = None
    best: Foretold | None = None
    again: bool = False
    sure: bool = False
    fitted_left: float = 0.0

    @property
    def plain(self) -> float:
        """How plainly the curve is all that is left, 0 to 1.

        Where next to noise alone is left beside it, what it foretells is one more force, and a name that
        lacks it is not the law or has a second one beside it. Where much is left whatever curve is drawn,
        there are more forces than anybody named, and one more says little about a name. And where much less
        than noise is left, there is less noise than the floor says: errors of the model itself show.
        """
        if not self.sure or self.again:
            return 0.0
        rest = self.left * (1.0 - min(self.share, 1.0))
        return min(rest * FLOOR_TOLERANCE**2, 1.0) * LEAST_REST / max(rest - 1.0, LEAST_REST)

    def foretold(self, *, where_fitted: bool = False) -> float:
        """Energy that the curve foretells, times its ratio to what it does not beyond noise.

        The ratio tells how clear the curve is, unless any curve would be, along a motion that comes again.
        For a term that held-out data cannot tell, the fitted data are asked.
        """
        share = min(self.fitted_share if where_fitted else self.share, 1.0)
        left = self.fitted_left if where_fitted else self.left
        gained, rest = left * share, left * (1.0 - share)
        return gained if self.again else gained**2 / max(rest - 1.0, LEAST_REST)


@dataclass(frozen=True)
class _Numbers:
    """What is left and how it depends on every number that is fitted, of both parts of the data.

    Attributes:
        columns: of the fitted and of the held-out part, shape (R, m, K) each.
        target: what the columns have to make, shape (R, m) each.
        prior: inverse variance of each number about nothing, shape (K,).
    """

    columns: tuple[Array, Array]
    target: tuple[Array, Array]
    prior: Array


class LawFree:
    """An explanation, linearised about its fit: curves can be added to it, and terms left out."""

    def __init__(self, explanation: Explanation, held_out: HeldOut) -> None:
        self.explanation, self.held_out = explanation, held_out
        self._problems = explanation.problem, held_out.problem
        self._rows = explanation.view.rows, held_out.rows
        self._again = repeats(*self._problems)
        self._floor = np.maximum(explanation.problem.noise_floor, 1e-300)
        self._left = explanation.residual, held_out.residual(explanation)
        count = explanation.nuisance.size
        self._fitted = np.concatenate([explanation.nuisance, *(term.values for term in explanation.terms)])
        prior = np.zeros(self._fitted.size)
        prior[:count] = explanation.view.prior
        # How a mode moved when a recording began is another number in each recording: it stays as it is.
        stays = [np.full(len(term.free), hidden(term.effect)) for term in explanation.terms]
        moves = ~np.concatenate([np.zeros(count, dtype=bool), *stays])
        columns = [
            np.concatenate([part.nuisance[:, :, :count], part.evaluate(explanation.terms)[1]], axis=2) * moves
            for part in self._problems
        ]
        target = [left + part @ self._fitted for left, part in zip(self._left, columns)]
        self._whole = _Numbers((columns[0], columns[1]), (target[0], target[1]), prior)

    def counted(self, joint: int, *, seen: bool = False) -> NDArray[np.bool_]:
        """Rows of one part of the data in which the joint surely moves in one direction."""
        part = 0 if seen else 1
        return np.asarray(self._rows[part] & (self._problems[part].sliding[:, joint] > 0))

    def left(self, joint: int, *, seen: bool = False) -> float:
        """Mean square of what is left on unseen or on fitted data, in units of the noise floor's."""
        return self._mean_square(self._left[0 if seen else 1], joint, seen=seen)

    def without_curve(self, joint: int) -> Leftover:
        """What is left at `joint`, no curve held against it."""
        return Leftover(joint, self.left(joint), fitted_left=self.left(joint, seen=True))

    def _mean_square(self, values: Array, joint: int, *, seen: bool) -> float:
        own = values[self.counted(joint, seen=seen), joint]
        return float(np.mean((own / self._floor[joint]) ** 2)) if own.size else 0.0

    def visible(self, joint: int, *, seen: bool = False) -> float:
        """Least mean square that would stand out of what is left, in units of the noise floor's."""
        own = self._left[0 if seen else 1][self.counted(joint, seen=seen), joint]
        if not own.size:
            return float("inf")
        return self.left(joint, seen=seen) * STANDS_OUT * float(np.sqrt(2.0 / effective_samples(own)))

    def where_fitted(self, term: Term) -> bool:
        """Whether only the fitted data can tell what a term does: an event, or what never acts in others."""
        return term.effect.is_event or self.held_out.silent(self.explanation, term)

    def removed(self, term: Term, joint: int) -> float:
        """By how much `left` grows at a joint without `term`, all else fitted anew.

        A richer law of dry friction is held against the simplest, a torque that follows the direction: only
        what it does beyond that speaks for it. Of what held-out data cannot tell the fitted data are counted.
        """
        seen = self.where_fitted(term)
        lacking = self._lacking(term)
        view, problem = self.explanation.view, self._problems[0]
        flat = view.flatten(
            problem, np.concatenate([lacking.columns[0], lacking.target[0][:, :, None]], axis=2)
        )
        beta = solved(flat[:, :-1].T @ flat[:, :-1] + np.diag(lacking.prior), flat[:, :-1].T @ flat[:, -1])
        part = 0 if seen else 1
        left = lacking.target[part] - lacking.columns[part] @ beta
        both = self._mean_square(self._left[part], joint, seen=seen)
        return self._mean_square(left, joint, seen=seen) - both

    def removed_beside(self, term: Term, leftover: Leftover) -> float:
        """The same beside the best curve over what is left, foretold block by block."""
        seen = self.where_fitted(term)
        trial = self._foretold(leftover.joint, leftover.coordinate, self._lacking(term))
        if trial is None or leftover.best is None:
            return 0.0
        without, both = (float((t.seen if seen else t.unseen).sum()) for t in (trial, leftover.best))
        return (without - both) / max(int(self.counted(leftover.joint, seen=seen).sum()), 1)

    def _uncertain(self, joint: int, rows: NDArray[np.bool_]) -> float:
        """Mean square of the forecast's error at a joint, at 95 %, from the fitted numbers' uncertainty.

        Where few long stretches tell of a term, short ones are left out in turn.
        """
        view, problem, whole = self.explanation.view, self._problems[0], self._whole
        both = np.concatenate([whole.columns[0], whole.target[0][:, :, None]], axis=2)
        asked = whole.columns[1][rows, joint] / self._floor[joint]
        blocks = self.explanation.blocks_of(fine=self._brief)
        return forecast_error(view.flatten(problem, both), blocks, whole.prior, asked, alternate=self._brief)

    @cached_property
    def _brief(self) -> bool:
        return any(self.explanation.is_brief(term) for term in self.explanation.found)

    def leftover(self, joint: int) -> Leftover:
        """The best curve over what is left at `joint`.

        Everything that is fitted is fitted anew with it, and what that alone foretells counts as well: a law
        keeps its numbers, and laws that stand for another one need others where the motion reaches further,
        or elsewhere. Where no curve does better, or a name is told by a moment of the fitted data, it counts
        less what the uncertainty of the fitted numbers, by the jackknife over stretches of the fitted data,
        makes of the forecast (Chow, Econometrica 28 (1960) 591).
        """
        base = self._foretold(joint, None, self._whole)
        if base is None:
            return self.without_curve(joint)
        seen = [(part, self.counted(joint, seen=k == 0)) for k, part in enumerate(self._problems)]
        tried: list[Coordinate | History | Wandering] = [
            *coordinates(seen, joint),
            *histories(seen, joint),
            *self._wandering(seen, joint),
        ]
        best, chance = base, CHANCE / (len(tried) + 1)
        over: Coordinate | History | Wandering | None = None
        for coordinate in tried:
            trial = self._foretold(joint, coordinate, self._whole)
            if trial is None or trial.unseen.sum() >= best.unseen.sum():
                continue
            if _chance(base, trial) <= chance:
                best, over = trial, coordinate
        as_named = base._replace(unseen=self._as_named(joint))
        if _chance(as_named, best) > chance:
            return self.without_curve(joint)
        numbers = float(as_named.unseen.sum() - base.unseen.sum())
        if self._brief or over is None:
            rows = self.counted(joint)
            numbers = max(numbers - int(rows.sum()) * self._uncertain(joint, rows), 0.0)
        gained = numbers + float(base.unseen.sum() - best.unseen.sum())
        share = gained / max(float(as_named.unseen.sum()), 1e-300)
        fitted = 1.0 - float(best.seen.sum() / max(base.seen.sum(), 1e-300))
        if share <= 0:
            return self.without_curve(joint)
        sure = _chance(as_named, best, draws=DRAWS) <= SURELY / (len(tried) + 1)
        return replace(
            self.without_curve(joint),
            share=share,
            fitted_share=max(fitted, 0.0),
            coordinate=over,
            best=best,
            again=self._again,
            sure=sure,
        )

    def _wandering(self, seen: Seen, joint: int) -> Iterator[Wandering]:
        """Each named law that shows at the joint, with numbers that change."""
        for term in self.explanation.found:
            own = self.explanation.slice_of(term)
            parts = [made[:, joint, own] for made in self._whole.columns]
            if term.effect.is_event or not parts[0][seen[0][1]].any():
                continue
            found = Wandering.of(term.label, joint, list(zip(self._problems, parts)), seen)
            if found is not None:
                yield found

    def _as_named(self, joint: int) -> Array:
        """Energies of the held-out blocks as the explanation foretells them, in units of the floor's."""
        rows = self.counted(joint)
        blocks = np.unique(self._problems[1].blocks[rows], return_inverse=True)[1]
        return np.asarray(np.bincount(blocks, (self._left[1][rows, joint] / self._floor[joint]) ** 2))

    def _foretold(
        self, joint: int, coordinate: Coordinate | History | Wandering | None, numbers: _Numbers
    ) -> Foretold | None:
        """Energies of left-out blocks in units of the floor's; None where there is too little to tell."""
        rows = [self.counted(joint, seen=seen) for seen in (True, False)]
        if min(int(own.sum()) for own in rows) < FEWEST_ROWS:
            return None
        floor, known = float(self._floor[joint]), numbers.prior.size
        columns = np.concatenate([part[own, joint] for part, own in zip(numbers.columns, rows)])
        target = np.concatenate([part[own, joint] for part, own in zip(numbers.target, rows)]) / floor
        blocks = np.concatenate(
            [part.blocks[own] + LATER * k for k, (part, own) in enumerate(zip(self._problems, rows))]
        )
        if coordinate is not None:
            made = [coordinate.columns(part)[own] for part, own in zip(self._problems, rows)]
            columns = np.hstack([columns, np.concatenate(made)])
        columns = columns / floor
        size = float(np.mean(np.sum(columns[:, known:] ** 2, axis=0))) if columns.shape[1] > known else 0.0
        if coordinate is not None and size == 0.0:
            return None
        folds = Folds(columns, target, blocks, *self._others(joint, numbers, columns.shape[1]))
        best: tuple[Array, Array, Array] | None = None
        for strength in RIDGES if coordinate is not None else (0.0,):
            ridge = np.where(np.arange(columns.shape[1]) < known, 0.0, strength * size)
            trial = *folds.energies(ridge), ridge
            if best is None or trial[0][folds.early].sum() < best[0][folds.early].sum():
                best = trial
        assert best is not None
        energies, without, ridge = best
        told = np.sum(columns[:, known:] ** 2, axis=0) > ridge[known:]
        half = np.where(told, jackknife(without[:, known:]), np.inf)
        curve = folds.solution(ridge)[known:]
        return Foretold(energies[folds.early], energies[~folds.early], curve, half)

    def _others(self, joint: int, numbers: _Numbers, size: int) -> tuple[Array, Array]:
        """X'X and X'y of the fitted rows of all other joints, the prior included, padded to `size`."""
        view, problem = self.explanation.view, self._problems[0]
        both = np.concatenate([numbers.columns[0], numbers.target[0][:, :, None]], axis=2)
        both[:, joint] = 0.0
        flat = view.flatten(problem, both)
        gram = flat[:, :-1].T @ flat[:, :-1] + np.diag(numbers.prior)
        extra = size - numbers.prior.size
        return np.pad(gram, (0, extra)), np.pad(flat[:, :-1].T @ flat[:, -1], (0, extra))

    def _lacking(self, term: Term) -> _Numbers:
        """Everything without one term."""
        explanation, whole = self.explanation, self._whole
        own = explanation.slice_of(term)
        others = np.ones(self._fitted.size, dtype=bool)
        others[own] = False
        columns, target = [], []
        simplest = term.effect.family is not None and 1 < term.effect.rung < BRISTLES
        for part, made, aim in zip(self._problems, whole.columns, whole.target):
            value = np.concatenate([s.contribution(term, explanation.terms).value for s in part.segments])
            target.append(aim - made[:, :, own] @ self._fitted[own] + value)
            kept = made[:, :, others]
            if simplest:
                joint = part.joints.index(term.at)
                direction = np.zeros((*aim.shape, 1))
                direction[:, joint, 0] = directions(part, joint)
                kept = np.concatenate([kept, direction], axis=2)
            columns.append(kept)
        prior = np.pad(whole.prior[others], (0, int(simplest)))
        return _Numbers((columns[0], columns[1]), (target[0], target[1]), prior)

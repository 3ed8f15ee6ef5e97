"""Posterior probabilities of hypotheses and of effects.

Hypotheses are weighted by their log scores, with blocks resampled by the Bayesian bootstrap (pseudo-BMA+;
Yao, Vehtari, Simpson, Gelman, Bayesian Analysis 13 (2018)), so that evidence from a few blocks alone does
not give certainty.

Hypotheses that differ in friction only may also be fitted to rows on which friction shows better, and which
contain those of the search. Then their relative probabilities are those on these rows; the probability of all
of them together remains that of the search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.inference.data import Data
from missing_physics.inference.fit import Fit
from missing_physics.inference.ledger import Search, prior, stated
from missing_physics.inference.score import block_scores

__all__ = ["Posterior", "apart_from_friction", "weighed"]

Array = NDArray[np.float64]

#: Draws of the bootstrap, which give probabilities to a hundredth, and its seed, which makes an answer
#: reproducible.
DRAWS, SEED = 2000, 20
#: Parameters of the standard model that belong to the friction of a joint.
FRICTION = (".viscous", ".coulomb")


@dataclass(frozen=True)
class Posterior:
    """Hypotheses and their posterior probabilities.

    Attributes:
        fits: physically possible ones, most probable first.
        weights: their probabilities, shape (H,).
    """

    fits: tuple[Fit, ...]
    weights: Array

    def probability(self, key: tuple[str, str]) -> float:
        """Probability of an effect at a place: the sum over all hypotheses that contain it."""
        held = [key in {term.key for term in fit.hypothesis.terms} for fit in self.fits]
        return float(self.weights[held].sum())

    def freed(self, name: str) -> float:
        """Probability that a parameter differs from the robot file: the sum over hypotheses that free it."""
        free = [_frees(fit, name) for fit in self.fits]
        return float(self.weights[free].sum())

    @property
    def answer(self) -> Fit:
        """The most probable fit of the most probable set of effects.

        Hypotheses of one set differ in which standard model parameters and delays they estimate.
        """
        sets = [frozenset(term.key for term in fit.hypothesis.terms) for fit in self.fits]
        probable = {own: sum(w for w, other in zip(self.weights, sets) if other == own) for own in sets}
        best = max(probable, key=lambda own: probable[own])
        return self.fits[sets.index(best)]


def _frees(fit: Fit, name: str) -> bool:
    fixed = fit.hypothesis.from_file | fit.hypothesis.of_unnamed
    return name not in fixed and bool(fit.layout.free[fit.layout.names.index(name)])


def _of_each_statement(found: Search[Any]) -> tuple[Fit, ...]:
    """The best fit of all that state the same effects and the same deviations from the file, best first."""
    best: dict[tuple[object, ...], Fit] = {}
    for fit in found.fits:
        best.setdefault(_statement(found.data, fit), fit)
    return tuple(best.values())


def _statement(data: Data, fit: Fit) -> tuple[object, ...]:
    """Key that is equal for hypotheses with the same effects and deviations from the file."""
    terms, _, _, accuracy = fit.hypothesis.key
    return terms, stated(data, fit.hypothesis), accuracy


def apart_from_friction(data: Data, fit: Fit) -> tuple[object, ...]:
    """Key that is equal for hypotheses that differ in dry and viscous friction only.

    Args:
        data: the rows.
        fit: the fit.
    """
    others = tuple(term for term in fit.hypothesis.terms if term.effect.family is None)
    terms, _, _, accuracy = replace(fit.hypothesis, terms=others).key
    return terms, frozenset(n for n in stated(data, fit.hypothesis) if not n.endswith(FRICTION)), accuracy


def weighed(found: Search[Any], friction: Search[Any] | None = None) -> Posterior:
    """Posterior over all hypotheses of a search.

    Hypotheses that state the same are one hypothesis: they differ in nuisance parameters without a price,
    such as delays and rotors that no file states, and the best fit of each counts.

    Args:
        found: the search.
        friction: fits of hypotheses to rows on which friction shows better, with the same blocks.
    """
    fits = _of_each_statement(found)
    total = _resampled(found, fits)
    total -= total.max(axis=1, keepdims=True)
    if friction is not None:
        total = _with_friction(total, fits, found.data, friction)
    weights = np.exp(total)
    weights /= weights.sum(axis=1, keepdims=True)
    mean = weights.mean(axis=0)
    order = np.argsort(-mean)
    return Posterior(tuple(fits[i] for i in order), mean[order])


def _resampled(found: Search[Any], fits: Sequence[Fit]) -> Array:
    """Log score plus log prior of each fit for every draw of the blocks, up to a constant, (`DRAWS`, H)."""
    scores = np.array([block_scores(found.data, fit, found.shares) for fit in fits])
    priors = np.array([prior(found.data, fit, found.shares) for fit in fits])
    blocks = scores.shape[1]
    resampled = np.random.default_rng(SEED).dirichlet(np.ones(blocks), DRAWS) * blocks
    return np.asarray(resampled @ (scores - scores[0]).T + priors)


def _with_friction(total: Array, fits: Sequence[Fit], data: Data, friction: Search[Any]) -> Array:
    """Scores in which hypotheses that differ in friction only are compared by other fits, (`DRAWS`, H).

    Args:
        total: scores in the search, shape (`DRAWS`, H).
        fits: those of the search.
        data: its rows.
        friction: other fits; of hypotheses that differ in friction only, those without such a fit are not
            likely, and get no weight.
    """
    others = {_statement(data, fit): fit for fit in reversed(friction.fits)}
    groups = [apart_from_friction(data, fit) for fit in fits]
    keys = [_statement(data, fit) for fit in fits]
    found = total.copy()
    for group in set(groups):
        own = [i for i, one in enumerate(groups) if one == group]
        fitted = [i for i in own if keys[i] in others]
        if len(fitted) > 1:
            anew = _resampled(friction, [others[keys[i]] for i in fitted])
            together = np.logaddexp.reduce(total[:, own], axis=1) - np.logaddexp.reduce(anew, axis=1)
            found[:, own] = -np.inf
            found[:, fitted] = anew + together[:, None]
    return found

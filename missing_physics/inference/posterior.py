"""Posterior probabilities of hypotheses and of effects.

Hypotheses are weighted by their log scores, with blocks resampled by the Bayesian bootstrap (pseudo-BMA+;
Yao, Vehtari, Simpson, Gelman, Bayesian Analysis 13 (2018)), so that evidence from a few blocks alone does
not give certainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.inference.fit import Fit
from missing_physics.inference.ledger import Search, prior, stated
from missing_physics.inference.score import block_scores

__all__ = ["Posterior", "weighed"]

Array = NDArray[np.float64]

#: Draws of the bootstrap, which give probabilities to a hundredth, and its seed, which makes an answer
#: reproducible.
DRAWS, SEED = 2000, 20


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
    return name not in fit.hypothesis.from_file and bool(fit.layout.free[fit.layout.names.index(name)])


def _of_each_statement(found: Search[Any]) -> tuple[Fit, ...]:
    """The best fit of all that state the same effects and the same deviations from the file, best first."""
    best: dict[tuple[object, ...], Fit] = {}
    for fit in found.fits:
        terms, _, _, accuracy = fit.hypothesis.key
        best.setdefault((terms, stated(found.data, fit.hypothesis), accuracy), fit)
    return tuple(best.values())


def weighed(found: Search[Any]) -> Posterior:
    """Posterior over all hypotheses of a search.

    Hypotheses that state the same are one hypothesis: they differ in nuisance parameters without a price,
    such as delays and rotors that no file states, and the best fit of each counts.
    """
    fits = _of_each_statement(found)
    scores = np.array([block_scores(found.data, fit, found.shares) for fit in fits])
    priors = np.array([prior(found.data, fit, found.shares) for fit in fits])
    blocks = scores.shape[1]
    resampled = np.random.default_rng(SEED).dirichlet(np.ones(blocks), DRAWS) * blocks
    total = resampled @ (scores - scores[0]).T + priors
    total -= total.max(axis=1, keepdims=True)
    weights = np.exp(total)
    weights /= weights.sum(axis=1, keepdims=True)
    mean = weights.mean(axis=0)
    order = np.argsort(-mean)
    return Posterior(tuple(fits[i] for i in order), mean[order])

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
from missing_physics.inference.ledger import Search, prior
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

    def of_family(self, at: str, family: str, rung: int) -> float:
        """Probability of an effect of a family, of at least this rung and not in the file, at a place."""
        return float(self.weights[[_holds(fit, at, family, rung) for fit in self.fits]].sum())

    def either(self, name: str, at: str, family: str | None) -> float:
        """Probability that a parameter differs from the robot file, or that its effect family is present."""
        held = [_frees(fit, name) or _holds(fit, at, family or "", 0) for fit in self.fits]
        return float(self.weights[held].sum())

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


def _holds(fit: Fit, at: str, family: str, rung: int) -> bool:
    added = [t for t in fit.hypothesis.terms if not t.is_given]
    return any(t.at == at and t.effect.family == family and t.effect.rung >= rung for t in added)


def weighed(found: Search[Any]) -> Posterior:
    """Posterior over all fits of a search."""
    fits = found.fits
    scores = np.array([block_scores(found.data, fit, found.shares) for fit in fits])
    priors = np.array([prior(found.data, fit) for fit in fits])
    blocks = scores.shape[1]
    resampled = np.random.default_rng(SEED).dirichlet(np.ones(blocks), DRAWS) * blocks
    total = resampled @ (scores - scores[0]).T + priors
    total -= total.max(axis=1, keepdims=True)
    weights = np.exp(total)
    weights /= weights.sum(axis=1, keepdims=True)
    mean = weights.mean(axis=0)
    order = np.argsort(-mean)
    return Posterior(tuple(fits[i] for i in order), mean[order])

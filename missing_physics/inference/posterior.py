"""Probabilities of hypotheses and of effects.

Hypotheses are weighed by their log scores, the blocks resampled by the Bayesian bootstrap (pseudo-BMA+; Yao,
Vehtari, Simpson, Gelman, Bayesian Analysis 13 (2018)), so that evidence from a few blocks is not certain.
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

#: Draws of the bootstrap, by which a probability is known to a hundredth, and its seed, which makes an answer
#: reproducible.
DRAWS, SEED = 2000, 20


@dataclass(frozen=True)
class Posterior:
    """Hypotheses and how probable they are.

    Attributes:
        fits: credible ones, most probable first.
        weights: their probabilities, shape (H,).
    """

    fits: tuple[Fit, ...]
    weights: Array

    def probability(self, key: tuple[str, str]) -> float:
        """Probability of an effect at a place: of all hypotheses that contain it."""
        held = [key in {term.key for term in fit.hypothesis.terms} for fit in self.fits]
        return float(self.weights[held].sum())

    def freed(self, name: str) -> float:
        """Probability that a parameter differs from the robot file: of all hypotheses that estimate it."""
        free = [_frees(fit, name) for fit in self.fits]
        return float(self.weights[free].sum())

    def of_family(self, at: str, family: str, rung: int) -> float:
        """Probability of a family's effect of this rung or a higher one that the file lacks at a place."""
        return float(self.weights[[_holds(fit, at, family, rung) for fit in self.fits]].sum())

    def either(self, name: str, at: str, family: str | None) -> float:
        """Probability that a parameter differs from the robot file, or that its effect family is present."""
        held = [_frees(fit, name) or _holds(fit, at, family or "", 0) for fit in self.fits]
        return float(self.weights[held].sum())

    @property
    def answer(self) -> Fit:
        """The most probable fit of the most probable set of effects.

        Hypotheses of one set differ in their estimated parameters of the standard model and of the timing.
        """
        sets = [frozenset(term.key for term in fit.hypothesis.terms) for fit in self.fits]
        probable = {own: sum(w for w, other in zip(self.weights, sets) if other == own) for own in sets}
        best = max(probable, key=lambda own: probable[own])
        return self.fits[sets.index(best)]


def _frees(fit: Fit, name: str) -> bool:
    return name not in fit.hypothesis.filed and bool(fit.layout.free[fit.layout.names.index(name)])


def _holds(fit: Fit, at: str, family: str, rung: int) -> bool:
    added = [t for t in fit.hypothesis.terms if not t.is_given]
    return any(t.at == at and t.effect.family == family and t.effect.rung >= rung for t in added)


def weighed(found: Search[Any]) -> Posterior:
    """Weigh everything that was fitted."""
    fits = found.fits
    scores = np.array([block_scores(found.data, fit, found.shares) for fit in fits])
    before = np.array([prior(found.data, fit) for fit in fits])
    blocks = scores.shape[1]
    drawn = np.random.default_rng(SEED).dirichlet(np.ones(blocks), DRAWS) * blocks
    total = drawn @ (scores - scores[0]).T + before
    total -= total.max(axis=1, keepdims=True)
    weights = np.exp(total)
    weights /= weights.sum(axis=1, keepdims=True)
    mean = weights.mean(axis=0)
    order = np.argsort(-mean)
    return Posterior(tuple(fits[i] for i in order), mean[order])

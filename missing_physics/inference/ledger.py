"""The fits made in a search, and their scores.

The rows are linear in a delay of the torques only while it is short, and in the masses of a vibrating link
only while they change little. So every fit that is pursued uses rows linearised at its own parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import BODIES, TIMING, Hypothesis, Term
from missing_physics.inference.data import Data
from missing_physics.inference.fit import Fit, fitted
from missing_physics.inference.score import block_scores

__all__ = ["ODDS", "D", "Search", "Step", "absent", "file_parameters", "prior", "stated", "unstated"]

Array = NDArray[np.float64]
D = TypeVar("D", bound=Data)

#: Log prior odds against one more effect at one place, and against a parameter that differs from the robot
#: file [nats]: one in fifty, as there are some dozens of each.
ODDS = 4.0
#: Log odds against a law of dry friction for every rung above Coulomb's [nats]: in an eighth of its
#: range it is like the law below it at the speeds that are compared; in the rest the score would show it.
GENERAL = float(np.log(8.0))
#: Parameters of a joint that a robot file states.
ROTOR = "reflected_inertia"
OF_JOINTS = ("viscous", "coulomb", "offset", ROTOR, TIMING)
#: Most linearisations that are cached: those of the hypotheses in the beam, and one more.
KEPT = 3
#: Most rounds of linearising the recordings at a fit and refitting.
SETTLING = 5


@dataclass(frozen=True)
class Step:
    """One hypothesis that was fitted in the search.

    Attributes:
        key: effect and place that were added, exchanged or removed.
        fit: after that change.
        before: the fit that was changed.
    """

    key: tuple[str, str]
    fit: Fit
    before: Fit


@dataclass
class Search(Generic[D]):
    """The fits made so far.

    Attributes:
        data: the rows.
        standard: the fit of the standard model.
        made: all fits, by the key of their hypothesis.
        shares: ratio of independent samples to samples at each joint, in the residual of the best fit.
        steps: the trials of effects, in order.
        dismissed: effects that fit but are not credible, with the reason.
        futile: candidates that did not improve the score, with the other terms at their joint.
        screened: screened candidates by the fit's identity and the kind of candidate, with the fit and the
            shares used.
    """

    data: D
    standard: Fit
    made: dict[tuple[object, ...], Fit]
    shares: Array
    steps: list[Step] = field(default_factory=list)
    dismissed: dict[tuple[str, str], str] = field(default_factory=dict)
    futile: set[tuple[object, ...]] = field(default_factory=set)
    screened: dict[tuple[int, bool, str], tuple[Fit, Array, Sequence[Any]]] = field(
        default_factory=dict, repr=False
    )
    _scores: dict[int, tuple[Fit, Array, float]] = field(default_factory=dict, repr=False)
    _others: list[D] = field(default_factory=list, repr=False)

    def about(self, fit: Fit) -> D:
        """The rows linearised at a fit: torques shifted by its delays, links vibrating with its masses."""
        parameters = self.data.with_bodies(fit.parameters, fit.hypothesis.terms)
        for data in (self.data, *self._others):
            if data.is_near(parameters, data.about_numbers, fit.hypothesis.terms):
                return data
        self._others = [*self._others[1 - KEPT :], self.data.about(parameters)]
        return self._others[-1]

    def settled(self, fit: Fit, *, whole: bool = True) -> Fit:
        """Refit with rows linearised at the fit's own parameters until these settle, and store the result.

        Args:
            fit: the starting point.
            whole: whether to estimate all parameters together if some of the terms' were held fixed.
        """
        for _ in range(SETTLING):
            parameters = self.data.with_bodies(fit.parameters, fit.hypothesis.terms)
            near = self.data.is_near(parameters, fit.about, fit.hypothesis.terms)
            if near and not (whole and fit.partial):
                break
            fit = fitted(self.about(fit), fit.hypothesis, fit)
        return self.keep(fit)

    @property
    def fits(self) -> tuple[Fit, ...]:
        """All physically possible fits, best first."""
        possible = [fit for fit in self.made.values() if not fit.impossible]
        return tuple(sorted(possible, key=self.score, reverse=True))

    @property
    def best(self) -> Fit:
        """The fit with the best score."""
        return max(self.made.values(), key=self.score)

    def score(self, fit: Fit) -> float:
        """Log score plus log prior of a fit's effects and parameters [nats]; -inf if it is impossible."""
        return -np.inf if fit.impossible else self.gain(fit)

    def gain(self, fit: Fit) -> float:
        """`score` regardless of whether the fit is physically possible."""
        known = self._scores.get(id(fit))
        if known is None or known[0] is not fit or known[1] is not self.shares:
            total = float(block_scores(self.data, fit, self.shares).sum())
            total += prior(self.data, fit, self.shares)
            self._scores[id(fit)] = known = fit, self.shares, total
        return known[2]

    def known(self, hypothesis: Hypothesis, start: Fit, make: Callable[[], Fit]) -> Fit:
        """The stored fit of a hypothesis; made anew if there is none with rows linearised near the start.

        Args:
            hypothesis: what is fitted.
            start: a fit of a similar hypothesis, from which `make` would start.
            make: the fit.
        """
        stored = self.made.get(hypothesis.key)
        if stored is not None:
            terms = start.hypothesis.terms
            parameters = self.data.with_bodies(start.parameters, terms)
            if self.data.is_near(parameters, stored.about, terms):
                return stored
        made = make()
        return made if stored is None or self.gain(made) > self.gain(stored) else self.keep(stored)

    def keep(self, fit: Fit) -> Fit:
        """Store a fit."""
        self.made[fit.hypothesis.key] = fit
        return fit


def absent(data: Data, hypothesis: Hypothesis) -> tuple[Term, ...]:
    """Friction laws of the robot file that a hypothesis lacks."""
    present = {term.key for term in hypothesis.terms}
    return tuple(one.term for one in data.laws if one.term.key not in present)


def file_parameters(data: Data) -> tuple[str, ...]:
    """Parameters of the standard model that a hypothesis may take from the robot file."""
    layout = data.layout
    own = tuple(
        name
        for name, free in zip(layout.names, layout.free)
        if free and name.rpartition(".")[2] in OF_JOINTS and name.split(".")[0] in data.joints
    )
    bodies = any(layout.free[place].any() for place in layout.bodies)
    bodies = bodies and not (layout.extra is not None and layout.extra.is_off)
    return (*own, *data.further, BODIES) if bodies else (*own, *data.further)


def unstated(data: Data) -> set[str]:
    """Rotor inertias that the robot file does not state, as in every URDF; they need not be zero."""
    parameters = zip(data.layout.names, data.file_values)
    return {name for name, value in parameters if name.endswith(ROTOR) and value == 0.0}


def stated(data: Data, hypothesis: Hypothesis) -> frozenset[str]:
    """Parameters of the standard model that a hypothesis estimates although the robot file states them.

    A law of dry friction holds the kinetic friction that it contains, so it counts as one effect.
    """
    given = hypothesis.from_file | {name for name, _ in hypothesis.held} | unstated(data)
    for term in hypothesis.terms:
        if term.effect.is_unknown and not term.is_given:  # spans or nearly spans them
            same = {f"{term.at}.{name}" for name in term.effect.along}
            given |= {name for name in same if data.file_values[data.layout.names.index(name)] != 0.0}
    return frozenset(name for name in file_parameters(data) if name not in given)


def prior(data: Data, fit: Fit, shares: Array) -> float:
    """Log prior odds of a fit against the robot file without delays [nats].

    Each effect costs `ODDS`, as does the absence of a friction law of the file, and each of its parameters
    that is estimated. A wave over position could have any order that the recordings distinguish. Parameters
    that a single fold determines are fitted to the rows by which they are judged, so they cost what they
    gain in precision (Laplace's approximation). An unnamed force costs `ODDS` once more.

    Args:
        data: the rows.
        fit: the fit.
        shares: ratio of independent samples to samples at each joint, shape (n,).
    """
    hypothesis = fit.hypothesis
    added = [term for term in hypothesis.terms if not term.is_given]
    orders = dict(zip(data.joints, data.orders))
    waves = sum(float(np.log(orders.get(term.joint, 1.0))) for term in added if term.effect.is_wave)
    effects = 0.0
    for term in added:
        effects += ODDS * (1 + len(term.added) + term.effect.is_unknown)
        if term.key not in fit.once:  # else part of the loss of evidence below
            effects += term.further + GENERAL * max(term.effect.rung - 1, 0)
    effects += ODDS * (len(hypothesis.freed) + len(absent(data, hypothesis)))
    effects += ODDS * len(stated(data, hypothesis))
    whole = shares * fit.sigma**2 / np.maximum(fit.sigma**2 + data.error**2, 1e-300)
    effects += sum(gained.price(whole) for gained in fit.once.values())
    delays = [i for i, name in enumerate(data.layout.names) if name.endswith(TIMING)]
    late = float(np.sum((fit.parameters[delays] / data.layout.width[delays]) ** 2))
    return -effects - waves - 0.5 * late

"""The fits of a search and their scores.

A delay of the torques is linear in the rows only while it is short, and the vibration of a link only while
its masses change little. So every fit that is pursued is one to recordings linearised about its own numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import BODIES, TIMING, Hypothesis, Term
from missing_physics.hypotheses.extents import EDGES
from missing_physics.inference.data import Data
from missing_physics.inference.fit import Fit, fitted
from missing_physics.inference.score import block_scores

__all__ = ["ODDS", "D", "Search", "Step", "absent", "filable", "prior", "unstated"]

Array = NDArray[np.float64]
D = TypeVar("D", bound=Data)

#: Prior odds against one more effect at one place, and against a parameter that differs from the robot file
#: [nats]: one in fifty, as there are some dozens of each.
ODDS = 4.0
#: Further odds against an event [nats], which could have happened at any other time: one over the number of
#: stretches of time in which it is searched.
EVENT = float(np.log(0.5 * EDGES**2))
#: Parameters of a joint that a robot file has.
ROTOR = "reflected_inertia"
OF_JOINTS = ("viscous", "coulomb", "offset", ROTOR, TIMING)
#: Most linearised recordings that are cached: those of the hypotheses in the beam, and one more.
KEPT = 3
#: Most rounds in which recordings are linearised about a fit to them; each settles what the last one moved.
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
        made: all hypotheses that were fitted, by key.
        shares: ratio of independent samples to samples at each joint, in the residual of the best fit.
        steps: how effects were tried, in order.
        dismissed: effects that fit but are not credible, with the reason.
        futile: candidates that did not improve the score, and what else was at their place.
        looked: what may be added to a fit, by the fit's identity and what was wanted, with the fit and shares
            that were used.
    """

    data: D
    standard: Fit
    made: dict[tuple[object, ...], Fit]
    shares: Array
    steps: list[Step] = field(default_factory=list)
    dismissed: dict[tuple[str, str], str] = field(default_factory=dict)
    futile: set[tuple[object, ...]] = field(default_factory=set)
    looked: dict[tuple[int, bool, str], tuple[Fit, Array, Sequence[Any]]] = field(
        default_factory=dict, repr=False
    )
    _scores: dict[int, tuple[Fit, Array, float]] = field(default_factory=dict, repr=False)
    _others: list[D] = field(default_factory=list, repr=False)

    def about(self, fit: Fit) -> D:
        """The recordings with torques shifted by the delays of a fit, and links bent as its masses demand."""
        numbers = self.data.with_bodies(fit.numbers, fit.hypothesis.terms)
        for data in (self.data, *self._others):
            if data.is_near(numbers, data.about_numbers, fit.hypothesis.terms):
                return data
        self._others = [*self._others[1 - KEPT :], self.data.about(numbers)]
        return self._others[-1]

    def settled(self, fit: Fit, *, whole: bool = True) -> Fit:
        """Refit about the numbers of the fit itself, and remember the result.

        Args:
            fit: to begin with.
            whole: whether to estimate all parameters together, if some of the terms' were held.
        """
        for _ in range(SETTLING):
            numbers = self.data.with_bodies(fit.numbers, fit.hypothesis.terms)
            near = self.data.is_near(numbers, fit.about, fit.hypothesis.terms)
            if near and not (whole and fit.partial):
                break
            fit = fitted(self.about(fit), fit.hypothesis, fit)
        return self.keep(fit)

    @property
    def fits(self) -> tuple[Fit, ...]:
        """All fits with numbers that can be, best first."""
        possible = [fit for fit in self.made.values() if not fit.impossible]
        return tuple(sorted(possible, key=self.score, reverse=True))

    @property
    def best(self) -> Fit:
        """The fit with the best score."""
        return max(self.made.values(), key=self.score)

    def score(self, fit: Fit) -> float:
        """Log score of a fit plus the log prior of its effects and parameters [nats]; none if impossible."""
        return -np.inf if fit.impossible else self.gain(fit)

    def gain(self, fit: Fit) -> float:
        """`score` whether or not its numbers can be."""
        known = self._scores.get(id(fit))
        if known is None or known[0] is not fit or known[1] is not self.shares:
            total = float(block_scores(self.data, fit, self.shares).sum()) + prior(self.data, fit)
            self._scores[id(fit)] = known = fit, self.shares, total
        return known[2]

    def known(self, hypothesis: Hypothesis, make: Callable[[], Fit]) -> Fit:
        """The fit of a hypothesis, made and remembered where there is none yet."""
        return self.made[hypothesis.key] if hypothesis.key in self.made else self.keep(make())

    def keep(self, fit: Fit) -> Fit:
        """Remember a fit."""
        self.made[fit.hypothesis.key] = fit
        return fit


def absent(data: Data, hypothesis: Hypothesis) -> tuple[Term, ...]:
    """Friction laws of the robot file that a hypothesis lacks."""
    present = {term.key for term in hypothesis.terms}
    return tuple(one.term for one in data.laws if one.term.key not in present)


def filable(data: Data) -> tuple[str, ...]:
    """Parameters of the standard model that may have the robot file's value."""
    layout = data.layout
    own = tuple(
        name
        for name, free in zip(layout.names, layout.free)
        if free and name.rpartition(".")[2] in OF_JOINTS and name.split(".")[0] in data.joints
    )
    bodies = any(layout.free[place].any() for place in layout.bodies)
    bodies = bodies and not (layout.beside is not None and layout.beside.is_off)
    return (*own, *data.further, BODIES) if bodies else (*own, *data.further)


def unstated(data: Data) -> set[str]:
    """Rotors of which the robot file says nothing, as every URDF: it does not say that there are none."""
    numbers = zip(data.layout.names, data.filed)
    return {name for name, value in numbers if name.endswith(ROTOR) and value == 0.0}


def prior(data: Data, fit: Fit) -> float:
    """Log prior odds of a fit against the robot file without delays [nats].

    A friction law of the file costs as much as an effect where it is absent, and each of its parameters that
    is estimated as much as another number. A wave over position could have any of the orders that the
    recordings tell apart, an event, or a place that is seldom reached, could have been at any time, and a
    force that is none of the known effects is as improbable again.
    """
    hypothesis = fit.hypothesis
    added = [term for term in hypothesis.terms if not term.is_given]
    orders = dict(zip(data.joints, data.orders))
    waves = sum(float(np.log(orders.get(term.joint, 1.0))) for term in added if term.effect.is_wave)
    effects = 0.0
    for term in added:
        effects += ODDS * (1 + len(term.added)) + term.further
        effects += EVENT * (term.key in fit.once) + ODDS * term.effect.is_unknown
    effects += ODDS * (len(hypothesis.freed) + len(absent(data, hypothesis)))
    given = hypothesis.filed | {name for name, _ in hypothesis.held} | unstated(data)
    for term in added:
        if term.effect.is_unknown:  # spans the same functions as parameters of the file
            same = {f"{term.at}.{name}" for name in term.effect.along}
            given |= {name for name in same if data.filed[data.layout.names.index(name)] != 0.0}
        if term.effect.family:  # a friction law contains its own kinetic friction
            given -= {f"{term.at}.coulomb"}
    delays = [i for i, name in enumerate(data.layout.names) if name.endswith(TIMING)]
    late = float(np.sum((fit.numbers[delays] / data.layout.width[delays]) ** 2))
    return -effects - waves - ODDS * sum(name not in given for name in filable(data)) - 0.5 * late

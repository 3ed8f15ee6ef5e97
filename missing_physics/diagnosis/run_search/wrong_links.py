"""Which link's masses are wrong, where recordings tell combinations of all links' masses only.

Runs tell combinations c of the changes z of all inertial numbers, in units of their typical sizes,

    c = U^T z,

and a file may be a little off everywhere. So each link is held to be the one that is clearly off, in three
ways: each of its numbers for itself, with the deviation `OFF`; the link heavier as a whole, as if made of
another material; or a load on it, whose mass and place are as far from nothing. All numbers are off besides
by one of the parts `CREDIBLE`, which is not known. The likelihood of c, over all values of what is not known,
says which it is: the first two are wrong inertia, the third a load. Its integrals are exact but for the
load's place, where Laplace's approximation is taken (MacKay, Information Theory, Inference, and Learning
Algorithms (2003), ch. 27). What is left of c stays a change of combinations beside the name.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import least_squares
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from missing_physics.diagnosis.candidates.walls import tip_of
from missing_physics.diagnosis.least_squares.view import Told
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.terms.real_bodies import unreal
from missing_physics.diagnosis.terms.term import BODY_NUMBERS, Term, body_terms
from reference_model.dynamics.inertial import ten_numbers
from reference_model.effects.catalogue import get_effect
from robot_model import Robot

__all__ = ["WrongLink", "wrong_links"]

Array = NDArray[np.float64]
#: By how much numbers of a file may be off, and those of one link that is clearly off, in typical sizes.
CREDIBLE, OFF = (0.01, 0.03, 0.1), 0.3
#: A number is told where the recordings make it surer by this factor than it was before.
SURER = 0.5
#: What is less probable than this is not told.
LEAST = 1e-3
#: Part of a link's size at which steps to a load's place begin, where it is at the frame's origin.
START = 0.1


@dataclass(frozen=True)
class WrongLink:
    """Masses that may be what is wrong.

    Attributes:
        term: wrong inertia of a link, or a load on it.
        probability: beside the others.
        rest: what is left of the combinations.
    """

    term: Term
    probability: float
    rest: Told


def wrong_links(
    robot: Robot, basis: InertialBasis, told: Told, there: Collection[tuple[str, str]] = ()
) -> list[WrongLink]:
    """Links whose masses may be wrong, and loads on them, the most probable first.

    Args:
        robot: as described.
        basis: the combinations.
        told: by how much they are others, shape (B,).
        there: effects and places that the explanation has already, which are none of these.
    """
    found: list[tuple[float, Term, Told]] = []
    for link in sorted({joint.child for joint in robot.moving_joints}):
        places = {name: k for k, name in enumerate(basis.names) if name.startswith(f"{link}.")}
        if robot.link(link).flexible or not places:
            continue
        one = _Link(robot, link, basis, told)
        ways = (("inertia", one.wrong), ("payload", one.loaded))
        tried = [way() for effect, way in ways if (effect, link) not in there]
        found += [way for way in tried if way is not None]
    if not found:
        return []
    odds = np.array([evidence for evidence, _, _ in found])
    shares = np.exp(odds - logsumexp(odds))
    links = [WrongLink(term, float(p), rest) for p, (_, term, rest) in zip(shares, found) if p >= LEAST]
    return sorted(links, key=lambda item: -item.probability)


class _Link:
    """One link that is held to be off.

    Attributes:
        numbers: what each of its ten numbers does to the combinations, shape (B, 10).
        scale: typical sizes of the ten; infinite where a number is known.
    """

    def __init__(self, robot: Robot, link: str, basis: InertialBasis, told: Told) -> None:
        self.robot, self.link, self.told = robot, link, told
        unit = basis.first(told.values.size) / basis.scale[:, None]
        names = [f"{link}.{number}" for number in BODY_NUMBERS]
        places = {name: k for k, name in enumerate(basis.names)}
        self.numbers, self.scale = np.zeros((unit.shape[1], len(names))), np.full(len(names), np.inf)
        for k, name in enumerate(names):
            if name in places:
                self.scale[k] = basis.scale[places[name]]
                self.numbers[:, k] = unit[places[name]] / self.scale[k]
        self._spreads = [credible**2 * (unit.T @ unit) + told.covariance for credible in CREDIBLE]

    def wrong(self) -> tuple[float, Term, Told] | None:
        """Wrong inertia: the logarithm of its likelihood, by how much, and what is left."""
        change = self.told.values
        apart = self.numbers * np.where(np.isfinite(self.scale), self.scale, 0.0)
        whole = self.numbers @ ten_numbers(self.robot.link(self.link))
        each = [s + OFF**2 * (apart @ apart.T) for s in self._spreads]
        one = [s + OFF**2 * np.outer(whole, whole) for s in self._spreads]
        likely = np.array([_likelihood(change, spread) for spread in each])
        evidence = float(np.logaddexp(logsumexp(likely), logsumexp([_likelihood(change, s) for s in one])))
        spread = each[int(likely.argmax())]
        gain = OFF**2 * np.linalg.solve(spread, apart).T
        values = gain @ change
        deviation = np.sqrt(np.maximum(OFF**2 - OFF**2 * np.einsum("pb,bp->p", gain, apart), 0.0))
        surer = np.isfinite(self.scale) & (deviation <= SURER * OFF)
        scale = np.where(surer, self.scale, 0.0)
        term = self._term("inertia", values * scale, deviation * scale, surer)
        if not term.held or unreal(self.robot, term):
            return None
        return evidence - np.log(2 * len(CREDIBLE)), term, self._left(term)

    def loaded(self) -> tuple[float, Term, Told] | None:
        """A load, likewise."""
        at, body = tip_of(self.robot, self.link), self.robot.link(self.link)
        size = max(float(np.linalg.norm(at)), float(np.linalg.norm(body.center_of_mass)), 1e-2)
        widths = np.array([OFF * max(body.mass, 1e-6), size, size, size])
        start = Term(get_effect("payload"), self.link, dict(zip(("mass", *"xyz"), [0.0, *at])))
        likely, fits = [], []
        for spread in self._spreads:
            triangle = cholesky(spread, lower=True)

            def left(values: Array, triangle: Array = triangle) -> Array:
                added = self.numbers @ body_terms(start.at_values(values * widths))[0][: len(BODY_NUMBERS)]
                return np.append(solve_triangular(triangle, self.told.values - added, lower=True), values)

            begins = [np.array([sign, *(np.asarray(at) / size + START)]) for sign in (START, -START)]
            fit = min((least_squares(left, first) for first in begins), key=lambda found: float(found.cost))
            curved = fit.jac.T @ fit.jac
            _, volume = np.linalg.slogdet(curved)
            sides = 2.0 * np.log(np.diagonal(triangle)).sum() + len(spread) * np.log(2 * np.pi)
            likely.append(-fit.cost - 0.5 * (sides + volume))
            fits.append((fit.x * widths, np.sqrt(np.diagonal(np.linalg.inv(curved))) * widths))
        values, deviation = fits[int(np.argmax(likely))]
        surer = deviation <= SURER * widths
        term = self._term("payload", values, deviation, surer)
        if not term.held or abs(term.parameters["mass"]) > body.mass:
            return None
        return float(logsumexp(likely)) - np.log(len(CREDIBLE)), term, self._left(term)

    def _term(self, effect: str, values: Array, deviation: Array, told: NDArray[np.bool_]) -> Term:
        """The effect at the link, those of its numbers held that are told."""
        names = [p.name for p in get_effect(effect).parameters]
        numbers = dict(zip(names, map(float, values)))
        held = {name: float(size) for name, size, known in zip(names, deviation, told) if known}
        unseen = tuple(name for name in names if name not in held)
        return replace(Term(get_effect(effect), self.link, numbers, unseen=unseen), held=held)

    def _left(self, term: Term) -> Told:
        added = self.numbers @ body_terms(term)[0][: len(BODY_NUMBERS)]
        return Told(self.told.values - added, self.told.covariance)


def _likelihood(change: Array, spread: Array) -> float:
    return float(multivariate_normal.logpdf(change, cov=spread, allow_singular=True))

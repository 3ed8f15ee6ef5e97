"""Loads on links, and links with wrong mass properties, from the estimated bodies.

Torques of a robot of rigid links are linear in the ten parameters phi of each body. So the likelihood is
exp(-1/2 (phi - phi0)^T F (phi - phi0) + eta^T (phi - phi0)) about the robot file's phi0, with friction,
rotors and effects marginalised. Every hypothesis is a prior of phi,

    phi = phi0 + d + a_k,    d ~ N(0, tau^2 H^-1),

with H the metric of relative changes of bodies (`missing_physics.bodies.pseudo_inertia`) and tau the accuracy
of the robot file, unknown between that of weighed parts and that of a guess. a_k is zero; or a point mass at
link k,

    a_k = (m, m r, m (r.r 1 - r r^T)),    m > 0,  m ~ N(0, m_k^2),  r ~ N(centre_k, length_k^2);

or one or two links have a relative uncertainty of one. The evidence integrates over d exactly, over m and r
by Laplace's approximation, and over tau by a sum. Equations of undriven joints are ignored: their noise is
that of the motion, proportional to the bodies, so they contain no information on the bodies' scale. A load is
thus named only if the other bodies agree with the file and the difference is that of a point mass.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import logsumexp
from scipy.stats import chi2

from missing_physics.bodies.pseudo_inertia import COUNT, divergence
from missing_physics.hypotheses import BODIES, Hypothesis
from missing_physics.inference.fit import Fit, fitted
from missing_physics.inference.ledger import ODDS, unstated
from missing_physics.inference.problem import Problem
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard.layout import length_of
from reference_model.effects.base import BodyEffect, Effect
from robot_model import Robot

__all__ = ["LOAD", "Load", "is_on_body", "is_real", "loads", "without_bodies"]

Array = NDArray[np.float64]

#: Equally probable accuracies of a robot file's bodies (standard deviation of the relative change): of parts
#: that were weighed, of careful and of usual CAD, of a handbook, of a guess.
ACCURACIES = (0.003, 0.01, 0.03, 0.1, 0.3)
#: Relative standard deviation of a single body that is wrong.
WRONG = 1.0
#: Effects on bodies.
LOAD, WRONG_BODY = "payload", "inertia"
#: A load's mass below this many standard deviations is not distinguished from zero.
CLEAR = 2.0


@dataclass(frozen=True)
class Load:
    """One explanation of the difference between the estimated bodies and the robot file.

    Attributes:
        effect: id of the effect; empty for no effect.
        bodies: the affected links.
        probability: posterior probability.
        values: starting values of the effect's parameters.
        accuracy: most probable relative accuracy of the other bodies.
    """

    effect: str
    bodies: tuple[str, ...]
    probability: float
    values: Mapping[str, float]
    accuracy: float


def without_bodies(data: TorqueData, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis without effects on bodies, with all bodies and unstated rotors estimated."""
    terms = tuple(t for t in hypothesis.terms if not is_on_body(t.effect))
    return replace(hypothesis, terms=terms, from_file=hypothesis.from_file - {BODIES} - unstated(data))


def loads(data: TorqueData, fit: Fit, shares: Array) -> tuple[Load, ...]:
    """Explanations of the estimated bodies, most probable first.

    Empty if links are flexible, if nothing drives the robot, or if no body is estimated.

    Args:
        data: the rows.
        fit: the fit whose effects are kept when bodies are estimated.
        shares: ratio of independent samples to samples at each joint, shape (n,).
    """
    if data.bends or data.layout.scale.any():
        return ()
    without_load = fitted(data, without_bodies(data, fit.hypothesis), fit)
    problem = Problem.of(data, without_load.hypothesis, without_load.parameters)
    free = problem.layout.free
    bodies = {
        data.layout.names[place.start].split(".")[0]: place
        for place in data.layout.bodies
        if free[place].all()
    }
    if not bodies:
        return ()
    known = _BodyLikelihood.of(data, problem, without_load, shares, tuple(bodies.values()))
    links = [_Link.of(data, name, place) for name, place in bodies.items() if name != "base"]
    found: dict[tuple[str, tuple[str, ...]], list[tuple[float, Mapping[str, float], float]]] = {}
    starts: dict[str, Array] = {}
    order = list(bodies)
    for accuracy in ACCURACIES:
        base, spread = known.evidence(accuracy), known.within(accuracy)
        found.setdefault(("", ()), []).append((base, {}, accuracy))
        for count in (1, 2):
            for wrong in combinations([link.name for link in links], count):
                own = known.evidence(accuracy, [order.index(name) for name in wrong])
                found.setdefault((WRONG_BODY, wrong), []).append((own - count * ODDS, {}, accuracy))
        for link in links:
            gain, point = link.gain(*spread(order.index(link.name)), starts.get(link.name))
            starts[link.name] = point
            values = dict(zip(("mass", "x", "y", "z"), map(float, point)))
            found.setdefault((LOAD, (link.name,)), []).append((base + gain - ODDS, values, accuracy))
    total = {key: float(logsumexp([one for one, *_ in each])) for key, each in found.items()}
    whole = float(logsumexp(list(total.values())))
    made = []
    for key, each in found.items():
        _, begin, likely = max(each, key=lambda one: one[0])
        made.append(Load(*key, float(np.exp(total[key] - whole)), begin, likely))
    return tuple(sorted(made, key=lambda one: -one.probability))


def is_real(data: TorqueData, fit: Fit, body: str) -> bool:
    """Whether a body of a fit with all bodies estimated is within 95 % of the prior of a wrong body.

    To second order the divergence is half the sum of squares of ten relative changes in units of `WRONG`.
    """
    place = data.layout.names.index(f"{body}.mass")
    own = slice(place, place + COUNT)
    change = float(divergence(fit.parameters[own], data.layout.start[own])[0])
    return change <= 0.5 * float(chi2.ppf(0.95, COUNT)) * WRONG**2


def is_on_body(effect: Effect) -> bool:
    """Whether an effect changes the mass properties of a link."""
    return isinstance(effect, BodyEffect) and effect.place == "link"


@dataclass(frozen=True)
class _BodyLikelihood:
    """Likelihood of the bodies in coordinates z of relative changes: delta phi = root z.

    Attributes:
        root: blocks of each body, shape (B, 10, 10).
        vectors: eigenvectors of the information on z, columns, shape (P, P).
        values: its eigenvalues, shape (P,).
        slope: gradient of the log-likelihood at the robot file, in the eigenvectors' basis, shape (P,).
    """

    root: Array
    vectors: Array
    values: Array
    slope: Array

    @classmethod
    def of(
        cls, data: TorqueData, problem: Problem, fit: Fit, shares: Array, places: Sequence[slice]
    ) -> _BodyLikelihood:
        layout = problem.layout
        driven = np.any([run.driven for run in data.runs], axis=0)
        weight = np.where(driven, shares / (fit.sigma**2 + data.error**2), 0.0)
        gram, right = problem.total.weighted(weight)
        if layout.extra is not None:
            gram[np.ix_(layout.extra_places, layout.extra_places)] += layout.extra.matrix
            right[layout.extra_places] += layout.extra.vector
        mine = np.concatenate([np.arange(place.start, place.stop) for place in places])
        others = np.setdiff1d(np.flatnonzero(layout.free), mine)
        held = np.setdiff1d(np.arange(len(layout.names)), np.concatenate([mine, others]))
        right = right - gram[:, held] @ problem.begin[held] - gram[:, mine] @ data.file_values[mine]
        matrix = gram[np.ix_(others, others)]
        prior, centre = 1.0 / layout.width[others] ** 2, layout.centre[others]
        size = 1.0 / np.sqrt(np.maximum(np.diag(matrix) + prior, 1e-300))
        scaled = (matrix + np.diag(prior)) * np.outer(size, size)
        across = gram[np.ix_(others, mine)]
        both = np.column_stack([across, right[others] + prior * centre]) * size[:, None]
        solved = np.linalg.lstsq(scaled, both, rcond=None)[0] * size[:, None]
        information = gram[np.ix_(mine, mine)] - across.T @ solved[:, :-1]
        slope = right[mine] - across.T @ solved[:, -1]
        solid = np.array([layout.start[place] for place in places])
        metric = divergence(solid, solid)[2]
        root = np.linalg.inv(np.linalg.cholesky(metric)).transpose(0, 2, 1)
        whole = np.zeros_like(information)
        for b, own in enumerate(root):
            whole[_block(b), _block(b)] = own
        values, vectors = np.linalg.eigh(whole.T @ information @ whole)
        return cls(root, vectors, np.maximum(values, 0.0), vectors.T @ (whole.T @ slope))

    def evidence(self, accuracy: float, wrong: Sequence[int] = ()) -> float:
        """Log evidence, integrated over bodies of this accuracy except some wrong ones [nats]."""
        if not wrong:
            spread = accuracy**2
            grown = 1.0 + spread * self.values
            return float(0.5 * np.sum(spread * self.slope**2 / grown - np.log(grown)))
        width = np.full(self.values.size, accuracy)
        for body in wrong:
            width[_block(body)] = WRONG
        information = (self.vectors * self.values) @ self.vectors.T * np.outer(width, width)
        slope = (self.vectors @ self.slope) * width
        grown = np.eye(width.size) + information
        return float(0.5 * (slope @ np.linalg.solve(grown, slope) - np.linalg.slogdet(grown)[1]))

    def within(self, accuracy: float) -> Callable[[int], tuple[Array, Array]]:
        """Gradient and curvature of the log-likelihood by one body, integrated over others of this accuracy.

        Returns:
            A function of the body's number, shapes (10,) and (10, 10).
        """
        grown = 1.0 + accuracy**2 * self.values
        slope, curvature = self.vectors @ (self.slope / grown), (self.vectors * (self.values / grown))

        def of(body: int) -> tuple[Array, Array]:
            back, own = np.linalg.inv(self.root[body]), _block(body)
            inner = curvature[own] @ self.vectors[own].T
            return back.T @ slope[own], back.T @ inner @ back

        return of


def _block(body: int) -> slice:
    return slice(COUNT * body, COUNT * (body + 1))


@dataclass(frozen=True)
class _Link:
    """A link that may carry a point mass.

    Attributes:
        name: of the link.
        mass: of the link [kg].
        centre: its centre of mass [m], shape (3,).
        length: of the link [m].
        points: starting positions of a load: its centre, its child joints and points around it [m].
    """

    name: str
    mass: float
    centre: Array
    length: float
    points: tuple[Array, ...]

    @classmethod
    def of(cls, data: TorqueData, name: str, place: slice) -> _Link:
        robot: Robot = data.standard.nominal
        mass, moment = data.file_values[place][0], data.file_values[place][1:4]
        centre, length = moment / mass, length_of(robot, name)
        carried = [np.array(joint.origin) for joint in robot.joints if joint.parent == name]
        around = [centre + side * length * axis for axis in np.eye(3) for side in (1.0, -1.0)]
        return cls(name, float(mass), centre, length, (centre, *carried, *around))

    def gain(self, slope: Array, curvature: Array, start: Array | None) -> tuple[float, Array]:
        """Log evidence of a load at the link relative to no load [nats], and its mass and position, (4,).

        Args:
            slope, curvature: of the log-likelihood by the link's parameters.
            start: starting mass and position; several positions when None.
        """
        size = np.array([self.mass, self.length, self.length, self.length])
        middle = np.array([0.0, *self.centre])

        def cost(x: Array) -> tuple[float, Array]:
            point, jacobian = _point_mass(x * size)
            away = x - middle / size
            pull = slope - curvature @ point
            value = 0.5 * away @ away - slope @ point + 0.5 * point @ curvature @ point
            return float(value), away - size * (jacobian.T @ pull)

        begins = [start / size] if start is not None else list(self._starts(slope, curvature, size))
        bounds = [(0.0, None), *[(None, None)] * 3]
        made = [minimize(cost, x, jac=True, method="L-BFGS-B", bounds=bounds) for x in begins]
        best = min(made, key=lambda one: float(one.fun))
        step = 1e-4 * np.eye(4)
        second = np.array([(cost(best.x + d)[1] - cost(best.x - d)[1]) / 2e-4 for d in step])
        second = 0.5 * (second + second.T)
        precision, axes = np.linalg.eigh(second)
        precision = np.maximum(precision, 1e-9)
        deviation = float(np.sqrt(np.sum(axes[0] ** 2 / precision)))
        if best.x[0] <= CLEAR * deviation:  # indistinguishable from no load
            return 0.0, best.x * size
        return float(np.log(2.0) - best.fun - 0.5 * np.sum(np.log(precision))), best.x * size

    def _starts(self, slope: Array, curvature: Array, size: Array) -> Iterator[Array]:
        """Every starting position with its most likely mass."""
        for place in self.points:
            unit, _ = _point_mass(np.array([1.0, *place]))
            stiff = unit @ curvature @ unit + 1.0 / self.mass**2
            yield np.array([max(float(slope @ unit) / stiff, 1e-3 * self.mass), *place]) / size


def _point_mass(load: Array) -> tuple[Array, Array]:
    """The ten parameters of a point mass about the link's frame, (10,), and their derivatives, (10, 4).

    Args:
        load: mass and position, shape (4,).
    """
    mass, place = load[0], load[1:]
    jacobian = np.zeros((COUNT, 4))
    jacobian[0, 0], jacobian[1:4, 0], jacobian[1:4, 1:] = 1.0, place, mass * np.eye(3)
    jacobian[4:, 0] = _six(place @ place * np.eye(3) - np.outer(place, place))
    for axis, unit in enumerate(np.eye(3)):
        turned = 2.0 * place[axis] * np.eye(3) - np.outer(unit, place) - np.outer(place, unit)
        jacobian[4:, 1 + axis] = mass * _six(turned)
    return mass * jacobian[:, 0], jacobian


def _six(inertia: Array) -> Array:
    """xx, yy, zz, xy, xz, yz of an inertia."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return np.array([inertia[pair] for pair in pairs])

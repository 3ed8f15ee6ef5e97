"""Weighted least squares of the standard model, with physically consistent mass properties.

Minimised over the mass properties phi of all bodies, the rotors and each joint's friction:

    1/2 sum_j |tau_j - Y_j phi - F_j c_j|^2 / sigma_j^2 + 1/s^2 sum_b D(phi_b, phi_b nominal)

with the rms sigma_j of each joint's residual (weighted least squares of the inverse dynamic model,
IDIM-WLS; Gautier, Janot, Vandanjon, IEEE Trans. Control Systems Technology 21 (2013)) and the
log-determinant divergence D of `bodies`. The relative width s of the nominal mass properties is chosen by
cross-validation. Rotors, viscous and Coulomb friction are not negative (interior point).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from missing_physics.bodies.pseudo_inertia import divergence
from missing_physics.evaluation.sliding import determined
from missing_physics.standard.layout import Layout
from missing_physics.standard.normal import Normal, acting, total_of
from missing_physics.standard.rows import MODEL_ERROR, Rows, Weights
from reference_model.evaluation.model import RobotModel

__all__ = [
    "BLOCKS",
    "FILE",
    "FOLDS",
    "Estimate",
    "design_of",
    "estimate",
    "least_rms",
    "minimise",
    "objective",
    "residual_rms",
    "weights_of",
]

Array = NDArray[np.float64]

#: Relative prior widths of the nominal mass properties to choose from: nearly known to unknown.
WIDTHS = (0.01, 0.05, 0.3, 2.0)
#: Largest of them where links are flexible: mode shapes are those of the robot file's masses.
SHAPES = 0.3
#: Relative error of a parameter in a correct robot file [-]: data sheets and CAD are good to some percent.
FILE = 0.1
#: Relative error of the common scale of all bodies, which is not identifiable for a robot without actuators:
#: all estimates are proportional to it.
KEPT = 1e-3
#: Folds of a recording, each left out once, and blocks per fold, whose scatter gives the errors of the
#: estimate. A block is long compared with the correlation time of the residual.
FOLDS, BLOCKS = 5, 6
#: Rounds of reweighting; weights and estimate agree to a percent after three.
ROUNDS = 3
#: Prior width for the first weights, before a width is chosen.
FIRST = 0.3
#: Weight of the barrier that keeps rotors and friction positive: its cost is far below one nat.
BARRIER = 1e-3
#: Most Newton steps, and the decrement [nats] below which the iteration ends.
MOST_STEPS, DECREMENT = 60, 1e-6


@dataclass(frozen=True)
class Estimate:
    """The fitted standard model.

    Attributes:
        layout: the parameters.
        values: of all parameters, shape (X,).
        deviation: standard deviation of each, shape (X,), from the scatter of blocks of rows; 0 where fixed.
        sigma: rms of each joint's residual in the fitted rows, shape (n,).
        width: chosen relative prior width of the nominal mass properties.
    """

    layout: Layout
    values: Array
    deviation: Array
    sigma: Array
    width: float

    def value(self, name: str) -> tuple[float, float]:
        """Estimate and standard deviation of one parameter."""
        place = self.layout.names.index(name)
        return float(self.values[place]), float(self.deviation[place])

    def predicted(self, rows: Rows) -> Array:
        """Predicted torque minus that of the robot's other effects, shape (K, n)."""
        return design_of(rows) @ self.values

    def residual(self, rows: Rows) -> Array:
        """Measured minus predicted torque, shape (K, n)."""
        return np.asarray(rows.torque - self.predicted(rows))


def estimate(model: RobotModel, nominal: Array, rows: Sequence[Rows]) -> Estimate:
    """Fit the standard model to all counted rows.

    Args:
        model: of the robot without friction.
        nominal: its inertial parameters, those of its effects included, shape (P,).
        rows: of the fitted recordings, at least one with a counted row.
    """
    layout = Layout.of(model, nominal, rows)
    folds = _blocks(rows)
    groups = [total_of(fold) for fold in folds]
    everything, least = total_of(groups), least_rms(rows)
    sigma = residual_rms(everything, layout.start, least)
    found = minimise(layout, everything, sigma, FIRST, layout.start)
    sigma = residual_rms(everything, found, least)
    widths = [width for width in WIDTHS if width <= SHAPES or not layout.beams.size]
    scores = {width: _cross_validated(layout, groups, everything, sigma, width) for width in widths}
    chosen = min(scores, key=lambda width: scores[width])
    for _ in range(ROUNDS):
        found = minimise(layout, everything, sigma, chosen, found)
        sigma = residual_rms(everything, found, least)
    blocks = [block for fold in folds for block in fold]
    return Estimate(
        layout, found, _deviation(layout, blocks, everything, sigma, chosen, found), sigma, chosen
    )


def weights_of(model: RobotModel, nominal: Array, rows: Sequence[Rows], file_friction: Array) -> Weights:
    """Weights of samples from a first fit to all of them.

    Args:
        model, nominal: see `estimate`.
        rows: of the fitted recordings, with the weight one everywhere.
        file_friction: level of dry friction in the robot file, shape (n,).
    """
    layout = Layout.of(model, nominal, rows)
    blocks = [block for fold in _blocks(rows) for block in fold]
    everything, found, least = total_of(blocks), layout.start, least_rms(rows)
    for _ in range(2):  # the second round uses the weights of the first
        sigma = residual_rms(everything, found, least)
        found = minimise(layout, everything, sigma, FIRST, found)
    deviation = _deviation(layout, blocks, everything, sigma, FIRST, found)
    places = [layout.names.index(f"{joint}.coulomb") for joint in model.joints]
    dry = np.maximum(np.hypot(found[places], deviation[places]), file_friction)  # rms of its possible values
    noise = np.sqrt(np.mean([own.noise**2 for own in rows], axis=0))
    scale = np.sqrt(np.mean(np.concatenate([own.scale for own in rows]) ** 2, axis=0))
    rest = determined(np.hypot(noise, MODEL_ERROR * scale), dry)
    return Weights(rest, residual_rms(everything, found, least))


def _blocks(rows: Sequence[Rows]) -> list[list[Normal]]:
    """Blocks of rows, grouped by fold: recordings, or stretches of a single recording."""
    designs = [np.where(r.counted[:, :, None], design_of(r), 0.0) for r in rows]
    active, folds = acting(designs), []
    for r, design in zip(rows, designs):
        parts = 1 if len(rows) >= FOLDS else FOLDS
        cuts = np.linspace(0, r.time.size, parts * BLOCKS + 1).astype(int)
        columns = [design[:, k, own] for k, own in enumerate(active)]
        torque = np.where(r.counted, r.torque, 0.0)
        blocks = []
        for first, last in pairwise(cuts):
            within = [own[first:last] for own in columns]
            counted = r.counted[first:last].sum(axis=0).astype(float)
            blocks.append(Normal.of(active, within, torque[first:last], counted, design.shape[2]))
        folds += [blocks[k * BLOCKS : (k + 1) * BLOCKS] for k in range(parts)]
    return folds


def _cross_validated(
    layout: Layout, groups: Sequence[Normal], everything: Normal, sigma: Array, width: float
) -> float:
    """Cross-validated weighted squared error: every fold predicted by the fit to all others."""
    total = 0.0
    start = minimise(layout, everything, sigma, width, layout.start)
    for k, group in enumerate(groups):
        others = [other for i, other in enumerate(groups) if i != k]
        x = minimise(layout, total_of(others), sigma, width, start)
        total += float(np.sum(group.energy(x) / sigma**2))
    return total


def least_rms(rows: Sequence[Rows]) -> Array:
    """Least rms residual of each joint, shape (n,): the noise where no torque is recorded, else zero.

    The residual of a joint that nothing drives is proportional to the bodies that it carries. If it alone
    were its weight, bodies without mass would fit best.
    """
    noise = np.sqrt(np.mean([own.noise**2 for own in rows], axis=0))
    driven = np.any([own.measured.any(axis=0) for own in rows], axis=0)
    return np.where(driven, 0.0, noise)


def residual_rms(problem: Normal, x: Array, least: Array | float = 0.0) -> Array:
    """rms residual of each joint; one for a joint without rows.

    Args:
        problem: the normal equations.
        x: the parameters, shape (X,).
        least: least value of each joint, shape (n,), see `least_rms`.
    """
    energy = problem.energy(x) / np.maximum(problem.count, 1.0)
    floor = 1e-12 * (problem.square / np.maximum(problem.count, 1.0)) + 1e-300
    found = np.maximum(np.sqrt(np.maximum(energy, floor)), least)
    return np.asarray(np.where(problem.count > 0, found, 1.0))


def minimise(layout: Layout, problem: Normal, sigma: Array, width: float, start: Array) -> Array:
    """Minimum of the convex objective by damped Newton steps from inside the feasible set, shape (X,)."""
    free, size = layout.free, layout.size[layout.free]
    estimated, scales = np.ix_(free, free), np.outer(size, size)
    weighted = _Weighted.of(problem, sigma)
    x = start.copy()
    value, gradient, hessian = _objective(layout, weighted, width, x)
    for _ in range(MOST_STEPS):
        scaled = hessian[estimated] * scales
        scaled[np.diag_indices(len(scaled))] += 1e-12 * np.trace(scaled) / max(len(scaled), 1)
        step = np.zeros_like(x)
        step[free] = -size * np.linalg.solve(scaled, size * gradient[free])
        decrement = -float(gradient @ step)
        if decrement < DECREMENT:
            break
        length = 1.0
        while length > 1e-9:
            after = _objective(layout, weighted, width, x + length * step)
            if after[0] <= value - 0.1 * length * decrement:
                break
            length *= 0.5
        else:
            break
        x, (value, gradient, hessian) = x + length * step, after
    return x


def objective(
    layout: Layout, problem: Normal, sigma: Array, width: float, x: Array
) -> tuple[float, Array, Array]:
    """Value, gradient and Hessian of the objective; the value is infinite outside the feasible set."""
    return _objective(layout, _Weighted.of(problem, sigma), width, x)


@dataclass(frozen=True)
class _Weighted:
    """Normal equations of all joints together, weighted by their residuals.

    Attributes:
        gram, right, square: shapes (X, X), (X,), ().
    """

    gram: Array
    right: Array
    square: float

    @classmethod
    def of(cls, problem: Normal, sigma: Array) -> _Weighted:
        weight = 1.0 / sigma**2
        return cls(*problem.weighted(weight), float(weight @ problem.square))


def _objective(layout: Layout, weighted: _Weighted, width: float, x: Array) -> tuple[float, Array, Array]:
    positive = x[layout.positive]
    if np.any(positive <= 0.0):
        return np.inf, x, np.zeros((0, 0))
    hessian, pulled = weighted.gram.copy(), weighted.gram @ x
    gradient = pulled - weighted.right
    value = 0.5 * max(weighted.square + float((pulled - 2.0 * weighted.right) @ x), 0.0)
    value -= BARRIER * float(np.log(positive / layout.size[layout.positive]).sum())
    gradient[layout.positive] -= BARRIER / positive
    hessian[layout.positive, layout.positive] += BARRIER / positive**2
    if layout.bodies:
        tens = np.array([np.arange(place.start, place.stop) for place in layout.bodies])
        apart, slope, curvature = divergence(x[tens], layout.start[tens])
        if not np.all(np.isfinite(apart)):
            return np.inf, x, np.zeros((0, 0))
        value += float(apart.sum()) / width**2
        gradient[tens] += slope / width**2
        hessian[tens[:, :, None], tens[:, None, :]] += curvature / width**2
    if layout.beams.size:
        if np.any(x[layout.beams] <= 0.0):
            return np.inf, x, np.zeros((0, 0))
        ratio = x[layout.beams] / layout.start[layout.beams]  # divergence of a scalar
        value += float(np.sum(ratio - np.log(ratio) - 1.0)) / width**2
        gradient[layout.beams] += (1.0 - 1.0 / ratio) / layout.start[layout.beams] / width**2
        hessian[layout.beams, layout.beams] += 1.0 / x[layout.beams] ** 2 / width**2
    if layout.scale.any():
        off = float(layout.scale @ x) - 1.0
        value += 0.5 * (off / KEPT) ** 2
        gradient += layout.scale * off / KEPT**2
        hessian += np.outer(layout.scale, layout.scale) / KEPT**2
    if layout.extra is not None:
        known, places = layout.extra, layout.extra_places
        pull = known.matrix @ x[places] - known.vector
        value += 0.5 * float((pull - known.vector) @ x[places])
        gradient[places] += pull
        hessian[np.ix_(places, places)] += known.matrix
    own = layout.gaussian  # keeps parameters that the rows do not determine small
    away = (x[own] - layout.centre[own]) / layout.width[own]
    value += 0.5 * float(np.sum(away**2))
    gradient[own] += away / layout.width[own]
    hessian[own, own] += 1.0 / layout.width[own] ** 2
    return value, gradient, hessian


def _deviation(
    layout: Layout,
    blocks: Sequence[Normal],
    everything: Normal,
    sigma: Array,
    width: float,
    x: Array,
) -> Array:
    """Standard deviations from the scatter of the blocks' scores (sandwich), including the prior, (X,)."""
    free = layout.free
    size, weight = layout.size[free], 1.0 / sigma**2
    estimated = np.ix_(free, free)
    hessian = objective(layout, everything, sigma, width, x)[2][estimated] * np.outer(size, size)
    information = everything.weighted(weight)[0][estimated] * np.outer(size, size)
    inverse = np.linalg.pinv(hessian, hermitian=True)
    pulls = (block.weighted(weight) for block in blocks)
    scores = np.array([(right - gram @ x)[free] * size for gram, right in pulls])
    scores -= scores.mean(axis=0)
    factor = len(blocks) / max(len(blocks) - 1, 1)
    meat = factor * scores.T @ scores + hessian - information  # of the rows, and of the prior
    covariance = inverse @ meat @ inverse
    found = np.zeros_like(x)
    found[free] = size * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return found


def design_of(rows: Rows) -> Array:
    """Derivatives of each joint's torque by all parameters, shape (K, n, X)."""
    count, joints, numbers = rows.inertial.shape
    kinds = rows.friction.shape[2]
    design = np.zeros((count, joints, numbers + joints * kinds))
    design[:, :, :numbers] = rows.inertial
    design[:, :, numbers - 3 : numbers] = 0.0  # gravity is known, and included in the masses' columns
    for k in range(joints):
        design[:, k, numbers + k * kinds : numbers + (k + 1) * kinds] = rows.friction[:, k]
    design[:, :, numbers:] = rows.nuisance.removed(design[:, :, numbers:])
    return design

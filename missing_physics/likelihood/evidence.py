"""Evidence and posterior of a model that is linear near its present parameters.

In band b of joint j the residual's Fourier transform is ``R = X d + sum_g e_g F_g + N``: N complex Gaussian
of variance s_jb, d the change of the parameters, and e_g the model's own error: the share by which the force
F_g that an effect explains is off in this band. Rigid bodies and laws of friction are idealisations: they
hold at the frequencies of a motion and less and less above. Of bodies an error of size ``f / corner`` a
quarter of a period late and ``(f / corner)^2`` in phase is expected, at most all of the force; friction is
expected to build up with a lag of first order of which half is unsure. Without these terms the thousands of
bins at frequencies at which no such law holds outweigh the few in which the robot moves. Everything but the
levels s_jb is integrated out; these are at their most probable values, found again for every model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.likelihood.gram import Gram

__all__ = ["JointSums", "ModelError", "Posterior", "Prior", "posterior", "predictive"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Share by which an explained force is off at the lowest frequencies [-]: gears, inertias and integrators.
FLOOR = 3e-3
#: A force of bodies that does not act at all is off by itself [-].
LARGEST = 1.0
#: Bins that the reference spectrum counts as in the estimate of a level.
REFERENCE_BINS = 1.0
#: Rounds in which levels and parameters are brought to agree, and the change of a log level that ends them.
ROUNDS, AGREED = 12, 1e-3


@dataclass(frozen=True)
class ModelError:
    """How far the forces that a model explains at one joint are off.

    Attributes:
        bodies: frequency at which rigid bodies mean nothing any more [Hz].
        laws: frequency below which a law of friction acts as described [Hz].
        floor: share by which any force is off at low frequencies [-].
    """

    bodies: float
    laws: float
    floor: float = FLOOR

    def gain(self, frequency: Array, law: NDArray[np.bool_]) -> Complex:
        """Expected share of a force that acts, as a transfer function.

        Args:
            frequency: [Hz], shape (B,).
            law: whether a force is that of a law at the joint, shape (G,).

        Returns:
            Shape (B, G).
        """
        lag = 1.0 / (1.0 + 1j * frequency / self.laws)
        return np.where(law, lag[:, None], 1.0)

    def shares(self, frequency: Array, law: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Standard deviations of the share that acts, in phase and in quadrature, shape (B, G) each."""
        missing = 1.0 - 1.0 / (1.0 + 1j * frequency / self.laws)
        ratio = frequency / self.bodies
        in_phase = np.where(law, 0.5 * missing.real[:, None], np.minimum(ratio**2, LARGEST)[:, None])
        late = np.where(law, 0.5 * missing.imag[:, None], np.minimum(ratio, LARGEST)[:, None])
        return np.hypot(self.floor, in_phase), np.hypot(self.floor, late)


@dataclass(frozen=True)
class JointSums:
    """Band sums of one joint, with columns ``[residual, K derivatives, G explained forces]``.

    Attributes:
        gram: of these columns.
        places: which parameters the K derivatives belong to, shape (K,).
        frequency: centres of the bands [Hz], shape (B,).
        law: whether each of the G forces is that of a law at the joint, and not of bodies, shape (G,).
        columns: the same of the K derivatives, shape (K,).
    """

    gram: Gram
    places: NDArray[np.int_]
    frequency: Array
    law: NDArray[np.bool_]
    columns: NDArray[np.bool_]

    def without_error(self, error: ModelError, levels: Array) -> tuple[Array, Array]:
        """Products over levels with the model's error integrated out, and its log determinants.

        Returns:
            Real symmetric, shape (B, 1 + K, 1 + K), and shape (B,).
        """
        inner = 1 + self.places.size
        products = self.gram.products
        kept = products[:, :inner, :inner]
        forces = products[:, inner:, inner:]
        if not forces.shape[1]:
            return kept.real / levels[:, None, None], np.zeros(len(kept))
        products = self._acting(error)
        kept, forces = products[:, :inner, :inner], products[:, inner:, inner:]
        in_phase, late = error.shares(self.frequency, self.law)
        count = forces.shape[1]
        factor = np.hstack([in_phase, 1j * late])  # (B, 2 G): all forces in phase, then all in quadrature
        twice = np.tile(forces, (1, 2, 2)) * factor.conj()[:, :, None] * factor[:, None, :]
        scaled = np.eye(2 * count) + 2.0 * twice.real / levels[:, None, None]
        across = 2.0 * (np.tile(products[:, inner:, :inner], (1, 2, 1)) * factor.conj()[:, :, None]).real
        taken = 0.5 * across.transpose(0, 2, 1) @ np.linalg.solve(scaled, across) / levels[:, None, None]
        left = (kept.real - taken) / levels[:, None, None]
        return left, 0.5 * np.linalg.slogdet(scaled)[1]

    def _acting(self, error: ModelError) -> Complex:
        """Products of the columns as they are expected to act: the residual less what does not."""
        inner = 1 + self.places.size
        lag = 1.0 - error.gain(self.frequency, self.law)  # (B, G)
        act = error.gain(self.frequency, self.columns)  # (B, K)
        found = self.gram.products.copy()
        found[:, 0] += np.einsum("bg,bgk->bk", lag.conj(), found[:, inner:])
        found[:, :, 0] += np.einsum("bg,bkg->bk", lag, found[:, :, inner:])
        found[:, 1:inner] *= act.conj()[:, :, None]
        found[:, :, 1:inner] *= act[:, None, :]
        return found


@dataclass(frozen=True)
class Prior:
    """Minus the log of a prior density near the present parameters, ``cost - pull d + 1/2 d precision d``.

    Attributes:
        precision: second derivative, shape (P, P).
        pull: minus the first derivative, where the prior wants to go, shape (P,).
        cost: value at the present parameters, the density's normalisation included [nats].
    """

    precision: Array
    pull: Array
    cost: float

    @classmethod
    def gaussian(cls, width: Array, away: Array) -> Prior:
        """Independent Gaussians of standard deviation `width`, whose means lie `away` from the present."""
        weight = 1.0 / width**2
        cost = 0.5 * float(weight @ away**2) + float(np.sum(np.log(width * np.sqrt(2.0 * np.pi))))
        return cls(np.diag(weight), weight * away, cost)


@dataclass(frozen=True)
class Posterior:
    """Of the change of the parameters.

    Attributes:
        mean, covariance: shape (P,), (P, P).
        levels: power of the unexplained force over the reference spectrum, one array (B,) for each joint.
        log_evidence: natural logarithm, up to a constant of the data and their reference spectra.
        energies: expected power over level in each band, one array (B,) for each joint: one on average where
            the model is adequate, 1 + K parameters less.
    """

    mean: Array
    covariance: Array
    levels: tuple[Array, ...]
    log_evidence: float
    energies: tuple[Array, ...]


def posterior(
    joints: Sequence[JointSums],
    prior: Prior,
    errors: Sequence[ModelError],
    levels: Sequence[Array] | None = None,
) -> Posterior:
    """Posterior of the parameters' change, and the evidence by Laplace's method.

    Args:
        joints: band sums at the present parameters.
        prior: of the P parameters.
        errors: of the model, one for each joint.
        levels: where the search for the levels begins; at the reference when left out.
    """
    found = [np.ones(j.frequency.size) for j in joints] if levels is None else [*levels]
    for _ in range(ROUNDS):
        parts = [j.without_error(error, level) for j, error, level in zip(joints, errors, found)]
        mean, covariance = _solved(joints, [products for products, _ in parts], prior)
        updated = [
            _level(joint, products, mean, covariance, level)
            for joint, (products, _), level in zip(joints, parts, found)
        ]
        change = max(float(np.abs(np.log(new / old)).max()) for new, old in zip(updated, found))
        found = updated
        if change < AGREED:
            break
    parts = [j.without_error(error, level) for j, error, level in zip(joints, errors, found)]
    mean, covariance = _solved(joints, [products for products, _ in parts], prior)
    total = 0.5 * float(np.linalg.slogdet(covariance)[1] + mean.size * np.log(2.0 * np.pi))
    total -= prior.cost - float(prior.pull @ mean) + 0.5 * float(mean @ prior.precision @ mean)
    energies = []
    for joint, level, (products, determinants) in zip(joints, found, parts):
        energy = _energy(joint, products, mean)
        total -= float(np.sum(joint.gram.count * np.log(level) + energy + determinants))
        total -= REFERENCE_BINS * float(np.sum(np.log(level) + 1.0 / level))
        energies.append(energy / np.maximum(joint.gram.count, 1.0))
    return Posterior(mean, covariance, tuple(found), total, tuple(energies))


def predictive(joints: Sequence[JointSums], known: Posterior, errors: Sequence[ModelError]) -> float:
    """Log predictive density of other recordings, up to the same constant, the parameters integrated out."""
    total = 0.0
    parts = [j.without_error(error, level) for j, error, level in zip(joints, errors, known.levels)]
    gram = np.zeros_like(known.covariance)
    slope = np.zeros_like(known.mean)
    for joint, level, (products, determinants) in zip(joints, known.levels, parts):
        energy = _energy(joint, products, known.mean)
        total -= float(np.sum(joint.gram.count * np.log(level) + energy + determinants))
        summed = 2.0 * products.sum(axis=0)
        gram[np.ix_(joint.places, joint.places)] += summed[1:, 1:]
        slope[joint.places] += summed[1:, 0] - summed[1:, 1:] @ known.mean[joint.places]
    whole = np.linalg.inv(known.covariance) + gram
    gained = slope @ np.linalg.solve(whole, slope)
    total += 0.5 * float(gained - np.linalg.slogdet(known.covariance @ whole)[1])
    return total


def _solved(joints: Sequence[JointSums], products: Sequence[Array], prior: Prior) -> tuple[Array, Array]:
    whole, right = prior.precision.copy(), prior.pull.copy()
    for joint, part in zip(joints, products):
        summed = 2.0 * part.sum(axis=0)
        whole[np.ix_(joint.places, joint.places)] += summed[1:, 1:]
        right[joint.places] += summed[1:, 0]
    size = 1.0 / np.sqrt(np.diag(whole))
    covariance = np.linalg.inv(whole * np.outer(size, size)) * np.outer(size, size)
    return covariance @ right, covariance


def _energy(joint: JointSums, products: Array, mean: Array) -> Array:
    """Squared residual over level in each band after the change `mean`, shape (B,)."""
    change = np.concatenate([[1.0], -mean[joint.places]])
    return np.asarray(np.maximum(np.einsum("bkl,k,l->b", products, change, change), 1e-300))


def _level(joint: JointSums, products: Array, mean: Array, covariance: Array, level: Array) -> Array:
    """Most probable levels: power of the residual over the bins that no parameter took."""
    own = covariance[np.ix_(joint.places, joint.places)]
    taken = np.einsum("bkl,kl->b", products[:, 1:, 1:], own)
    energy = level * _energy(joint, products, mean)
    bins = np.maximum(joint.gram.count - taken, 0.1 * joint.gram.count)
    return np.asarray((energy + REFERENCE_BINS) / (bins + REFERENCE_BINS))

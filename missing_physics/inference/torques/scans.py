"""Starting values of effects that add coordinates, by a scan over a grid of their parameters.

The torques of a link that vibrates depend on its period like a comb: Gauss-Newton steps converge only from
nearby. So the torques of all parameters on a grid are computed once, at the bodies of the first linearisation
and as many instants as the band requires, and compared with the residual of each hypothesis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Candidate, Hypothesis, Term
from missing_physics.inference.fit import RIDGE
from missing_physics.inference.torques.runs import Run
from missing_physics.inference.torques.yielding import (
    WIDER,
    frequencies_of,
    rows_of_yielding,
    rows_within,
    stretch_of,
)
from missing_physics.standard.normal import Places
from missing_physics.standard.prediction import knows_links
from reference_model.effects.catalogue import catalogue
from reference_model.effects.structure import StructureEffect
from robot_model import InputError, Robot

__all__ = ["Scan", "gains", "scanned", "scans_of"]

Array = NDArray[np.float64]

#: Most instants of a scan over all recordings, where the standard model errs most: over a hundred periods of
#: the band's end.
INSTANTS = 1000
#: Robots that are computed together, which limits memory.
TOGETHER = 16
#: Most starting values of one effect at one place, and over all of them.
PEAKS, STARTS = 2, 6


@dataclass(frozen=True)
class Scan:
    """Torques of one effect at one place for a grid of parameters; V grid points, S free vibrations.

    Attributes:
        effect, at: the effect and its place.
        starts: parameters of each grid point.
        joints: indices of the joints that are compared in some recording, shape (a,).
        rows: those of each recording.
        torques: in these, zero where nothing is compared, shape (K, a, V, 1 + S) each
            (`yielding.rows_of_yielding`).
    """

    effect: StructureEffect
    at: str
    starts: tuple[dict[str, float], ...]
    joints: Places
    rows: tuple[slice, ...]
    torques: tuple[NDArray[np.float32], ...]


def scans_of(robot: Robot, runs: Sequence[Run], fitted: Sequence[NDArray[np.bool_]]) -> tuple[Scan, ...]:
    """Scans of all effects that add coordinates to a robot of rigid links, at the base and at every link.

    Args:
        robot: nominal.
        runs: the fitted recordings.
        fitted: mask of the rows of each one that are fitted, shape (K,).
    """
    if not knows_links(robot) or robot.spherical_joints:
        return ()
    return tuple(_scans(robot, runs, fitted))


def _scans(robot: Robot, runs: Sequence[Run], fitted: Sequence[NDArray[np.bool_]]) -> Iterator[Scan]:
    stretches = [stretch_of(run, INSTANTS // len(runs), own) for run, own in zip(runs, fitted)]
    rows = tuple(rows_within(run, *within) for run, within in zip(runs, stretches))
    joints = np.flatnonzero(np.any([run.rows.counted.any(axis=0) for run in runs], axis=0))
    for effect in catalogue().values():
        if not isinstance(effect, StructureEffect) or not effect.adds_coordinates:
            continue
        for at in ("base",) if effect.place == "base" else [link.name for link in robot.links]:
            starts = [{**effect.defaults(), **start} for start in effect.grid(robot)]
            try:
                effect.changed(robot, at, starts[0])
            except InputError:
                continue
            starts = _slow(effect, at, starts, runs[0])
            torques = tuple(
                _torques(effect, at, starts, run, within)[:, joints] for run, within in zip(runs, stretches)
            )
            for run in runs:
                run.reshaped.pop((effect.id, at), None)  # few places are tried, and each takes megabytes
            yield Scan(effect, at, tuple(starts), joints, rows, torques)


def _slow(
    effect: StructureEffect, at: str, starts: Sequence[dict[str, float]], run: Run
) -> list[dict[str, float]]:
    """Starting values with a resonance in the band, and the softest of the others.

    Below its resonances what yields follows the forces at once, with torques in proportion to its softness.
    """
    slowest = np.array([frequencies_of(effect, at, run, p)[0] for p in starts])
    inside = slowest < 2.0 * np.pi * WIDER * run.motion.cutoff
    softest = np.where(inside, np.inf, slowest).argmin()
    return [start for k, start in enumerate(starts) if inside[k] or k == softest]


def _torques(
    effect: StructureEffect,
    at: str,
    starts: Sequence[dict[str, float]],
    run: Run,
    within: tuple[float, float],
) -> NDArray[np.float32]:
    """Torques in the rows of one recording, shape (K, n, V, 1 + S); unused free vibrations are zero."""
    parts = []
    for first in range(0, len(starts), TOGETHER):
        rows = rows_of_yielding(effect, at, run, starts[first : first + TOGETHER], within=within)
        parts.append(rows.astype(np.float32))
    most = max(part.shape[3] for part in parts)
    wide = [np.pad(part, ((0, 0), (0, 0), (0, 0), (0, most - part.shape[3]))) for part in parts]
    return np.concatenate(wide, axis=2)


def scanned(
    robot: Robot,
    scans: Sequence[Scan],
    hypothesis: Hypothesis,
    designs: Sequence[Array],
    residual: Sequence[Array],
    sigma: Array,
) -> list[Candidate]:
    """Candidates whose torques explain some of the residual beyond the columns of the standard model.

    Args:
        robot: nominal.
        scans: of the fitted recordings.
        hypothesis: to which effects are added.
        designs: columns of the standard model in each fitted recording, shape (K, n, X).
        residual: of each recording, zero where nothing is fitted, shape (K, n) [N m or N].
        sigma: rms of the residual at each joint, shape (n,) [N m or N].
    """
    present = {term.key for term in hypothesis.terms}
    wanted = [scan for scan in scans if (scan.effect.id, scan.at) not in present]
    if not wanted:
        return []
    joints, some = wanted[0].joints, wanted[0].rows
    sigma = sigma[joints]
    designs = [own[rows][:, joints] for own, rows in zip(designs, some)]
    residual = [own[rows][:, joints] for own, rows in zip(residual, some)]
    fitted = [own.any(axis=1) for own in residual]
    columns = _stacked([d[rows] / sigma[:, None] for d, rows in zip(designs, fitted)])
    columns /= np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-300)
    known = np.linalg.qr(np.vstack([columns, RIDGE**0.5 * np.eye(columns.shape[1])]))[0][: len(columns)]
    left = _stacked([own[rows, :, None] / sigma[:, None] for own, rows in zip(residual, fitted)])
    left -= known @ (known.T @ left)
    found: list[tuple[float, Term]] = []
    for scan in wanted:
        parts = [
            (own[rows] / sigma[:, None, None]).astype(np.float32) for own, rows in zip(scan.torques, fitted)
        ]
        gain, price = gains(parts, known, left[:, 0])
        price += np.log(len(scan.starts))  # one of many
        limits = scan.effect.limits(robot, scan.at)
        for v in _peaks(gain - price):
            term = Term.of(scan.effect, scan.at, scan.starts[v], limits=limits, further=float(price[v]))
            found.append((float(gain[v] - price[v]), term))
    best = sorted(found, key=lambda one: -one[0])[:STARTS]
    return [Candidate(term, expected=gain) for gain, term in best]


def gains(parts: Sequence[NDArray[np.float32]], known: Array, left: Array) -> tuple[Array, Array]:
    """Log-likelihood gained at every grid point, and the price of free vibrations [nats], (V,) each.

    Args:
        parts: torques in each recording, shape (K, a, V, 1 + S) each; S may differ.
        known: orthonormal columns of the standard model at R rows of all recordings and joints, (R, X).
        left: residual, shape (R,).
    """
    sizes = np.cumsum([0, *(part.shape[0] * part.shape[1] for part in parts)])
    free = np.cumsum([1, *(part.shape[3] - 1 for part in parts)])
    count, prior = parts[0].shape[2], np.eye(free[-1] - 1)
    gain, price = np.zeros((2, count))
    for v in range(count):
        own = np.zeros((sizes[-1], free[-1]))
        for i, part in enumerate(parts):
            rows, flat = slice(sizes[i], sizes[i + 1]), part[:, :, v].reshape(-1, part.shape[3])
            own[rows, 0] = flat[:, 0]
            own[rows, free[i] : free[i + 1]] = flat[:, 1:]
        across = known.T @ own
        gram, pull = own.T @ own - across.T @ across, own.T @ left
        gain[v] = pull[0] - 0.5 * gram[0, 0]
        if prior.size:
            inner, aim = gram[1:, 1:] + prior, pull[1:] - gram[1:, 0]
            gain[v] += 0.5 * aim @ np.linalg.solve(inner, aim)
            price[v] = 0.5 * np.linalg.slogdet(inner)[1]
    return gain, price


def _stacked(parts: Sequence[Array]) -> Array:
    """Rows of all recordings and joints one below the other, (K, n, C) each to (sum of K n, C)."""
    return np.concatenate([part.reshape(-1, part.shape[2]) for part in parts]).astype(float)


def _peaks(gain: Array) -> list[int]:
    """Grid points with the largest gains, none next to a better one."""
    wider = np.concatenate([[-np.inf], gain, [-np.inf]])
    tops = np.flatnonzero((gain > 0.0) & (gain >= wider[:-2]) & (gain > wider[2:]))
    return sorted(tops.tolist(), key=lambda v: -gain[v])[:PEAKS]

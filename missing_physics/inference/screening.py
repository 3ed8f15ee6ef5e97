"""How much every candidate promises, by one linear step: all of them in one pass over the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses.candidates import Candidate
from missing_physics.inference.problem import Fit, Problem

__all__ = ["Look", "looks"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Look:
    """A candidate and the log score that it promises in folds that are left out [nats]."""

    candidate: Candidate
    gain: float


def looks(problem: Problem, fit: Fit, options: Sequence[Candidate], share: Array) -> list[Look]:
    """Best start of every effect at every place, most promising first.

    Args:
        problem: the rows.
        fit: what is added to.
        options: candidates.
        share: independent samples over samples, of each joint.
    """
    runs = len(problem.runs)
    layout = fit.layout
    free = layout.free
    weight = 1.0 / fit.sigma
    terms = fit.hypothesis.terms
    at = len(problem.standard.estimate.layout.names)
    whole, residual, masks = [], [], []
    for i in range(runs):
        design = problem.designs[i]
        own = [problem.columns(t)[i] for t in terms]
        full = np.concatenate([design, *(c[:, :, 1:] for c in own)], axis=2)
        left = problem.runs[i].rows.torque - design @ fit.values
        for c in own:
            left = left - c[:, :, 0]
        counted = problem.runs[i].rows.counted
        whole.append((np.where(counted[:, :, None], full, 0.0) * weight[:, None])[:, :, free])
        residual.append(np.where(counted, np.nan_to_num(left), 0.0) * weight)
        masks.append(counted)
    size = layout.size[free]
    hessian = fit.hessian * np.outer(size, size)
    inverse = np.linalg.inv(hessian + 1e-9 * np.eye(len(hessian)) * np.trace(hessian) / len(hessian))
    inverse *= np.outer(size, size)
    del at
    best: dict[tuple[str, str], Look] = {}
    for option in options:
        gain = _gain(problem, option, whole, residual, masks, weight, inverse, share)
        key = option.term.key
        if key not in best or gain > best[key].gain:
            best[key] = Look(option, gain)
    return sorted(best.values(), key=lambda look: -look.gain)


def _gain(
    problem: Problem,
    option: Candidate,
    whole: Sequence[Array],
    residual: Sequence[Array],
    masks: Sequence[Array],
    weight: Array,
    inverse: Array,
    share: Array,
) -> float:
    columns = problem.columns(option.term)
    linear = [1 + i for i, p in enumerate(option.term.free) if p.linear]
    nonlinear = not linear
    keep = [0, *range(1, columns[0].shape[2])] if nonlinear else list(range(1, columns[0].shape[2]))
    parts = []
    for i, (c, mask) in enumerate(zip(columns, masks)):
        own = np.where(mask[:, :, None], c[:, :, keep], 0.0) * weight[:, None]
        parts.append(own)
        del i
    across = sum(np.einsum("tjx,tjc->xc", a, c, optimize=True) for a, c in zip(whole, parts))
    scale = np.sqrt(sum((c**2).sum(axis=(0, 1)) for c in parts))
    if not np.all(np.isfinite(scale)) or not np.any(scale > 0):
        return -np.inf
    taken = inverse @ across
    fresh = [c - np.einsum("tjx,xc->tjc", a, taken, optimize=True) for a, c in zip(whole, parts)]
    grams, rights, squares, counts = [], [], [], []
    for i, s, fold in problem.blocks:
        if fold < 0:
            continue
        c, r = fresh[i][s] / np.maximum(scale, 1e-300), residual[i][s]
        grams.append(np.einsum("tjc,tjd->jcd", c, c))
        rights.append(np.einsum("tjc,tj->jc", c, r))
        squares.append((r**2).sum(axis=0))
        counts.append(masks[i][s].sum(axis=0))
    gram, right = np.array(grams), np.array(rights)
    square, count = np.sum(squares, axis=0), np.sum(counts, axis=0)
    folds = problem.fold[problem.seen]
    after = np.zeros_like(square)
    total_gram, total_right = gram.sum(axis=(0, 1)), right.sum(axis=(0, 1))
    ridge = 1e-6 * np.eye(len(keep))
    for f in range(int(folds.max()) + 1):
        inside = folds == f
        g, b = gram[inside].sum(axis=0), right[inside].sum(axis=0)
        theta = np.linalg.solve(total_gram - g.sum(axis=0) + ridge, total_right - b.sum(axis=0))
        after += -2.0 * b @ theta + np.einsum("jcd,c,d->j", g, theta, theta)
    good = count > 0
    ratio = np.maximum(square[good] + after[good], 1e-9 * square[good]) / np.maximum(square[good], 1e-300)
    return float(np.sum(-0.5 * share[good] * count[good] * np.log(ratio)))

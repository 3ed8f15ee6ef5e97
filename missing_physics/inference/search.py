"""From the standard model to the hypotheses that predict best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.orders import spatial_peaks
from missing_physics.hypotheses.candidates import Candidate, candidates
from missing_physics.inference.problem import Fit, Hypothesis, Problem
from missing_physics.inference.screening import looks
from reference_model.effects.base import Extent

__all__ = ["Scored", "search", "score_blocks", "shares"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scored:
    fit: Fit
    score: float


def shares(problem: Problem, fit: Fit) -> Array:
    """Independent samples over samples of each joint, by the autocorrelation of what is left."""
    n = fit.sigma.size
    found = np.ones(n)
    for k in range(n):
        total, lags = 0.0, np.zeros(0)
        for i, run in enumerate(problem.runs):
            r = _left(problem, fit, i)[:, k]
            r = np.where(run.rows.counted[:, k], r, 0.0)
            if not r.any():
                continue
            size = 2 * r.size
            power = np.abs(np.fft.rfft(r, size)) ** 2
            auto = np.fft.irfft(power, size)[: r.size // 2]
            if lags.size < auto.size:
                lags = np.pad(lags, (0, auto.size - lags.size))
            lags[: auto.size] += auto
            total += auto[0]
        if total <= 0.0:
            continue
        rho = lags / total
        pairs = rho[1:-1:2] + rho[2::2] if rho.size > 2 else np.zeros(0)
        pairs = np.concatenate([[rho[0] + rho[1]], pairs]) if rho.size > 1 else np.ones(1)
        end = np.argmax(pairs <= 0.0) if np.any(pairs <= 0.0) else pairs.size  # Geyer 1992
        found[k] = 1.0 / max(2.0 * float(pairs[:end].sum()) - 1.0, 1.0)
    return found


def _left(problem: Problem, fit: Fit, i: int) -> Array:
    left = problem.every[i].rows.torque - problem.designs[i] @ fit.values
    for t in fit.hypothesis.terms:
        left = left - problem.columns(t)[i][:, :, 0]
    return np.nan_to_num(left)


def score_blocks(problem: Problem, fit: Fit, share: Array, *, unseen: bool = False) -> Array:
    """Log score of each block [nats], shape (B,): of folds, and with `unseen` of held-out recordings."""
    energy, count = fit.left, problem.counts[problem.seen]
    if unseen:
        energy = np.vstack([energy, fit.unseen])
        count = np.vstack([count, problem.counts[~problem.seen]])
    total = np.maximum(count.sum(axis=0), 1.0)
    variance = np.maximum(energy.sum(axis=0) / total, 1e-300)
    each = -0.5 * share * (count * np.log(variance) + energy / variance)
    return np.asarray(np.where(count.sum(axis=0) > 0, each, 0.0).sum(axis=1))


def search(
    problem: Problem,
    log: Callable[[str], None] = lambda _: None,
    *,
    most: int = 8,
    full: int = 8,
    cost: float = 4.0,
) -> tuple[list[Scored], Array]:
    """All hypotheses that were fitted, best first."""
    base = problem.fitted(Hypothesis())
    share = shares(problem, base)
    tried: dict[object, Scored] = {}

    def rated(fit: Fit) -> Scored:
        numbers = sum(len(t.free) for t in fit.hypothesis.terms)
        score = float(score_blocks(problem, fit, share, unseen=True).sum()) - cost * len(fit.hypothesis.terms)
        del numbers
        return Scored(fit, score)

    best = rated(base)
    tried[base.hypothesis.key()] = best
    channels = frozenset.intersection(*(r.channels for r in problem.every))
    for _ in range(most):
        extents = _extents(problem, best.fit)
        values = dict(zip(problem.standard.estimate.layout.names, best.fit.values))
        coulomb = {j: values[f"{j}.coulomb"] for j in extents}
        robot = problem.runs[0].model.robot
        options = list(candidates(robot, best.fit.hypothesis.terms, extents, channels, coulomb))
        ranked = [x for x in looks(problem, best.fit, options, share) if x.gain > 0.5 * cost][:full]
        made = []
        for look in ranked:
            new = problem.fitted(_with(best.fit.hypothesis, look.candidate), best.fit.values)
            scored = rated(new)
            tried[new.hypothesis.key()] = scored
            made.append(scored)
            t = new.hypothesis.terms[-1]
            log(
                f"   {t.key} promised {look.gain:.1f} made {scored.score - best.score + cost:.1f} "
                f"{ {p.name: float(f'{t.parameters[p.name]:.4g}') for p in t.free} } ± {new.deviation[-1]}"
            )
        top = max(made, key=lambda s: s.score, default=None)
        if top is None or top.score <= best.score:
            break
        best = top
        share = shares(problem, best.fit)
        tried = {k: rated(s.fit) for k, s in tried.items()}
        best = rated(best.fit)
        log(f"* {[t.key for t in best.fit.hypothesis.terms]} {best.score:.1f} share {share.round(2)}")
    return sorted(tried.values(), key=lambda s: -s.score), share


def _with(hypothesis: Hypothesis, option: Candidate) -> Hypothesis:
    kept = tuple(t for t in hypothesis.terms if t.key != option.instead)
    held = tuple(dict([*hypothesis.held, *option.held]).items())
    return Hypothesis((*kept, option.term), held)


def _extents(problem: Problem, fit: Fit) -> dict[str, Extent]:
    found = {}
    for k, joint in enumerate(problem.runs[0].model.joints):
        counted = [r.rows.counted[:, k] for r in problem.runs]
        if not any(c.any() for c in counted):
            continue
        q = np.concatenate([r.motion.position[r.motion.kept][:, k] for r in problem.runs])
        v = np.concatenate([r.motion.velocity[r.motion.kept][:, k] for r in problem.runs])
        left = np.concatenate([np.where(c, _left(problem, fit, i)[:, k], 0.0) for i, c in enumerate(counted)])
        torque = np.concatenate([r.needed[:, k] for r in problem.runs])
        speed = np.abs(v)
        moving = speed[speed > 0.01 * max(float(speed.max()), 1e-12)]
        run = problem.runs[0]
        actuator = run.model.robot.moving_joints[k].actuator
        found[joint] = Extent(
            position=(float(q.min()), float(q.max())),
            speed=float(speed.max()),
            slow=float(np.quantile(moving, 0.1)) if moving.size else 0.0,
            torque=float(np.sqrt(np.mean(torque**2))),
            peak_torque=float(np.abs(torque).max()),
            residual=float(np.sqrt(np.mean(left**2))),
            duration=float(sum(r.motion.time[-1] - r.motion.time[0] for r in problem.runs)),
            sample_time=1.0 / run.motion.rate,
            gear_ratio=actuator.gear_ratio if actuator else 1.0,
            orders=spatial_peaks(q, v, left, cutoff=run.motion.cutoff, count=2),
        )
    return found

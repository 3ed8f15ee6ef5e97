"""From the standard model to the hypotheses that predict best.

The best few are carried on: every effect at every place is looked at beside each of them, the most promising
ones are fitted, and the best of what was fitted go on to the next round. Then effects are taken away again,
one at a time, as long as that helps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Hypothesis, Place, Sight, candidates, extent_of, not_credible
from missing_physics.hypotheses.extents import EDGES
from missing_physics.inference.data import TIMING, Data
from missing_physics.inference.fit import Fit, fitted, residuals
from missing_physics.inference.score import block_scores, independent_shares
from missing_physics.inference.screening import Screen

__all__ = ["Search", "prior", "search"]

Array = NDArray[np.float64]

#: Prior odds against one more effect at one place [nats]: one in fifty, as there are some dozens of each.
ODDS = 4.0
#: Further odds against what happens once [nats]: it could have happened at any other time. One over the
#: number of stretches of time in which it is looked for.
EVENT = float(np.log(0.5 * EDGES**2))
#: Hypotheses that are carried on, candidates of each that are fitted, and effects at most.
CARRIED, FITTED, MOST = 2, 8, 12
#: A candidate is fitted where it promises this much of what it has to bring.
PROMISE = 0.5


@dataclass(frozen=True)
class Search:
    """What was fitted.

    Attributes:
        data: the rows.
        fits: all credible hypotheses that were fitted, best first.
        shares: independent samples over samples at each joint, of what the best one leaves.
    """

    data: Data
    fits: tuple[Fit, ...]
    shares: Array

    @property
    def best(self) -> Fit:
        """The most probable one."""
        return self.fits[0]

    def score(self, fit: Fit) -> float:
        """Log score of a fit with the prior of its effects [nats]."""
        return float(block_scores(self.data, fit, self.shares).sum()) + prior(fit.hypothesis)


def prior(hypothesis: Hypothesis) -> float:
    """Logarithm of the prior probability beside that of the standard model [nats]."""
    return -sum(ODDS + EVENT * (term.run is not None) for term in hypothesis.terms)


def search(data: Data, progress: Callable[[str], None] | None = None) -> Search:
    """Look for the effects that the recordings show beyond the standard model."""
    standard = fitted(data, Hypothesis())
    punctual = fitted(data, Hypothesis(held=((TIMING, 0.0),)))
    carried, shares = [standard, punctual], independent_shares(data, standard)
    made = {fit.hypothesis.key: fit for fit in carried}
    for _ in range(MOST):
        state = Search(data, tuple(made.values()), shares)
        before = max(map(state.score, carried))
        new = [fit for old in carried for fit in _grown(state, old, made, progress)]
        best = sorted([*carried, *new], key=state.score, reverse=True)[:CARRIED]
        if not new or state.score(best[0]) <= before:
            break
        carried, shares = best, independent_shares(data, best[0])
    state = Search(data, tuple(made.values()), shares)
    _pruned(state, max(made.values(), key=state.score), made)
    shares = independent_shares(data, max(made.values(), key=state.score))
    state = Search(data, tuple(made.values()), shares)
    return Search(data, tuple(sorted(made.values(), key=state.score, reverse=True)), shares)


def _grown(
    state: Search, old: Fit, made: dict[tuple[object, ...], Fit], progress: Callable[[str], None] | None
) -> list[Fit]:
    """Credible fits with one more effect that were not made before."""
    data, new = state.data, []
    channels = frozenset.intersection(*(run.channels for run in data.runs))
    places = _places(data, old)
    if not all(
        run.is_rigid_and_fixed for run in data.runs
    ):  # what an encoder's error costs is not linearised
        channels = frozenset(c for c in channels if c.endswith(".torque"))
    options = list(candidates(data.standard.nominal, old.hypothesis.terms, places, channels))
    for look in Screen(data, old, state.shares).best(options)[:FITTED]:
        hypothesis = look.candidate.added_to(old.hypothesis)
        if look.gain < PROMISE * ODDS or hypothesis.key in made:
            continue
        fit = _tried(data, hypothesis, old)
        if fit is None:
            continue
        made[fit.hypothesis.key] = fit
        new.append(fit)
        if progress:
            progress(f"{look.candidate.term.key}: {look.gain:.1f}, {state.score(fit) - state.score(old):.1f}")
    return new


def _tried(data: Data, hypothesis: Hypothesis, old: Fit) -> Fit | None:
    """The fit, where it has numbers that can be."""
    try:
        fit = fitted(data, hypothesis, old)
    except np.linalg.LinAlgError:
        return None
    joints = data.runs[0].model.joints
    for term in fit.hypothesis.terms:
        joint = term.at.split(".")[0]
        needed = 0.0
        if joint in joints:
            needed = max(float(np.abs(run.needed[:, joints.index(joint)]).max()) for run in data.runs)
        if not_credible(term, data.standard.nominal, needed):
            return None
    return fit if np.all(np.isfinite(fit.errors)) else None


def _pruned(state: Search, best: Fit, made: dict[tuple[object, ...], Fit]) -> Fit:
    """Less every effect without which the rest does as well."""
    while best.hypothesis.terms:
        fewer = []
        for term in best.hypothesis.terms:
            hypothesis = best.hypothesis.without(term)
            if hypothesis.key not in made:
                made[hypothesis.key] = fitted(state.data, hypothesis, best)
            fewer.append(made[hypothesis.key])
        top = max(fewer, key=state.score)
        if state.score(top) <= state.score(best):
            break
        best = top
    return best


def _places(data: Data, fit: Fit) -> dict[str, Place]:
    """Joints whose torque is compared, as candidates see them."""
    robot, found = data.standard.nominal, {}
    driven = {joint.name for joint in robot.moving_joints if joint.actuator is not None}
    for k, joint in enumerate(robot.moving_joints):
        if not any(run.rows.counted[:, k].any() for run in data.runs[: data.fitted]):
            continue
        sights = []
        for i, run in enumerate(data.runs[: data.fitted]):
            kept = run.motion.kept
            sights.append(
                Sight(
                    time=run.rows.time,
                    position=run.motion.position[kept][:, k],
                    velocity=run.motion.velocity[kept][:, k],
                    torque=run.needed[kept][:, k],
                    residual=residuals(data, fit, i)[:, k],
                    step=1.0 / run.motion.rate,
                    cutoff=run.motion.cutoff,
                    gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
                )
            )
        extents = tuple(extent_of(sight) for sight in sights)
        coulomb = fit.number(f"{joint.name}.coulomb")
        found[joint.name] = Place(extents, coulomb, not driven or joint.name in driven)
    return found

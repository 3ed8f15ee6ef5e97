"""Effects that act on the whole robot: links that bend although they are described as rigid, bases, walls.

A hidden mode has no regressors: it is simulated along the recorded joint motion
(`responses/hidden_modes.py`). Its period is looked for on a grid, at rough dampings, by the fall of the
residual; what fits best there is fitted in full and competes with everything else. Nothing but period,
damping and start is free: how much each joint must feel of the mode follows from the link's mass and place.
So it is asked at the end whether each joint feels as much as it must, which an absorber, an elastic gear or
another link's mode with the same frequency does not. Bases that give way are looked for in
`candidates/mounts.py`, walls in `candidates/walls.py`, and asked the same.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from missing_physics.diagnosis.candidates.mounts import giving_base
from missing_physics.diagnosis.candidates.walls import walls
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.least_squares.scanning import RIGID_ONLY, Scan
from missing_physics.diagnosis.location.residual import FLOOR_TOLERANCE
from missing_physics.diagnosis.statistics.correlated_errors import BlockedRegression
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import Effect
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.structure import StructureEffect
from robot_model import Robot

__all__ = ["LOOKED_ELSEWHERE", "LOOKED_FOR", "hidden", "looked_for", "misfelt", "no_modes", "searched"]

Array = NDArray[np.float64]

#: Whose search takes about a second.
COSTLY = frozenset({"base_motion"})
#: Ratio of neighbouring periods on the grid, and the dampings there.
RATIO = 1.03
DAMPINGS = (0.05, 0.015)
#: The mode's own frequency is below this part of the filter's cut-off,
HIGHEST = 0.8
#: and has so many periods in a recording.
FEWEST_PERIODS = 15.0
#: No resonance is damped by more.
MOST_DAMPED = 0.3
#: The simulated mode, scaled to fit, is between these times itself.
AMPLITUDES = (0.4, 1.6)
#: Evidence that the grid must promise.
PROMISING = 10.0
#: Odds that the search over the grid costs: about its number of periods.
LOOKED_ELSEWHERE = 150.0
#: A joint that feels the mode so much more or less than it must [-], beyond chance, says that it is another
#: one; the masses of a description are hardly wrong by more.
WRONG_SHARE = 0.3
CHANCE = 1e-3
#: A joint of whose share the data say less than this says nothing.
UNKNOWN_SHARE = 0.5


def hidden(effect: Effect) -> bool:
    """Whether an effect has modes that have to be simulated, from a start that no recording tells."""
    return isinstance(effect, StructureEffect)


def searched(effect: Effect) -> bool:
    """Whether an effect acts on the whole robot, so that `looked_for` has to find where it could be."""
    return isinstance(effect, (StructureEffect, ForceEffect))


def looked_for(
    problem: Problem, explanation: Explanation, effect: Effect, alike: Collection[str] | None = None
) -> Iterator[Term]:
    """The effect wherever a search promises something, while more than noise is left.

    Noise of the encoders is in the torques that the motion needs and shakes what is simulated along it: the
    fit of a mode to noise takes part of it away, with an evidence that says nothing.

    Args:
        alike: where given, only these are worth a costly search.
    """
    worth = alike is None or effect.id in alike or effect.id not in COSTLY
    if effect.id in LOOKED_FOR and worth and _beyond_noise(explanation):
        yield from LOOKED_FOR[effect.id](problem, explanation, effect)


def no_modes(robot: Robot) -> str:
    """Where alone links are looked for that bend; empty where this robot is such a one."""
    return RIGID_ONLY if robot.flexible_links or robot.spherical_joints else ""


def hidden_modes(problem: Problem, explanation: Explanation, effect: Effect) -> Iterator[Term]:
    """The effect at each place where a grid of periods promises something, from the best of the grid."""
    robot = problem.robot
    if no_modes(robot):
        return
    scan = Scan(explanation)
    for link in robot.links:
        if link.name in robot.known:
            continue
        modes = [segment.hidden.modes(effect.id, link.name) for segment in problem.segments]
        if any(m is None for m in modes):
            continue
        best: tuple[float, float, float] | None = None
        slowest = min(m.lowest for m in modes if m is not None)
        periods = _periods(problem, slowest)
        for damping in DAMPINGS:
            made = np.concatenate(
                [s.hidden.scan(effect.id, link.name, periods, damping) for s in problem.segments]
            )
            gain, amplitude = scan.of(made)
            gain[(amplitude < AMPLITUDES[0]) | (amplitude > AMPLITUDES[1])] = -np.inf
            top = int(np.argmax(gain))
            if best is None or gain[top] > best[0]:
                best = float(gain[top]), float(periods[top]), damping
        if best is None or best[0] < PROMISING:
            continue
        values = {**effect.defaults(), "period": best[1], "damping_ratio": best[2]}
        beside = tuple(p for segment in problem.segments for p in segment.hidden.starts(effect.id, link.name))
        yield Term(
            effect,
            link.name,
            {**values, **{p.name: 0.0 for p in beside}},
            beside=beside,
            narrowed={
                "period": (float(periods[0]), 1.2 * float(periods[-1])),
                "damping_ratio": (1e-4, MOST_DAMPED),
            },
        )


def _beyond_noise(explanation: Explanation) -> bool:
    """Whether some channel keeps more than sensor noise leaves, its estimate's error allowed for."""
    return bool(np.any(explanation.energies > FLOOR_TOLERANCE**2 * explanation.noise))


def _periods(problem: Problem, slowest: float) -> Array:
    """Periods of the link to try [s], from those of its mode; `slowest` is their ratio."""
    cutoff = min(segment.motion.low_pass.cutoff for segment in problem.segments)
    longest = min(float(s.time[-1] - s.time[0]) for s in problem.segments) / FEWEST_PERIODS
    count = max(1, int(np.log(longest * HIGHEST * cutoff) / np.log(RATIO)))
    return np.asarray(RATIO ** np.arange(count) / (HIGHEST * cutoff) / slowest)


def misfelt(trial: Explanation, term: Term) -> str:
    """Why what is in the residual is not the mode or force of `term`; empty where it may be.

    Each joint's share of what it adds is freed beside everything that is fitted; all must be 1.
    """
    problem, view = trial.problem, trial.view
    value = np.concatenate([segment.contribution(term).value for segment in problem.segments])
    joints = [k for k in range(len(problem.joints)) if problem.usable[k] and np.any(value[:, k])]
    shares = np.zeros((*value.shape, len(joints)))
    for column, k in enumerate(joints):
        shares[:, k, column] = value[:, k]
    place = trial.slice_of(term)
    kept = np.ones(trial.columns.shape[1], dtype=bool)
    modes = problem.segments[0].hidden.modes(*term.key) if hidden(term.effect) else None
    sizes = {p.name for p in term.effect.parameters if p.linear} | set(modes.sizes if modes else ())
    kept[place] = [p.name not in sizes for p in term.estimated]  # no size beside the shares
    fitted = np.concatenate([trial.nuisance, *(t.values for t in trial.terms)])
    target = trial.errors[:, 0] + trial.columns[:, kept] @ fitted[kept]
    columns = np.column_stack([view.flatten(problem, shares), trial.columns[:, kept]])
    prior = np.zeros(columns.shape[1])
    prior[len(joints) : len(joints) + trial.nuisance.size] = view.prior
    blocks = trial.blocks_of(fine=trial.is_brief(term))
    regression = BlockedRegression.of(columns, target, blocks, prior=prior)
    change = regression.solution()[: len(joints)]
    error = np.sqrt(np.maximum(np.diagonal(regression.covariance())[: len(joints)], 0.0))
    far = float(norm.isf(CHANCE / 2))
    known = error < UNKNOWN_SHARE
    if not known.any() or np.all(1.0 + change[known] < far * error[known]):
        return "no joint feels it for sure"
    for k, share, sigma in zip(joints, 1.0 + change, error):
        if sigma < UNKNOWN_SHARE and abs(share - 1.0) > max(WRONG_SHARE, far * sigma):
            return f"{problem.joints[k]} feels {share:.2f} times what it must of it"
    return ""


#: How the effects are looked for that act on the whole robot.
LOOKED_FOR: Mapping[str, Callable[[Problem, Explanation, Effect], Iterator[Term]]] = MappingProxyType(
    {"link_flexibility": hidden_modes, "contact": walls, "base_motion": giving_base}
)

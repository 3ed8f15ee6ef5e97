"""Whether the base gives way: periods of its displacement and its turn that promise something.

A base on springs answers what the arm needs of the ground, and what it moves shows at all joints. As long as
the mount is much heavier than the arm, displacement and turn are two oscillators, in proportion to one over
mass and moment of inertia: all pairs of periods are tried at once, and the best ones are then simulated as
they are. At least two joints must tell of it: what one alone feels of its base may be a link that bends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.least_squares.scanning import RIGID_ONLY, Scan
from missing_physics.diagnosis.statistics.blocks import block_columns
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import Effect
from robot_model import Robot

__all__ = ["FEWEST_TORQUES", "giving_base", "mount_of", "no_mount", "usual_mount"]

Array = NDArray[np.float64]

#: Joints whose torques must tell of the base.
FEWEST_TORQUES = 2
#: Ratio of neighbouring periods, and damping ratios tried.
RATIO = 1.06
DAMPINGS = (0.1, 0.04)
#: Frequencies are below this part of the filter's cut-off, and this part of a highest one at least.
HIGHEST = 0.9
WIDEST = 12.0
#: Pairs of periods that are simulated as they are.
SIMULATED = 4
#: The simulated motion, scaled to fit, is between these times itself.
AMPLITUDES = (0.4, 2.5)
#: Evidence that the best must promise.
PROMISING = 10.0
#: Frequencies [Hz] of displacement and turn that are tried beside them, since the two may be coupled, of a
#: mount that carries so much [kg, kg m^2].
FREQUENCIES = ((4.0, 7.0, 12.0), (5.0, 8.0, 13.0))
USUAL = (40.0, 5.0)
#: How many of the best are then fitted, in how many steps: periods have local minima.
STAGES = ((6, 8), (2, 30))
#: What mounts of robots are, in the order of the parameters.
NARROWED = {
    "compliance": (1e-8, 1e-1),
    "arm": (0.05, 5.0),
    "damping": (1e-5, 0.1),
    "mass": (0.1, 2000.0),
    "inertia": (0.01, 2000.0),
}
LIMITS = np.array(list(NARROWED.values())).T
#: Logarithm beyond all limits, whatever it is multiplied with: a longer step ends at the same limit.
FARTHEST = 60.0


def no_mount(robot: Robot) -> str:
    """Where alone a base is looked for that gives way; empty where this robot has such a one."""
    if robot.base.kind == "free":
        return "only where it is described as fixed"
    if len(robot.moving_joints) < FEWEST_TORQUES:
        return "only where two joints move"
    return RIGID_ONLY if robot.flexible_links else ""


def giving_base(problem: Problem, explanation: Explanation, effect: Effect) -> Iterator[Term]:
    """The effect at the base, if the best of the grid promises something."""
    robot = problem.robot
    if no_mount(robot) or np.count_nonzero(problem.usable) < FEWEST_TORQUES:
        return
    if any(segment.hidden.modes(effect.id, "base") is None for segment in problem.segments):
        return
    if any(term.key == (effect.id, "base") for term in explanation.terms):
        return
    scan = Scan(explanation)
    tried = []
    for trial in _mounts(problem, scan):
        torques, starts = _simulated(problem, trial)
        gain, (amplitude, *_) = scan.freed(starts).of(torques[:, :, :1])
        if amplitude > 0 and gain[0] > PROMISING:
            # at the same frequencies it moves in proportion to one over what it carries
            moved = trial * np.array([amplitude, 1.0, 1.0, 1.0 / amplitude, 1.0 / amplitude])
            tried.append((-float(gain[0]), np.clip(moved, *LIMITS)))
    if not tried:
        return
    tried.sort(key=lambda item: item[0])
    for count, steps in STAGES:
        tried = [_settled(problem, scan, trial, steps) for _, trial in tried[:count]]
        tried.sort(key=lambda item: item[0])
    best = tried[0][1]
    torques, starts = _simulated(problem, best)
    gain, (amplitude, *_) = scan.freed(starts).of(torques[:, :, :1])
    if gain[0] < PROMISING or not AMPLITUDES[0] < amplitude < AMPLITUDES[1]:
        return
    values = dict(zip(NARROWED, map(float, best)))
    beside = tuple(p for segment in problem.segments for p in segment.hidden.starts(effect.id, "base"))
    values |= {p.name: 0.0 for p in beside}
    yield Term(effect, "base", values, beside=beside, narrowed=NARROWED)


def usual_mount(problem: Problem) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """A stiff mount that carries what is usual, as values and bounds of the effect's parameters."""
    own = problem.segments[0].hidden.giving_base.mean_inertia()
    (*_, slow), (*_, fast) = FREQUENCIES
    values = _mount(own, 2 * np.pi * slow, 2 * np.pi * fast)
    return dict(zip(NARROWED, map(float, values))), dict(NARROWED)


def _mount(own: tuple[float, float], slow: float, fast: float) -> Array:
    """The usual mount at two frequencies [rad/s], of a robot of `own` mass and moment of inertia."""
    heavy, bulky = USUAL
    soft = 1.0 / ((heavy + own[0]) * slow**2)
    lever = fast * np.sqrt((bulky + own[1]) * soft)
    return np.clip([soft, lever, 2 * DAMPINGS[0] / slow, heavy, bulky], *LIMITS)


def _simulated(problem: Problem, values: Array) -> tuple[Array, Array]:
    """The torques of a mount, their derivatives by its numbers, (R, n, 6), and what starts add, (R, n, K)."""
    numbers = tuple(map(float, values))
    parts = [segment.hidden.giving_base.coarsely(*numbers) for segment in problem.segments]
    starts = block_columns(np.concatenate([own for _, own in parts]), problem.segment_of)
    return np.concatenate([made for made, _ in parts], axis=1).transpose(1, 2, 0), starts


def _settled(problem: Problem, scan: Scan, start: Array, steps: int) -> tuple[float, Array]:
    """The energy that is left, and the mount, from one start.

    Squares of both frequencies, what the mount carries and its damping count by their logarithms: a valley of
    stiffness and mass that keep a frequency is straight there.
    """
    own = np.array(problem.segments[0].hidden.giving_base.mean_inertia())
    low, _ = LIMITS

    def sizes_of(values: Array) -> Array:
        compliance, arm, damping = values[:3]
        mass, inertia = np.maximum(values[3:] + own, low[3:])
        stiff = 1.0 / compliance
        return np.log([stiff / mass, arm**2 * stiff / inertia, damping, mass, inertia])

    def at(sizes: Array) -> tuple[Array, Array]:
        values = mount_of(sizes, own)
        compliance, arm, damping, mass, inertia = values
        torques, starts = _simulated(problem, values)
        freed = scan.freed(starts)
        columns = freed.beside(torques)
        by = np.array(
            [
                [-compliance, -arm / 2, 0.0, 0.0, 0.0],
                [0.0, arm / 2, 0.0, 0.0, 0.0],
                [0.0, 0.0, damping, 0.0, 0.0],
                [-compliance, -arm / 2, 0.0, mass + own[0], 0.0],
                [0.0, arm / 2, 0.0, 0.0, inertia + own[1]],
            ]
        )
        return freed.errors - columns[:, 0], -columns[:, 1:] @ by.T

    kept: dict[bytes, tuple[Array, Array]] = {}

    def once(sizes: Array) -> tuple[Array, Array]:
        if sizes.tobytes() not in kept:
            kept.clear()
            kept[sizes.tobytes()] = at(sizes)
        return kept[sizes.tobytes()]

    found = least_squares(
        lambda x: once(x)[0],
        sizes_of(start),
        jac=lambda x: once(x)[1],
        max_nfev=steps,
        x_scale="jac",
        xtol=1e-4,
        ftol=1e-5,
    )
    return float(found.cost), mount_of(found.x, own)


def mount_of(sizes: Array, own: Array) -> Array:
    """The mount within its limits, of a robot of `own` mass and moment of inertia, shape (2,).

    Args:
        sizes: logarithms of both frequencies' squares, of the damping, and of what the mount carries with the
            robot, shape (5,).
    """
    slow, fast, damping, mass, inertia = np.exp(np.clip(sizes, -FARTHEST, FARTHEST))
    compliance = 1.0 / (slow * mass)
    values = [compliance, np.sqrt(fast * inertia * compliance), damping, mass - own[0], inertia - own[1]]
    return np.clip(values, *LIMITS)


def _joined(parts: Sequence[Array]) -> Array:
    """Scans of several recordings, (M, n, P, c) each, one after the other.

    A recording that begins at rest has no columns of its start; they are zero along it.
    """
    most = max(part.shape[3] for part in parts)
    return np.concatenate([np.pad(p, ((0, 0), (0, 0), (0, 0), (0, most - p.shape[3]))) for p in parts])


def _mounts(problem: Problem, scan: Scan) -> Iterator[Array]:
    """The mounts that oscillators of mass and inertia promise most for, in the order of `NARROWED`."""
    cutoff = min(segment.motion.low_pass.cutoff for segment in problem.segments)
    periods = RATIO ** np.arange(np.log(WIDEST) / np.log(RATIO)) / (HIGHEST * cutoff)
    own = problem.segments[0].hidden.giving_base.mean_inertia()
    found: list[tuple[float, Array]] = []
    for ratio in DAMPINGS:
        parts = [segment.hidden.base_scan(periods, ratio) for segment in problem.segments]
        one, other = (_joined(kind) for kind in zip(*parts))
        fall, lightness, turning = scan.pairs(one, other)
        fall = np.where((lightness > 0) & (turning > 0), fall, 0.0)
        for place in np.argsort(-fall, axis=None)[:SIMULATED]:
            i, j = np.unravel_index(place, fall.shape)
            if fall[i, j] <= 0:
                break
            mass, inertia = 1.0 / lightness[i, j], 1.0 / turning[i, j]
            slow, fast = 2 * np.pi / periods[i], 2 * np.pi / periods[j]
            compliance = 1.0 / (mass * slow**2)
            arm = np.sqrt(fast**2 * inertia * compliance)
            values = np.array([compliance, arm, 2 * ratio / slow, mass - own[0], inertia - own[1]])
            found.append((float(fall[i, j]), np.clip(values, *LIMITS)))
    found.sort(key=lambda item: -item[0])
    if not found or scan.promise(found[0][0]) < PROMISING:
        return
    yield from (values for _, values in found)
    for slow, fast in 2 * np.pi * np.array(list(product(*FREQUENCIES))):
        yield _mount(own, slow, fast)

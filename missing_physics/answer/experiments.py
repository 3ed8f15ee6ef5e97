"""Design of motions that distinguish explanations which the recordings cannot distinguish.

Two fitted hypotheses predict the torques along motions within the robot's limits, drawn at random and then
improved by small random changes. Only the part of their difference counts that the rival cannot imitate by
other parameters: with d the difference in units of the residual, X the derivatives of the rival's prediction
by its parameters and H the information of the recordings on these,

    min over c of 1/2 |d - X c|^2 + 1/2 c^T H c

is the expected evidence from a recording of the motion, in nats.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.answer.findings import keys_of
from missing_physics.inference import Fit, Posterior
from missing_physics.inference.fit import contributions
from missing_physics.inference.torques.data import TorqueData
from missing_physics.results.result import Experiment, Finding
from reference_model.effects.catalogue import get_effect
from robot_model import Joint, Recording

__all__ = ["separating"]

Array = NDArray[np.float64]

#: Sines of each joint, and their frequencies [Hz].
SINES = 4
FREQUENCIES = (0.05, 2.0)
#: Speed of the slowest motion drawn, as a fraction of the allowed speed.
SLOWEST = 0.05
#: Fraction of the allowed range and speed that a motion uses.
MARGIN = 0.9
#: Fractions of a motion's length in which it starts from and returns to rest.
RAMP = 0.15


#: Length of a motion [s].
LENGTH = 20.0
#: Number of motions drawn, number of variations of the best one tried at each spread, and the spreads.
DRAWN, TRIED, SPREADS = 12, 4, (0.5, 0.25)
#: Most pairs for which a motion is designed, in the order of the findings.
PAIRS = 3
#: Expected evidence that separates two explanations [nats]: odds of one in twenty.
ENOUGH = 3.0
#: Fraction of an actuator's largest torque that a motion may need.
MARGIN = 0.9


def separating(
    data: TorqueData, known: Posterior, findings: Sequence[Finding], *, seed: int
) -> tuple[tuple[Experiment, ...], dict[str, str]]:
    """An experiment for each indistinguishable pair, and the motions as CSV text by file name.

    Args:
        data: the rows.
        known: the hypotheses.
        findings: with the rivals that they are ambiguous with.
        seed: of the motions that are drawn.
    """
    pairs = list(_pairs(data, known, findings))
    if not pairs:
        return (), {}
    chance = np.random.default_rng(seed)
    designed = [pair for pair in pairs if pair.fits is not None][: 0 if data.bends else PAIRS]
    tried = _Motions.of(
        data, [MultiSines.drawn(len(data.joints), chance) for _ in range(DRAWN)] if designed else []
    )
    found, motions = [], dict[str, str]()
    for pair in pairs:
        if pair not in designed or pair.fits is None:
            found.append(_without_motion(pair))
            continue
        score, best = tried.best(data, *pair.fits)
        for spread in SPREADS:
            near = _Motions.of(data, [best.near(spread, chance) for _ in range(TRIED)])
            other, changed = near.best(data, *pair.fits)
            score, best = max((score, best), (other, changed), key=lambda one: one[0])
        name = f"experiment_{len(motions) + 1}.csv" if score >= ENOUGH else None
        if name is not None:
            time = np.arange(0.0, LENGTH, 1.0 / _rate(data))
            motions[name] = _as_csv(data.joints, time, best.positions(time, _limits(data)))
        found.append(_with_motion(pair, score, name))
    return tuple(found), motions


@dataclass(frozen=True, eq=False)
class _Pair:
    """A finding and a rival, with the best hypothesis that has only the one, and that has only the other."""

    effect: str
    rival: str
    fits: tuple[Fit, Fit] | None


def _pairs(data: TorqueData, known: Posterior, findings: Sequence[Finding]) -> Iterator[_Pair]:
    seen: set[frozenset[tuple[str, str]]] = set()
    for finding in findings:
        own = finding.effect, finding.location
        for label in finding.ambiguous_with:
            effect, _, place = label.partition("@")
            other = effect, place or finding.location
            if frozenset((own, other)) in seen:
                continue
            seen.add(frozenset((own, other)))
            one, two = (_best(data, known, *pair) for pair in ((own, other), (other, own)))
            yield _Pair(own[0], effect, None if one is None or two is None else (one, two))


def _best(data: TorqueData, known: Posterior, has: tuple[str, str], lacks: tuple[str, str]) -> Fit | None:
    """The most probable hypothesis that has one effect and lacks the other."""
    fits = (fit for fit in known.fits if has in keys_of(data, fit) and lacks not in keys_of(data, fit))
    return next(fits, None)


def _rate(data: TorqueData) -> float:
    """Sampling rate of a motion [Hz]: enough for the position filter."""
    motion = data.runs[0].motion
    return float(min(motion.sampling, 8.0 * motion.smoothing))


def _limits(data: TorqueData) -> Limits:
    motions = [run.motion for run in data.runs[: data.fitted]]
    position = np.concatenate([motion.position for motion in motions])
    velocity = np.concatenate([motion.velocity for motion in motions])
    return Limits.of(data.standard.nominal.moving_joints, position, velocity)


@dataclass(frozen=True, eq=False)
class _Motions:
    """Candidate motions, and the rows along them."""

    motions: tuple[MultiSines, ...]
    rows: TorqueData | None

    @classmethod
    def of(cls, data: TorqueData, motions: Sequence[MultiSines]) -> _Motions:
        if not motions:
            return cls((), None)
        time = np.arange(0.0, LENGTH, 1.0 / _rate(data))
        recordings = []
        for motion in motions:
            positions = motion.positions(time, _limits(data))
            channels = {f"{joint}.position": positions[:, k] for k, joint in enumerate(data.joints)}
            driven = {f"{joint}.torque": np.ones(time.size) for joint in data.joints}
            recordings.append(Recording(time, {**channels, **driven}, "a motion that was drawn"))
        return cls(tuple(motions), TorqueData.of(data.standard, recordings))

    def best(self, data: TorqueData, one: Fit, rival: Fit) -> tuple[float, MultiSines]:
        """The largest expected evidence for a fit against its rival [nats], and the motion with it."""
        scores = [self._evidence(data, number, one, rival) for number in range(len(self.motions))]
        top = int(np.argmax(scores))
        return scores[top], self.motions[top]

    def _evidence(self, data: TorqueData, number: int, one: Fit, rival: Fit) -> float:
        assert self.rows is not None
        rows = self.rows
        predicted = contributions(rows, one, number)
        drives = [drive.actuator for drive in data.standard.nominal.drives]
        limits = np.array(
            [drive.torque_limit if drive and drive.torque_limit else np.inf for drive in drives]
        )
        if np.any(np.abs(predicted) > MARGIN * limits):
            return 0.0
        size = np.hypot(rival.sigma, data.error)
        difference = (predicted - contributions(rows, rival, number)) / size
        columns = [rows.designs[number], *(rows.columns(t, number)[:, :, 1:] for t in rival.hypothesis.terms)]
        whole = np.concatenate(columns, axis=2)[:, :, rival.layout.free] / size[:, None]
        flat, aim = whole.reshape(-1, whole.shape[2]), difference.ravel()
        gram = flat.T @ flat + rival.hessian
        scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
        imitated = np.linalg.lstsq(gram * np.outer(scale, scale), scale * (flat.T @ aim), rcond=1e-12)[0]
        left = float(aim @ aim - (flat.T @ aim) @ (scale * imitated))
        return max(0.5 * left * data.independent, 0.0) if np.isfinite(left) else 0.0


def _without_motion(pair: _Pair) -> Experiment:
    ways = dict.fromkeys(get_effect(effect).experiment for effect in (pair.effect, pair.rival))
    why = "no motion was designed: joint torques alone do not separate them, or other pairs came first"
    return Experiment((pair.effect, pair.rival), "; or ".join(ways), why)


def _with_motion(pair: _Pair, score: float, name: str | None) -> Experiment:
    way, both = get_effect(pair.effect).experiment, (pair.effect, pair.rival)
    if name is None:
        do = f"{way}. No motion within the limits was found that separates them by joint torques alone"
        why = f"on the best of the motions that were tried the expected evidence is {score:.2g} nats"
        return Experiment(both, do, why)
    do = f"run the reference motion in {name} and diagnose again with both recordings; or {way}"
    why = f"along it the expected evidence for one against the other is {score:.3g} nats"
    return Experiment(both, do, why, name)


@dataclass(frozen=True)
class Limits:
    """Limits of the joints: start, range [rad or m] and speed [per s], shape (n,) each."""

    start: Array
    lower: Array
    upper: Array
    speed: Array

    @classmethod
    def of(cls, joints: Sequence[Joint], position: Array, velocity: Array) -> Limits:
        """Limits of the robot file, else the range of recorded positions and velocities, shape (N, n)."""
        ranges = [
            joint.position_limits or (float(position[:, k].min()), float(position[:, k].max()))
            for k, joint in enumerate(joints)
        ]
        speed = [
            joint.velocity_limit or float(np.abs(velocity[:, k]).max()) for k, joint in enumerate(joints)
        ]
        lower, upper = np.array(ranges).T
        start = np.array([joint.initial_position for joint in joints])
        return cls(np.clip(start, lower, upper), lower, upper, np.array(speed))


@dataclass(frozen=True)
class MultiSines:
    """Parameters of a motion of n joints; any values give a motion inside the limits.

    Attributes:
        slowness: logarithm of the fraction of the allowed speed that is used.
        frequencies: their logarithms, shape (n, SINES).
        weights: logarithms of the sines' relative amplitudes, shape (n, SINES).
        phases: [rad], shape (n, SINES).
    """

    slowness: float
    frequencies: Array
    weights: Array
    phases: Array

    @classmethod
    def drawn(cls, joints: int, chance: np.random.Generator) -> MultiSines:
        """A random motion of `joints` joints."""
        shape = (joints, SINES)
        low, high = np.log(FREQUENCIES)
        return cls(
            float(chance.uniform(np.log(SLOWEST), 0.0)),
            chance.uniform(low, high, shape),
            np.log(chance.dirichlet(np.ones(SINES), joints) + 1e-6),
            chance.uniform(0.0, 2 * np.pi, shape),
        )

    def near(self, spread: float, chance: np.random.Generator) -> MultiSines:
        """A motion whose parameters differ by about `spread`, in units of their scales."""
        shape = self.phases.shape
        low, high = np.log(FREQUENCIES)
        frequencies = self.frequencies + spread * chance.standard_normal(shape)
        return replace(
            self,
            slowness=float(np.clip(self.slowness + spread * chance.normal(), np.log(SLOWEST), 0.0)),
            frequencies=np.clip(frequencies, low, high),
            weights=self.weights + 2 * spread * chance.standard_normal(shape),
            phases=self.phases + np.pi * spread * chance.standard_normal(shape),
        )

    def positions(self, time: Array, limits: Limits) -> Array:
        """Joint positions, shape (N, n); `time` [s] rises from zero.

        Each joint leaves its start at rest, moves about the middle of its range and comes back.
        """
        whole = float(time[-1])
        ramp = _smooth(np.minimum(time, whole - time) / (RAMP * whole))
        columns = []
        for joint, start in enumerate(limits.start):
            angle = 2 * np.pi * np.outer(time, np.exp(self.frequencies[joint])) + self.phases[joint]
            weight = np.exp(self.weights[joint] - self.weights[joint].max())
            shape = np.sin(angle) @ (weight / weight.sum())
            shape -= 0.5 * (shape.max() + shape.min())
            lower, upper = limits.lower[joint], limits.upper[joint]
            shape *= 0.5 * MARGIN * (upper - lower) / max(float(np.abs(shape).max()), 1e-12)
            away = ramp * (0.5 * (lower + upper) - start + shape)
            fastest = float(np.abs(np.gradient(away, time)).max())
            allowed = MARGIN * np.exp(self.slowness) * limits.speed[joint]
            columns.append(start + away * min(1.0, allowed / max(fastest, 1e-12)))
        return np.column_stack(columns)


def _smooth(part: Array) -> Array:
    """Smooth step from 0 to 1 with zero first and second derivatives at both ends."""
    s = np.clip(part, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def _as_csv(joints: Sequence[str], time: Array, position: Array) -> str:
    """A motion as CSV text of references: `time` [s] and positions of these joints, shape (N, n)."""
    text = io.StringIO()
    header = ",".join(["time", *(f"{joint}.reference_position" for joint in joints)])
    columns = np.column_stack([time, position])
    np.savetxt(text, columns, fmt="%.9g", delimiter=",", header=header, comments="")
    return text.getvalue()

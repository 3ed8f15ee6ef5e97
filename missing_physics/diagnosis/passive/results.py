"""From what was found missing from base and flexible links to findings and errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.modal.smoother import VibrationSmoother
from missing_physics.diagnosis.naming.judge import AMBIGUOUS
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.diagnosis.passive.fit import PassiveFit, added, blind, smoother_of
from missing_physics.diagnosis.passive.naming import Named, PassiveSearch, search_passive
from missing_physics.diagnosis.passive.runs import named_in_runs
from missing_physics.diagnosis.passive.search import liquid_starts, plain_starts, run_rivals
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Alternative, ChannelFit, Errors, Estimate, Finding, Rung
from robot_model import Robot

__all__ = ["HELD_OUT", "PassiveResult", "diagnose_passive", "needed"]

Array = NDArray[np.float64]

#: What is named only with.
HELD_OUT = "a held-out recording (--validate)"
BY_CHANNELS = (
    "Found from all channels of base and links together; what acts at the joints does not move them."
)
BY_RUNS = "Found by runs in closed loop: with it alone the robot reproduces every recorded channel"
MOSTLY = ", as far as its links may bend otherwise than described"


@dataclass(frozen=True)
class PassiveResult:
    """What is missing from base and flexible links.

    Attributes:
        terms: held in everything that follows, as if the robot had them.
        walks: of the recordings with them.
        findings: the same with intervals and rivals.
        fit: errors of the further channels that tell of them.
        ladder: what was tried.
        gone: part of the energy of all held-out errors that goes with what runs told; 0 where they told none.
        whole: whether nothing but the sensors' noise is left with it.
    """

    terms: tuple[Term, ...] = ()
    walks: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    fit: dict[str, ChannelFit] | None = None
    ladder: tuple[Rung, ...] = ()
    gone: float = 0.0
    whole: bool = False

    def beside(self, segments: Sequence[Segment]) -> tuple[Segment, ...]:
        """The recordings with all that was found taken for known."""
        if not self.terms:
            return tuple(segments)
        if any(segment.vibration is None for segment in segments):
            return tuple(s.beside(added(s, self.terms)) for s in segments)
        walks = tuple({k: self.walks.get(k, v) for k, v in _walks(s).items()} for s in segments)
        smoothers = PassiveFit(tuple(segments), walks, self.terms).smoothers
        return tuple(s.beside(added(s, self.terms), m) for s, m in zip(segments, smoothers))


def needed(fitted: Sequence[Segment], held_out: Sequence[Segment]) -> tuple[str, ...]:
    """What has to be recorded beside this for a search by all channels; empty where nothing."""
    wanting = dict.fromkeys(blind(segment) for segment in (*fitted, *held_out))
    return (*([] if held_out else [HELD_OUT]), *filter(None, wanting))


def diagnose_passive(
    robot: Robot,
    fitted: Sequence[Segment],
    held_out: Sequence[Segment],
    basis: InertialBasis,
    progress: Progress,
    replay: Replay | None = None,
) -> PassiveResult:
    """Look for it by runs and, where strain gauges, tip or base sensors tell more than encoders do, by these.

    Args:
        robot: as described.
        fitted: recordings.
        held_out: those that only judge; nothing is named without.
        basis: combinations of inertial numbers that are free beside every candidate.
        progress: told what is tried.
        replay: runs along all recordings; None where that is not possible.
    """
    wanting = needed(fitted, held_out)
    if not held_out or (wanting and replay is None):
        return PassiveResult()
    described = PassiveFit(tuple(fitted), tuple(_walks(segment) for segment in fitted), ())
    ladder: list[Rung] = []
    plain: tuple[Term, ...] = ()
    if replay is not None:
        plain = tuple(plain_starts(robot))
        starts = chain(plain, liquid_starts(robot, described) if wanting else ())
        named, ladder = named_in_runs(replay, starts, progress, run_rivals(robot))
        if named is not None:
            return _of_run(robot, named, described, held_out, ladder)
    if wanting:
        return PassiveResult(ladder=tuple(ladder))
    directions = np.zeros((len(fitted[0].dynamics.model.inertial_names), basis.directions.shape[1]))
    directions[basis.columns] = basis.directions
    search = search_passive(robot, fitted, held_out, directions, progress)
    if search is None:
        return PassiveResult(ladder=tuple(ladder))
    ladder += search.ladder
    if replay is not None and not search.named:
        others = [term for key, term in search.tried.items() if key not in {t.key for t in plain}]
        named, rungs = named_in_runs(replay, others, progress)
        ladder += rungs
        if named is not None:
            return _of_run(robot, named, described, held_out, ladder)
    return _result(robot, search, ladder)


def _of_run(
    robot: Robot, named: Named, described: PassiveFit, held_out: Sequence[Segment], ladder: Sequence[Rung]
) -> PassiveResult:
    best = replace(described, terms=(named.term,))
    if all(segment.vibration is not None for segment in described.segments):
        best = best.rewalked()
    return _result(robot, PassiveSearch(described, best, tuple(held_out), [named]), ladder)


def _result(robot: Robot, search: PassiveSearch, ladder: Sequence[Rung]) -> PassiveResult:
    return PassiveResult(
        tuple(replace(item.term, nominal=True, frozen=True) for item in search.named),
        search.best.walks[0],
        tuple(_finding(robot, item) for item in search.named),
        dict(_errors(search)) if search.named else None,
        tuple(ladder),
        max([item.gain for item in search.named if item.by_runs], default=0.0),
        any(item.whole for item in search.named),
    )


def _finding(robot: Robot, item: Named) -> Finding:
    term = item.term
    logs = np.array([0.0, item.evidence, *(evidence for _, evidence in item.rivals)])
    odds = np.exp(np.clip(logs - logs.max(), -700, 0))
    odds = odds / odds.sum()
    rivals = sorted(zip((t for t, _ in item.rivals), odds[2:]), key=lambda pair: -pair[1])
    return Finding(
        effect=term.effect.id,
        location=term.at,
        probability=float(odds[1] * item.belief),
        parameters={
            p.name: Estimate(term.parameters[p.name], item.intervals[p.name], term.unit(robot, p))
            for p in term.estimated
        },
        ambiguous_with=tuple(t.label for t, chance in rivals if chance >= AMBIGUOUS),
        alternatives=tuple(
            Alternative(t.effect.id, t.at, float(chance), _why_not(float(chance))) for t, chance in rivals
        ),
        validation_improvement=item.gain,
        note=_told_by(item),
    )


def _told_by(item: Named) -> str:
    if not item.by_runs:
        return BY_CHANNELS
    return f"{BY_RUNS}{'' if item.whole else MOSTLY}."


def _why_not(chance: float) -> str:
    if chance >= AMBIGUOUS:
        return "cannot be told apart with these data"
    return "the channels of base and links are less likely with it"


def _errors(search: PassiveSearch) -> Iterator[tuple[str, ChannelFit]]:
    """Recorded less foretold of each further channel, about its offset, before and after."""
    groups = search.best.segments, search.held_out
    fits = [PassiveFit(tuple(g), tuple(dict(_walks(s)) for s in g), search.best.terms) for g in groups]
    smoother = smoother_of(search.best.segments[0])
    if smoother is None or smoother.sight is None:
        return
    for channel in smoother.sight.channels:
        before, after = [], []
        for fit in fits:
            pairs = [_gap(s, m, channel) for s, m in zip(fit.segments, fit.smoothers)]
            before.append(_rms([one for one, _ in pairs]))
            after.append(_rms([other for _, other in pairs]))
        noise = float(smoother.sight.noise[smoother.sight.channels.index(channel)])
        yield channel, ChannelFit(_unit(channel), Errors(*before), Errors(*after), noise)


def _walks(segment: Segment) -> dict[str, float]:
    return {} if segment.vibration is None else dict(segment.vibration.walks)


def _gap(segment: Segment, without: VibrationSmoother, channel: str) -> tuple[Array, Array]:
    described = smoother_of(segment)
    assert described is not None
    assert described.sight is not None
    if channel not in described.sight.channels:
        return np.zeros(0), np.zeros(0)
    k = described.sight.channels.index(channel)
    there = np.isfinite(described.sight.gap[:, k])
    joints = described.response.joints
    seen = without.data[1][:, joints + k, 0]
    return described.sight.gap[there, k], seen[there]


def _rms(parts: Sequence[Array]) -> float:
    squares = [np.mean((part - part.mean()) ** 2) for part in parts if part.size]
    return float(np.sqrt(np.mean(squares))) if squares else 0.0


def _unit(channel: str) -> str:
    kind = channel.split(".")[1]
    units = {"angular_velocity": "rad/s", "attitude": "rad", "strain": "-", "tip_deflection": "m"}
    return units.get(kind, "m/s^2" if kind.endswith("acceleration") else "rad")

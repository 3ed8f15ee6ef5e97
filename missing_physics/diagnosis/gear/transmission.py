"""Diagnosis of what lies between a motor's encoder and an encoder at the joint.

For every joint that has both, the gap ``position - motor_position`` is located, named and proven as torques
are: causes compete (see `gear/causes.py`), held-out data decide. What such data cannot determine is stated:
ten seconds of one motion seldom separate delay from viscous wind-up, or a gain error from an eccentric disc.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import stats

from missing_physics.diagnosis.dynamics.along import Along
from missing_physics.diagnosis.gear.causes import SEEN_CYCLE, Cause, causes_of
from missing_physics.diagnosis.gear.findings import channel_fit, findings_of_gap, rungs_of, series_of
from missing_physics.diagnosis.gear.fit import GapData, GapFit, fit_gap
from missing_physics.diagnosis.gear.gap import Gap, gaps_of, with_net_torque
from missing_physics.diagnosis.gear.refinement import with_exact_hysteresis
from missing_physics.diagnosis.gear.search import GapSearch, plausible_shapes, search_gap
from missing_physics.diagnosis.gear.unseen import contradicted, of_all_recordings
from missing_physics.diagnosis.statistics.correlated_errors import effective_samples
from missing_physics.results.result import ChannelFit, ChannelSeries, Finding, Mismatch, Rung
from missing_physics.wording.numbers import range_text
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from robot_model import Recording, Robot

__all__ = ["JointWork", "TransmissionResult", "diagnose_transmission", "listed_gears", "result_of"]

#: Residual above the noise floor by less than this factor may come from the noise's uncertainty.
FLOOR_TOLERANCE = 1.15
#: What remains is stated when it exceeds the noise floor by this factor.
ABOVE_NOISE = 1.2
#: A delay below so many times what viscous friction behind the gear makes look like one is not named.
BY_FRICTION = 1.1
#: A cause that was refused with at least this evidence is stated as a hint.
HINT = 3.0


@dataclass(frozen=True)
class TransmissionResult:
    """What the gaps of all joints with two encoders say.

    Attributes:
        mismatch: one for each joint whose gap exceeds the encoders' noise, channel `JOINT.position`; shares
            are parts of the whitened energy of all gaps.
        findings: named causes, in order of entry, joint by joint.
        fit: errors by channel `JOINT.position - JOINT.motor_position`; offsets between encoders are free.
        could_not_tell: sentences.
        ladder: every cause that was weighed.
        series: measured gap, no gap, explained gap.
    """

    mismatch: tuple[Mismatch, ...] = ()
    findings: tuple[Finding, ...] = ()
    fit: dict[str, ChannelFit] = field(default_factory=dict)
    could_not_tell: tuple[str, ...] = ()
    ladder: tuple[Rung, ...] = ()
    series: tuple[ChannelSeries, ...] = ()


@dataclass(frozen=True)
class JointWork:
    """What was fitted to the gap of one joint.

    Attributes:
        data: the gaps.
        causes: all shapes that were weighed.
        search: how the fit came about.
        fits: what is stated, and the same in other shapes that are not excluded.
        whole: see `gear/unseen.py`.
        prismatic: whether the joint slides.
    """

    data: GapData
    causes: tuple[Cause, ...]
    search: GapSearch
    fits: tuple[GapFit, ...]
    whole: GapData | None
    prismatic: bool

    @property
    def name(self) -> str:
        return self.data.gaps[0].joint

    @property
    def best(self) -> GapFit:
        return self.fits[0]

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What is named; not a delay that friction behind the gear may make."""
        found = findings_of_gap(self.data, self.fits, self.causes, self.whole)
        return tuple(f for f in found if f.effect != "sensor_delay" or not self._by_friction(f))

    def _by_friction(self, delay: Finding) -> bool:
        return delay.parameters["delay"].ci95[0] <= BY_FRICTION * self.late_by_friction

    @property
    def late_by_friction(self) -> float:
        """c/K: the delay that all viscous friction of the joint would look like behind its gear [s]."""
        spring = self.best.compliance
        return max(self.data.gaps[0].viscous, 0.0) * spring[1] if spring else 0.0


def diagnose_transmission(
    robot: Robot,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    along: Sequence[Along],
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> TransmissionResult | None:
    """Name what makes the two encoders of a joint differ.

    Args:
        robot: the nominal robot.
        recordings: what is fitted.
        validation: what is only scored; when empty, one stretch in four of each recording is held out.
        along: motion and dynamics of each recording, then of each of `validation`.
        seed: of the bootstrap.
        progress: called with a phrase whenever a joint is begun.

    Returns:
        None when no joint has both `JOINT.position` and `JOINT.motor_position` in all recordings.
    """
    tell = progress or (lambda phrase: None)
    everything = [*recordings, *validation]
    joints = gaps_of(along, everything)
    known = [name for name in joints if name in listed_gears(robot)]
    if not joints:
        return None
    works = []
    for name, gaps in joints.items():
        if name in known:
            continue
        tell(f"weighing what lies between motor and {name}")
        prismatic = robot.joint(name).kind == "prismatic"
        works.append(_work(gaps, len(recordings), prismatic=prismatic, seed=seed))
    return result_of(works, known)


def result_of(works: Sequence[JointWork], known: Sequence[str] = ()) -> TransmissionResult:
    """What the fits of all joints come to.

    Args:
        works: one for each joint.
    """
    energies = np.array([_whitened(work) for work in works])
    mismatch = [
        _mismatch(work, float(energy / max(energies.sum(), 1e-300))) for work, energy in zip(works, energies)
    ]
    return TransmissionResult(
        mismatch=tuple(sorted((m for m in mismatch if m.p_value < 0.05), key=lambda m: -m.share)),
        findings=tuple(f for w in works for f in w.findings),
        fit={_channel(w): channel_fit(w.search.start, w.best, prismatic=w.prismatic) for w in works},
        could_not_tell=(
            *(s for w in works for s in _open_questions(w)),
            *_common_delay(works),
            *_known(known),
        ),
        ladder=tuple(rung for w in works for rung in rungs_of(w.search)),
        series=tuple(s for w in works for s in series_of(w.search.start, w.best, prismatic=w.prismatic)),
    )


def listed_gears(robot: Robot) -> tuple[str, ...]:
    """Joints with effects in their gears in the robot file."""
    uses = [use for use in robot.effects if isinstance(get_effect(use.effect), GearEffect)]
    return tuple(dict.fromkeys(use.at for use in uses))


def _known(joints: Sequence[str]) -> Iterator[str]:
    for name in joints:
        yield (
            f"{name}: the robot file says what its gear does, and what lies between its encoders was not "
            "weighed again."
        )


def _work(gaps: Sequence[Gap], trained: int, *, prismatic: bool, seed: int) -> JointWork:
    gaps = with_net_torque(gaps, trained)
    data = GapData(gaps, trained)
    causes = causes_of(gaps, prismatic=prismatic)
    search = search_gap(data, causes, seed=seed)
    best = with_exact_hysteresis(data, search.best, causes)
    whole = of_all_recordings(data, best)
    if whole is not None:
        best, dropped = contradicted(data, whole, best, causes)
        search.dropped += dropped
    return JointWork(data, causes, search, plausible_shapes(data, best, causes), whole, prismatic)


def _channel(work: JointWork) -> str:
    return f"{work.name}.position - {work.name}.motor_position"


def _whitened(work: JointWork) -> float:
    residual = work.search.start.residual
    return float(np.mean(residual**2)) / work.data.noise_floor**2


def _mismatch(work: JointWork, share: float) -> Mismatch:
    residual = work.search.start.residual
    samples = effective_samples(residual)
    ratio = _whitened(work) / FLOOR_TOLERANCE**2
    rms = float(np.sqrt(np.mean(residual**2)))
    unit = "m" if work.prismatic else "rad"
    words = (
        f"{work.name}: its encoder and its motor's differ by {rms:.3g} {unit} rms about a constant, where "
        f"the encoders' noise makes {work.data.noise_floor:.2g} {unit}."
    )
    p_value = float(stats.chi2.sf(ratio * samples, samples))
    return Mismatch(work.name, f"{work.name}.position", share, p_value, words=words)


def _open_questions(work: JointWork) -> Iterator[str]:
    """What the data of one joint leave open."""
    best, data, unit = work.best, work.data, "m" if work.prismatic else "rad"
    found = {cause.effect for cause in best.causes}
    offset = float(data.target[data.fitted].mean())
    yield (
        f"{work.name}: the mean difference of the encoders, {offset:.3g} {unit}, was left free: a zero error "
        "and wind-up under a constant load look the same."
    )
    if "sensor_delay" in {finding.effect for finding in work.findings}:
        yield (
            f"{work.name}: wind-up by viscous friction behind the gear has the shape of a delay; friction c "
            "over stiffness K adds c/K to it."
        )
    elif "sensor_delay" in found:
        yield (
            f"{work.name}: no delay of its encoder is named; viscous friction behind a gear as compliant as "
            f"this one looks like a delay of {1e3 * work.late_by_friction:.2g} ms, which explains it."
        )
    if not found & {"joint_elasticity", "gear_hysteresis"}:
        yield from _compliance_range(work)
    for (effect, location), why in {cause.key: why for cause, why in work.search.dropped}.items():
        yield f"{effect} at {location} is not named: {why}."
    yield from _hints(work)
    if "encoder_eccentricity" not in found:
        yield from _unseen_turn(work)
    after = best.rms(data.scored)
    if after > ABOVE_NOISE * data.noise_floor and _real(work):
        yield (
            f"{_channel(work)}: {after:.3g} {unit} rms remain on held-out data against "
            f"{data.noise_floor:.2g} {unit} of encoder noise, and nothing that was tried explains it."
        )
    if work.whole is not None:
        yield (
            f"{work.name}: this fit does not predict the validation recordings, which seem to hold a motion "
            "that the fitted ones lack: fit them too, and keep others for validation."
        )


def _real(work: JointWork) -> bool:
    residual = work.best.residual[work.data.scored]
    samples = effective_samples(residual)
    ratio = float(np.mean(residual**2)) / (FLOOR_TOLERANCE * work.data.noise_floor) ** 2
    return bool(stats.chi2.sf(ratio * samples, samples) < 0.01)


def _compliance_range(work: JointWork) -> Iterator[str]:
    """What an elasticity that was not named would come to, by each torque, with and without a gain error."""
    kept = [cause for cause in work.best.causes if cause.effect != "sensor_gain"]
    gain = [cause for cause in work.causes if cause.effect == "sensor_gain"]
    limits = []
    for cause in work.causes:
        if cause.effect == "joint_elasticity" and len(cause.meanings) == 1:
            for beside in ([], gain):
                value, half = fit_gap(work.data, [*kept, *beside, cause]).values(cause)
                limits += [float(value[0] - half[0]), float(value[0] + half[0])]
    unit = "m/N" if work.prismatic else "rad/(N m)"
    found = range_text(min(limits), max(limits), unit, between=" and ")
    yield (
        f"{work.name}: no elasticity of the gear is named; if it is fitted anyway, its compliance lies "
        f"between {found}, depending on which torque is used and on whether a gain error is allowed."
    )


def _hints(work: JointWork) -> Iterator[str]:
    """Causes that stand against the final explanation with some, but not enough, evidence."""
    last = [cause.key for cause in work.search.best.causes]
    dropped = {cause.key for cause, _ in work.search.dropped} | set(last)
    whys = {}
    for cause, current, _, evidence, why in work.search.steps:
        final = [c.key for c in current.causes] == last
        if final and why and evidence > HINT and cause.key not in dropped:
            whys[cause.key] = why
    for (effect, location), why in whys.items():
        yield f"{work.name}: {effect} at {location} is indicated but not proven: {why}."


def _unseen_turn(work: JointWork) -> Iterator[str]:
    if work.prismatic:
        return
    travel = float(np.ptp(work.data.position))
    if travel < SEEN_CYCLE:
        yield (
            f"{work.name}: an eccentric disc of the joint's encoder cannot be seen in "
            f"{np.degrees(travel):.0f} degrees of a turn; it would look like a gain error or a slow curve "
            "over position."
        )


def _common_delay(works: Sequence[JointWork]) -> Iterator[str]:
    """The same delay at several joints speaks for the clock of the measurement, not for mechanics."""
    delays = []
    for work in works:
        for cause in work.best.causes:
            if cause.effect == "sensor_delay":
                value, half = work.best.values(cause)
                delays.append((work.name, float(value[0]), float(half[0])))
    if len(delays) < 2:
        return
    values = np.array([value for _, value, _ in delays])
    halves = np.maximum([half for *_, half in delays], 1e-12)
    mean = float(np.average(values, weights=halves**-2.0))
    if np.all(np.abs(values - mean) <= halves):
        pooled = float(1 / np.sqrt(np.sum(halves**-2.0)))
        names = ", ".join(name for name, *_ in delays)
        yield (
            f"{names} agree on one delay, {1e3 * mean:.3g} +- {1e3 * pooled:.2g} ms: that speaks for the "
            "timing of the measurement, since wind-up by friction differs from joint to joint."
        )

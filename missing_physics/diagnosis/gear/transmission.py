"""Diagnosis of the transmission between a motor's encoder and a joint's encoder.

The gap ``position - motor_position`` of every joint that has both is compared with hypotheses as torques are
(`missing_physics.inference`). What such data cannot determine is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.answer.answer import dismissed, rung
from missing_physics.answer.locate import BEYOND_NOISE, p_value_of
from missing_physics.diagnosis.further.errors import beyond_noise, errors_of, fits_of, series_of
from missing_physics.diagnosis.further.findings import findings_of
from missing_physics.diagnosis.further.merge import Further
from missing_physics.diagnosis.gear.candidates import COVERED_CYCLE
from missing_physics.diagnosis.gear.data import GapData
from missing_physics.diagnosis.gear.findings import channels_of, reading_of
from missing_physics.diagnosis.gear.laws import ELASTICITY, HYSTERESIS
from missing_physics.inference import Fit, search, weighed
from missing_physics.inference.fit import residuals
from missing_physics.motion.gap import gaps_of
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.results.comparison import AT_NOISE
from missing_physics.results.result import Finding, Mismatch
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from robot_model import Recording, Robot

__all__ = ["TransmissionResult", "diagnose_transmission", "listed_gears"]

Array = NDArray[np.float64]


class TransmissionResult(Further):
    """Diagnosis of the gaps of all joints with two encoders.

    Mismatches are of channels `JOINT.position`, errors of `JOINT.position - JOINT.motor_position`, whose
    offsets are free.
    """


def diagnose_transmission(
    robot: Robot,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    along: Sequence[MotionDynamics],
    progress: Callable[[str], None] | None = None,
) -> TransmissionResult | None:
    """Find the effects that make the two encoders of a joint differ.

    Args:
        robot: the nominal robot.
        recordings: those that are fitted.
        validation: those that are only predicted; if empty, a quarter of each recording is held out.
        along: motion and dynamics of each recording, then of each of `validation`.
        progress: called with a phrase whenever something new is tried.

    Returns:
        None when no joint has both `JOINT.position` and `JOINT.motor_position` in all recordings.
    """
    every = gaps_of(along, [*recordings, *validation], len(recordings))
    if not every:
        return None
    listed = listed_gears(robot)
    known = tuple(f"{gap.joint}: {KNOWN}" for gap in every[0] if gap.joint in listed)
    gaps = [tuple(gap for gap in own if gap.joint not in listed) for own in every]
    if not gaps[0]:
        return TransmissionResult(could_not_tell=known)
    if progress:
        progress("weighing hypotheses on the transmissions between motors and joints")
    found = search(GapData.of(robot, gaps, len(recordings)), progress)
    data, posterior = found.data, weighed(found)
    answer, findings = posterior.answer, findings_of(found, posterior, reading_of(data))
    before, after = ([residuals(data, fit, i) for i in range(len(gaps))] for fit in (found.standard, answer))
    channels = channels_of(data)
    return TransmissionResult(
        mismatch=tuple(_located(data, before)),
        findings=findings,
        fit=fits_of(data, channels, before, after),
        could_not_tell=(
            *(s for k in range(data.size.size) for s in _open_questions(data, answer, after, findings, k)),
            *_common_delay(findings),
            *dismissed(found, findings),
            *known,
        ),
        ladder=tuple(rung(found, step) for step in found.steps),
        series=series_of(data, channels, before, before, after, partial(_shown, data)),
    )


def _shown(data: GapData, run: int, k: int) -> dict[str, Any]:
    """Further fields of the series of one gap in one recording."""
    gap, motion = data.gaps[run][k], data.gaps[run][k].along.motion
    return {
        "recording": motion.source,
        "position": gap.position[motion.kept],
        "velocity": gap.velocity[motion.kept],
        "variable_units": (gap.unit, f"{gap.unit}/s"),
    }


def listed_gears(robot: Robot) -> tuple[str, ...]:
    """Joints with gear effects in the robot file."""
    uses = [use for use in robot.effects if isinstance(get_effect(use.effect), GearEffect)]
    return tuple(dict.fromkeys(use.at for use in uses))


KNOWN = "the robot file states effects of its gear, so the gap between its encoders was not diagnosed."


def _located(data: GapData, residual: Sequence[Array]) -> Iterator[Mismatch]:
    """The gaps that encoder noise does not explain, largest share first."""
    for k, rms, _, share, p_value in beyond_noise(data, residual[: data.fitted]):
        gap = data.gaps[0][k]
        words = (
            f"{gap.joint}: its encoder and its motor's differ by {rms:.3g} {gap.unit} rms about a constant, "
            f"where the encoders' noise makes {data.noise[k]:.2g} {gap.unit}."
        )
        yield Mismatch(gap.joint, f"{gap.joint}.position", share, p_value, words=words)


def _open_questions(
    data: GapData, answer: Fit, residual: Sequence[Array], findings: Sequence[Finding], k: int
) -> Iterator[str]:
    """Sentences on what the data of one joint cannot determine, given the residual of the answer."""
    gap, unit = data.gaps[0][k], data.gaps[0][k].unit
    joint, here = gap.joint, [term for term in answer.hypothesis.terms if term.at == gap.joint]
    stated = {f.effect for f in findings if f.location.split(".")[0] == joint}
    yield (
        f"{joint}: the mean difference of the encoders, {data.start[k]:.3g} {unit}, was left free: a zero "
        "error and wind-up under a constant load look the same."
    )
    spring = next((t for t in here if t.effect in (ELASTICITY, HYSTERESIS)), None)
    if "sensor_delay" in stated:
        yield (
            f"{joint}: wind-up by viscous friction behind the gear has the shape of a delay; friction c "
            "over stiffness K adds c/K to it."
        )
    elif spring is not None and gap.viscous > 0.0:
        late = 1e3 * gap.viscous / spring.parameters["stiffness"]
        yield (
            f"{joint}: no delay of its encoder is named; viscous friction behind a gear as compliant as "
            f"this one looks like a delay of up to {late:.2g} ms."
        )
    if spring is not None:
        yield (
            f"{joint}: the torque that winds its gear up is known as well as the robot file and the "
            f"recorded torque are; '{spring.along}' predicts the gap best."
        )
        if spring.effect is ELASTICITY and not stated & {"backlash", "gear_hysteresis"}:
            torques = [own[k].smooth[spring.along] for own in data.gaps[: data.fitted]]
            if not any(torque.min() < 0.0 < torque.max() for torque in torques):
                yield (
                    f"{joint}: the torque through its gear never changes its sign, so play between its "
                    "flanks would not show."
                )
    travel = max(float(np.ptp(own[k].position)) for own in data.gaps[: data.fitted])
    if not gap.is_prismatic and travel < 2.0 * np.pi * COVERED_CYCLE and "encoder_eccentricity" not in stated:
        yield (
            f"{joint}: an eccentric disc of the joint's encoder cannot be seen in "
            f"{np.degrees(travel):.0f} degrees of a turn; it would look like a gain error or a slow curve "
            "over position."
        )
    after, floor = errors_of(data, residual, k), float(np.hypot(data.noise[k], data.error[k]))
    held_out = np.concatenate([own[~data.fitted_rows(i), k] for i, own in enumerate(residual)])
    if after.validation_rms > AT_NOISE * floor and p_value_of(held_out, floor) < BEYOND_NOISE:
        yield (
            f"{channels_of(data)[k].name}: {after.validation_rms:.3g} {unit} rms remain on held-out data "
            f"against {data.noise[k]:.2g} {unit} of encoder noise, and nothing that was tried explains it."
        )


def _common_delay(findings: Sequence[Finding]) -> Iterator[str]:
    """A sentence if several joints have the same delay, which indicates the clock, not mechanics."""
    delays = [f for f in findings if f.effect == "sensor_delay" and f.location.endswith(".position")]
    if len(delays) < 2:
        return
    values = np.array([f.parameters["delay"].value for f in delays])
    halves = np.maximum([np.ptp(f.parameters["delay"].ci95) / 2 for f in delays], 1e-12)
    mean = float(np.average(values, weights=halves**-2.0))
    if np.all(np.abs(values - mean) <= halves):
        pooled = float(1 / np.sqrt(np.sum(halves**-2.0)))
        names = ", ".join(f.location.split(".")[0] for f in delays)
        yield (
            f"{names} agree on one delay, {1e3 * mean:.3g} +- {1e3 * pooled:.2g} ms: that indicates the "
            "timing of the measurement, since wind-up by friction differs from joint to joint."
        )

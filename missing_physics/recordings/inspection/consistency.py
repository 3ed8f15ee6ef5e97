"""Channels of one recording that contradict each other: exchanged joints, sides of a gear, gravity.

Units and signs of single pairs are in `units`, other faults of velocities in `velocities`, the
conventions of an attitude in `attitude`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from missing_physics.recordings.channels.estimates import HALF_WIDTHS, SIGMA_PER_MAD, interpolation_residual
from missing_physics.recordings.channels.names import place_of
from missing_physics.recordings.inspection.attitude import attitude_findings
from missing_physics.recordings.inspection.findings import Finding
from missing_physics.recordings.inspection.units import position_per_velocity, unit_findings
from missing_physics.recordings.inspection.velocities import velocity_findings
from missing_physics.recordings.maps.corrections import Correction, in_words
from missing_physics.recordings.maps.mapping import Mapping
from robot_model import InputError, Recording, Robot

__all__ = ["consistency_findings", "require_consistent", "sentence_of"]

#: General hint at a map in a sentence, dropped if the specific correction follows.
_GENERAL = re.compile(r" \(scale = [^)]*\)")
#: Quantities that move with a position.
_PARTNERS = ("velocity", "reference_position", "motor_position")
#: Minimum correlation, and maximum |log ratio|, of two channels that agree.
SAME, ONE = 0.98, 0.03
#: Two channels differ if their ratio deviates from 1 by more, or their correlation is smaller.
OTHER, UNLIKE = 0.1, 0.9
#: A ratio of motor to joint position that no sensor gain explains.
MOST_GAIN = 10.0
#: Standard gravity [m/s^2]; tolerance of a length to it, and of the length's variation.
GRAVITY, NEAR, STEADY = 9.80665, 0.03, 0.05
#: A position is noisy compared with a reference if its noise is this many times larger.
NOISIER = 100.0


def consistency_findings(recording: Recording, *, robot: Robot | None = None) -> tuple[Finding, ...]:
    """All contradictions between channels: units, signs, joints, sides of a gear, frames, lag.

    Args:
        recording: as read.
        robot: if given, its gear ratios and its joints' limits are used.
    """
    exchanged = [*_exchanged(recording)]
    pairs = [*unit_findings(recording, robot=robot), *_gears(recording, robot)]
    pairs += _references(recording)
    # Where two joints are exchanged, comparisons of their channels mean nothing.
    wrong = set(_untrue(recording, exchanged))
    found = [*exchanged, *(finding for finding in pairs if finding.channel not in wrong)]
    # Nor does a comparison of a velocity that is known to be wrong, or whose position is.
    wrong |= {finding.channel for finding in found if finding.severity == "error"}
    if "time" not in wrong:
        rates = velocity_findings(recording, robot=robot)
        found += [f for f in rates if not wrong & {f.channel, f.channel.replace("velocity", "position")}]
    return (*found, *attitude_findings(recording), *_gravity(recording))


def _untrue(recording: Recording, exchanged: Sequence[Finding]) -> Iterator[str]:
    """Exchanged channels, and those that are compared with an exchanged position."""
    for correction in (correction for finding in exchanged for correction in finding.corrections):
        place, quantity = correction.channel.split(".")
        yield correction.channel
        if quantity == "position":
            yield from (name for name in recording if place_of(name) == place)


def require_consistent(
    recording: Recording, *, robot: Robot | None = None, mapping: Mapping | None = None
) -> None:
    """Raises `InputError` with the first error among `consistency_findings` and its correction in a map."""
    for finding in consistency_findings(recording, robot=robot):
        if finding.severity == "error":
            raise InputError(f"{recording.source or 'the recording'}: {sentence_of(finding, mapping)}")


def sentence_of(finding: Finding, mapping: Mapping | None = None) -> str:
    """The sentence of a finding, with its correction as in a map file."""
    if not finding.corrections:
        return finding.sentence
    sentence = _GENERAL.sub("", finding.sentence).rstrip(".")
    return f"{sentence}; in the map file: {in_words(finding.corrections, mapping)}."


def _places(recording: Recording, *quantities: str) -> list[str]:
    places = dict.fromkeys(place_of(name) for name in recording)
    return [p for p in places if p != "base" and all(f"{p}.{q}" in recording for q in quantities)]


def _relation(recording: Recording, position: str, other: str) -> tuple[float, float]:
    """Ratio and correlation of a position to a velocity, or of two positions."""
    if other.endswith("velocity"):
        return position_per_velocity(recording.time, recording[position], recording[other])
    a, b = recording[position], recording[other]
    good = np.isfinite(a) & np.isfinite(b)
    every = max(1, good.sum() // 400)  # changes over a stretch, so that they exceed noise
    x, y = np.diff(b[good][::every]), np.diff(a[good][::every])
    xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
    if xx <= 0 or yy <= 0:
        return math.nan, math.nan
    return xy / xx, xy / (math.sqrt(xx) * math.sqrt(yy))


def _exchanged(recording: Recording) -> Iterator[Finding]:
    """Findings of channels of two joints under each other's names."""
    for one, other in combinations(_places(recording, "position"), 2):
        asked = [q for q in _PARTNERS if all(f"{p}.{q}" in recording for p in (one, other))]
        wrong = [q for q in asked if _crossed(recording, (one, other), q)]
        if len(wrong) > 1 and wrong == asked:
            yield _exchange(one, other, "position", wrong[0])
        else:
            yield from (_exchange(one, other, quantity, "position") for quantity in wrong)


def _crossed(recording: Recording, names: tuple[str, str], quantity: str) -> bool:
    """Whether each joint's position agrees with the other's `quantity` and not with its own."""
    own = [_relation(recording, f"{p}.position", f"{p}.{quantity}") for p in names]
    cross = [_relation(recording, f"{p}.position", f"{q}.{quantity}") for p, q in (names, names[::-1])]
    return all(_same(*pair) for pair in cross) and all(_differ(*pair) for pair in own)


def _exchange(one: str, other: str, quantity: str, partner: str) -> Finding:
    return Finding(
        "error",
        "exchanged",
        f"{one}.{quantity}",
        f"{one}.{quantity} goes with {other}.{partner}, and {other}.{quantity} with {one}.{partner}: "
        f"{quantity.replace('_', ' ')}s of the two joints are exchanged.",
        {},
        (
            Correction(f"{one}.{quantity}", source=f"{other}.{quantity}"),
            Correction(f"{other}.{quantity}", source=f"{one}.{quantity}"),
        ),
    )


def _same(ratio: float, alike: float) -> bool:
    return alike > SAME and abs(math.log(abs(ratio))) < ONE


def _differ(ratio: float, alike: float) -> bool:
    return abs(alike) < UNLIKE or ratio <= 0 or abs(math.log(ratio)) > OTHER


def _gears(recording: Recording, robot: Robot | None) -> Iterator[Finding]:
    """Findings of a motor's position that counts turns of the motor, or has the wrong sign."""
    ratios = (
        {joint.name: joint.actuator.gear_ratio for joint in robot.joints if joint.actuator} if robot else {}
    )
    for place in _places(recording, "position", "motor_position"):
        channel = f"{place}.motor_position"
        ratio, alike = _relation(recording, f"{place}.position", channel)
        if not abs(alike) > SAME:
            continue
        gear = ratios.get(place, 1.0)
        scale, sign = 1.0 / abs(ratio), math.copysign(1.0, ratio)
        if gear > 1.0 and abs(math.log(scale / gear)) < OTHER:
            words = f"is the motor's own angle, {scale:.4g} times the joint's; divide it by the gear's ratio"
            yield _motor(channel, words, sign / gear)
        elif gear > 1.0 and abs(math.log(scale * gear)) < OTHER:
            yield _motor(channel, "is divided by the gear's ratio twice", sign * gear)
        elif abs(math.log(scale)) > math.log(MOST_GAIN) and not _degrees(scale):
            words = f"is {scale:.4g} times {place}.position; it is expected on the joint's side of the gear"
            yield _motor(channel, words, sign / scale)


def _degrees(scale: float) -> bool:
    """Whether the check of units covers this ratio."""
    return abs(abs(math.log(scale)) - math.log(180.0 / math.pi)) < OTHER


def _motor(channel: str, words: str, scale: float) -> Finding:
    return Finding(
        "error", "gear_ratio", channel, f"{channel} {words}.", {}, (Correction(channel, scale=scale),)
    )


def _references(recording: Recording) -> Iterator[Finding]:
    """Findings of a reference that equals the measurement."""
    for place in _places(recording, "position", "reference_position"):
        position, reference = f"{place}.position", f"{place}.reference_position"
        _, alike = _relation(recording, position, reference)
        if not alike > SAME:
            continue
        noise = [_noise(recording, name) for name in (position, reference)]
        if noise[1] > NOISIER * noise[0] and noise[1] > 1e-9 * float(np.nanstd(recording[reference])):
            yield Finding(
                "warning",
                "exchanged",
                reference,
                f"{reference} is noisy ({noise[1]:.2g}) and {position} is not ({noise[0]:.2g}): they seem "
                "to be exchanged.",
                {"reference_noise": noise[1], "position_noise": noise[0]},
                (Correction(position, source=reference), Correction(reference, source=position)),
            )


def _noise(recording: Recording, channel: str) -> float:
    """White noise estimated from the values, ignoring any stated noise; the smallest of all estimates."""
    values = recording[channel]
    good = np.isfinite(values)
    residuals = (
        interpolation_residual(recording.time[good], values[good], half_width=k) for k in HALF_WIDTHS
    )
    return min((SIGMA_PER_MAD * float(np.median(np.abs(r))) for r in residuals if r.size), default=math.nan)


def _gravity(recording: Recording) -> Iterator[Finding]:
    """Findings of an accelerometer's reading instead of the acceleration, in m/s^2 or in units of gravity."""
    for channels in _accelerations(recording):
        length = np.linalg.norm(np.column_stack([recording[c] for c in channels]), axis=1)
        usual = float(np.nanmedian(length))
        if usual <= 0 or float(np.nanstd(length)) > STEADY * usual:
            continue
        name = channels[0].rsplit(".", 1)[0]
        for unit, words, scale in ((GRAVITY, "", 1.0), (1.0, ", in units of g", GRAVITY)):
            if abs(usual / unit - 1.0) < NEAR:
                yield Finding(
                    "warning",
                    "gravity",
                    channels[0],
                    f"{name} has the length {usual:.4g} throughout: it holds gravity, as an accelerometer "
                    f"reads it{words}, where the acceleration alone is expected in m/s^2; take gravity out "
                    "before it is read.",
                    {"length": usual},
                    tuple(Correction(c, scale=scale) for c in channels) if scale != 1.0 else (),
                )
    yield from _in_g(recording)


def _in_g(recording: Recording) -> Iterator[Finding]:
    """The base's acceleration in units of g, from its velocity."""
    for axis in "xyz":
        velocity, channel = f"base.linear_velocity.{axis}", f"base.linear_acceleration.{axis}"
        if velocity in recording and channel in recording:
            ratio, alike = position_per_velocity(recording.time, recording[velocity], recording[channel])
            if alike > SAME and abs(math.log(ratio / GRAVITY)) < NEAR:
                yield Finding(
                    "warning",
                    "g_units",
                    channel,
                    f"{channel} is in units of g: the change of {velocity} is {ratio:.4g} times its "
                    "integral.",
                    {"ratio": ratio},
                    (Correction(channel, scale=GRAVITY),),
                )


def _accelerations(recording: Recording) -> Iterator[Sequence[str]]:
    stems = dict.fromkeys(name.rsplit(".", 1)[0] for name in recording if "_acceleration." in name)
    for stem in stems:
        channels = [f"{stem}.{axis}" for axis in "xyz"]
        if all(channel in recording for channel in channels):
            yield channels

"""Wrong units, inferred from contradictions between channels or from values that no robot has."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.names import place_of, quantity_of
from missing_physics.recordings.inspection.findings import Finding
from missing_physics.recordings.inspection.shares import percent
from missing_physics.recordings.maps.corrections import Correction
from robot_model import Recording, Robot

__all__ = ["position_per_velocity", "unit_findings"]

Array = NDArray[np.float64]

DEGREES = 180.0 / math.pi
RPM = 60.0 / (2.0 * math.pi)

#: Two channels are compared only where they agree up to a factor.
ALIKE = 0.95
#: Largest difference of a ratio from a known factor, as a natural logarithm.
NEAR = 0.06
#: A ratio this far from 1 (as a natural logarithm) is reported even if no unit explains it.
ODD = 0.2
#: Windows over which position changes are compared with integrated velocity.
WINDOWS = 200
#: Number of stretches over which two positions are compared, so that motion exceeds noise.
STRETCHES = 400
#: Factors between two positions beyond these follow from the gear between them.
GAINS = (0.1, 10.0)
#: A step of more than this many usual steps is a gap.
GAP = 2.5
#: Below the first rate dynamics cannot be identified, below the second hardly; no robot is sampled above the
#: third [Hz].
HOPELESS_RATE, SLOW_RATE, ABSURD_RATE = 2.0, 20.0, 200e3
#: Lowest working temperature of a robot [K].
COLDEST = 100.0
#: Fraction of the samples that are not outliers.
SURELY = 0.999
#: Two turns; few joints move further [rad].
TWO_TURNS = 4.0 * math.pi

_RATE_PAIRS = (
    ("position", "velocity"),
    ("motor_position", "motor_velocity"),
    ("reference_position", "reference_velocity"),
)
_SAME = (("position", "reference_position"), ("position", "motor_position"), ("velocity", "motor_velocity"))


def unit_findings(recording: Recording, *, robot: Robot | None = None) -> tuple[Finding, ...]:
    """Findings of wrong units; with `robot`, also by its joints' limits."""
    found = list(_pairs(recording))
    # A wrong unit of time affects every pair; one finding explains them all.
    found = [f for f in found if f.kind == "time_unit"][:1] or found
    if not any(f.kind == "time_unit" for f in found):
        found = [*_rate(recording), *found]
    return (*found, *_same_quantity(recording), *_values(recording, robot))


def position_per_velocity(time: Array, position: Array, velocity: Array) -> tuple[float, float]:
    """Change of position per integrated velocity, and the correlation of the two.

    Returns:
        The ratio (1 where the units agree) and the correlation of the changes over `WINDOWS` windows.
        Both NaN when nothing moves.
    """
    good = np.isfinite(position) & np.isfinite(velocity)
    if good.sum() < 10:
        return math.nan, math.nan
    t, q, v = time[good], position[good], velocity[good]
    dt = np.diff(t)
    # The motion within a gap is unknown.
    seen = dt < GAP * np.median(dt)
    way = np.concatenate([[0.0], np.cumsum(seen * 0.5 * (v[1:] + v[:-1]) * dt)])
    change = np.concatenate([[0.0], np.cumsum(seen * np.diff(q))])
    edges = np.unique(np.linspace(0, t.size - 1, WINDOWS + 1).astype(int))
    return _ratio(np.diff(way[edges]), np.diff(change[edges]))


def _ratio(x: Array, y: Array) -> tuple[float, float]:
    """Slope of y on x through the origin, and the cosine between them."""
    xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
    if xx <= 0 or yy <= 0:
        return math.nan, math.nan
    return xy / xx, xy / (math.sqrt(xx) * math.sqrt(yy))


def _is(ratio: float, factor: float) -> bool:
    return abs(math.log(abs(ratio) / factor)) < NEAR


def _pairs(recording: Recording) -> Iterator[Finding]:
    for place in dict.fromkeys(place_of(name) for name in recording):
        for quantity, rate in _RATE_PAIRS:
            position, velocity = f"{place}.{quantity}", f"{place}.{rate}"
            if position in recording and velocity in recording:
                ratio, alike = position_per_velocity(recording.time, recording[position], recording[velocity])
                if abs(alike) > ALIKE:
                    yield from _explained(recording, position, velocity, ratio)


def _explained(recording: Recording, position: str, velocity: str, ratio: float) -> Iterator[Finding]:
    numbers = {"ratio": ratio}
    slow = recording.sample_rate < SLOW_RATE

    def error(kind: str, channel: str, sentence: str, scale: float) -> Finding:
        return Finding("error", kind, channel, sentence, numbers, (Correction(channel, scale=scale),))

    if ratio < 0:
        yield error(
            "sign",
            velocity,
            f"{velocity} has the opposite sign of the change of {position}; reverse one of them "
            "(scale = -1 in a mapping file).",
            -1.0,
        )
    elif slow and (_is(ratio, 1e-3) or _is(ratio, 1e-6)):
        unit, scale = ("milliseconds", "0.001") if _is(ratio, 1e-3) else ("microseconds", "0.000001")
        yield error(
            "time_unit",
            "time",
            f"time is in {unit}, since {velocity} integrated over it is {1 / ratio:.4g} times the change of "
            f"{position}; give seconds (scale = {scale} in [time] of a mapping file).",
            float(scale),
        )
    elif _is(ratio, DEGREES):
        yield error(
            "degrees",
            position,
            f"{position} is in degrees while {velocity} is in rad/s (the change of the one is "
            f"{ratio:.4g} times the integral of the other); give radians (scale = "
            f"{1 / DEGREES:.7g} in a mapping file).",
            1 / DEGREES,
        )
    elif _is(ratio, 1 / DEGREES):
        yield error(
            "degrees",
            velocity,
            f"{velocity} is in degrees per second while {position} is in rad (its integral is "
            f"{1 / ratio:.4g} times the change of the other); give rad/s (scale = "
            f"{1 / DEGREES:.7g} in a mapping file).",
            1 / DEGREES,
        )
    elif _is(ratio, 1 / RPM):
        yield error(
            "rpm",
            velocity,
            f"{velocity} is in turns per minute; give rad/s (scale = {1 / RPM:.7g} in a mapping file).",
            1 / RPM,
        )
    elif _is(ratio, 1e3) or _is(ratio, 1e-3):
        which = position if ratio > 1 else velocity
        yield error(
            "thousand",
            which,
            f"{which} is 1000 times too large against {velocity if ratio > 1 else position}, as millimetres "
            "are; give SI units (scale = 0.001 in a mapping file).",
            1e-3,
        )
    elif velocity.endswith("reference_velocity") and abs(math.log(ratio)) > ODD:
        yield Finding(
            "warning",
            "velocity_scale",
            velocity,
            f"the change of {position} is {ratio:.3g} times the integral of {velocity}; one of "
            "them is scaled "
            "wrongly, filtered or taken on another side of a gear.",
            numbers,
        )


def _same_quantity(recording: Recording) -> Iterator[Finding]:
    for place in dict.fromkeys(place_of(name) for name in recording):
        for one, other in _SAME:
            first, second = f"{place}.{one}", f"{place}.{other}"
            if first not in recording or second not in recording:
                continue
            a, b = recording[first], recording[second]
            good = np.isfinite(a) & np.isfinite(b)
            every = max(10, good.sum() // STRETCHES)
            ratio, alike = _ratio(np.diff(b[good][::every]), np.diff(a[good][::every]))
            if abs(alike) < ALIKE or math.isnan(alike):
                continue
            if _is(ratio, DEGREES) or _is(ratio, 1 / DEGREES):
                which = first if ratio > 1 else second
                yield Finding(
                    "error",
                    "degrees",
                    which,
                    f"{which} is in degrees while {second if ratio > 1 else first} is in radians; "
                    "give radians "
                    f"(scale = {1 / DEGREES:.7g} in a mapping file).",
                    {"ratio": ratio},
                    (Correction(which, scale=1 / DEGREES),),
                )
            elif _is(ratio, 1e3) or _is(ratio, 1e-3):
                which, small = (first, second) if ratio > 1 else (second, first)
                yield Finding(
                    "error",
                    "thousand",
                    which,
                    f"{which} is 1000 times too large against {small}, as millimetres are; give SI units "
                    "(scale = 0.001 in a mapping file).",
                    {"ratio": ratio},
                    (Correction(which, scale=1e-3),),
                )
            elif ratio < 0 and GAINS[0] < -ratio < GAINS[1]:
                yield Finding(
                    "error",
                    "sign",
                    second,
                    f"{second} runs against {first}; reverse one of them (scale = -1 in a mapping file).",
                    {"ratio": ratio},
                    (Correction(second, scale=-1.0),),
                )


def _rate(recording: Recording) -> Iterator[Finding]:
    rate = recording.sample_rate
    numbers = {"sample_rate_hz": rate, "duration_s": recording.duration}
    seen = f"time advances by {1 / rate:.4g} per sample, which as seconds is {rate:.3g} Hz"
    if rate < HOPELESS_RATE:
        unit, scale = ("microseconds", "0.000001") if rate < 0.02 else ("milliseconds", "0.001")
        yield Finding(
            "error",
            "time_unit",
            "time",
            f"{seen}; if it is in {unit}, give scale = {scale} in [time] of a mapping file, else "
            "record faster.",
            numbers,
        )
    elif rate < SLOW_RATE:
        yield Finding("warning", "slow", "time", f"{seen}: friction and flexibility are faster.", numbers)
    elif rate > ABSURD_RATE:
        yield Finding(
            "error",
            "time_unit",
            "time",
            f"{seen}, which no robot's recorder reaches; give time in seconds (scale in [time] of "
            "a mapping file).",
            numbers,
        )


def _values(recording: Recording, robot: Robot | None) -> Iterator[Finding]:
    joints = {joint.name: joint for joint in robot.joints} if robot else {}
    for name, values in recording.channels.items():
        quantity, joint = quantity_of(name), joints.get(place_of(name))
        if quantity == "temperature" and np.nanmax(values) < COLDEST:
            yield Finding(
                "error",
                "celsius",
                name,
                f"{name} reaches {np.nanmax(values):.4g} K at most, so it is in degrees Celsius; add 273.15 "
                "(offset in a mapping file).",
                {"largest": float(np.nanmax(values))},
            )
        if quantity in ("position", "motor_position", "reference_position") and place_of(name) != "base":
            prismatic = joint is not None and joint.kind == "prismatic"
            limits = joint.position_limits if joint is not None else None
            yield from () if prismatic else _turns(recording, name, limits, known=robot is not None)
        if quantity == "torque" and joint is not None and joint.actuator is not None:
            yield from _beyond(name, values, joint.actuator.torque_limit)


def _turns(
    recording: Recording, name: str, limits: tuple[float, float] | None, *, known: bool
) -> Iterator[Finding]:
    """Findings of positions beyond the range of joints; with a robot the torques are better evidence."""
    values = recording[name]
    span = float(np.nanmax(values) - np.nanmin(values))
    numbers = {"range": span}
    scale = f"scale = {1 / DEGREES:.7g} in a mapping file"
    if limits is not None and span > 2.0 * (limits[1] - limits[0]):
        allowed = limits[1] - limits[0]
        yield Finding(
            "error",
            "degrees",
            name,
            f"{name} spans {span:.4g} rad while the joint's limits allow {allowed:.4g} rad; if it "
            "is in degrees, "
            f"give radians ({scale}).",
            numbers | {"allowed": allowed},
        )
    elif span > TWO_TURNS and limits is None:
        yield from _many_turns(recording, name, span, known=known)
    jumps = np.abs(np.diff(values))
    wraps = int(np.sum((jumps > 1.9 * math.pi) & (jumps < 2.1 * math.pi)))
    if wraps and span < 2.1 * math.pi:
        yield Finding(
            "error",
            "wrap",
            name,
            f"{name} jumps by a full turn {wraps} times; unwrap it before it is read.",
            {"jumps": wraps},
        )


def _many_turns(recording: Recording, name: str, span: float, *, known: bool) -> Iterator[Finding]:
    """Finding of a position in degrees, or of a joint that turns without limit."""
    seen, numbers = f"{name} spans {span:.4g} rad, {span / (2 * math.pi):.1f} turns", {"range": span}
    velocity = _agreeing(recording, name)
    if velocity and not known:
        words = f"{seen}, and {velocity} agrees with it: both are in radians, or both in degrees."
        yield Finding("note", "degrees", name, words, numbers)
    elif not velocity:
        advice = f"{seen}; if it is in degrees, give radians (scale = {1 / DEGREES:.7g} in a mapping file)."
        yield Finding("note" if known else "warning", "degrees", name, advice, numbers)


def _agreeing(recording: Recording, position: str) -> str:
    """The velocity that is the derivative of a position, in the same unit; empty if there is none."""
    place, quantity = place_of(position), quantity_of(position)
    velocity = f"{place}.{dict(_RATE_PAIRS).get(quantity, '')}"
    if velocity not in recording:
        return ""
    ratio, alike = position_per_velocity(recording.time, recording[position], recording[velocity])
    return velocity if alike > ALIKE and _is(ratio, 1.0) else ""


def _beyond(name: str, values: Array, limit: float | None) -> Iterator[Finding]:
    """Findings of torques beyond the actuator's limit in the robot file."""
    if limit is None:
        return
    size = np.abs(values[np.isfinite(values)])
    largest = float(size.max(initial=0.0))
    if np.quantile(size, SURELY) > limit * math.exp(ODD):  # not only a few outliers
        yield Finding(
            "warning",
            "torque_limit",
            name,
            f"{name} reaches {largest:.4g}, {largest / limit:.2g} times the torque_limit of {limit:.4g} in "
            f"the robot file, and is beyond that in {percent(float(np.mean(size > limit)))} of the samples: "
            "its unit or its side of the gear is another, or the limit is.",
            {"largest": largest, "limit": limit},
        )

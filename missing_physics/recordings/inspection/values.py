"""Missing, frozen, saturated and coarse samples and outliers of single channels."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.estimates import interpolation_residual, noise_of, resolution_of
from missing_physics.recordings.channels.names import listed, place_of, quantity_of
from missing_physics.recordings.inspection.excitation import Excitation, excitation
from missing_physics.recordings.inspection.findings import Finding, Severity
from robot_model import Recording

__all__ = ["longest_run", "value_findings"]

Array = NDArray[np.float64]

#: Fewer levels than this in a channel's whole range cause a warning.
FEW_LEVELS = 50
#: Most channels with the same fault that are named; the rest are counted.
SHOWN = 4
#: Quantities that are differentiated.
POSITIONS = ("position", "motor_position")
#: Efforts that reach a limit stay there: fewest consecutive samples of a plateau, and smallest fraction of
#: all samples in plateaus.
PLATEAU, PLATEAU_SHARE = 5, 0.002
#: Quantities that may saturate; a position that rests at its extreme is not a fault.
EFFORTS = ("torque", "current", "voltage")
#: An outlier deviates from its neighbours by at least this many standard deviations of the noise.
STRAY = 30.0
#: And by at least this fraction of the channel's range.
STRAY_RANGE = 0.01
#: Above this fraction of the samples, deviations are motion rather than outliers.
MOST_STRAYS = 0.002
#: Quantities that a diagnosis needs at every instant.
CORE = (*EFFORTS, "position", "motor_position", "reference_position")
#: A channel that changes at every second sample or less often is held in between.
HELD = 1.5


def value_findings(recording: Recording, moves: Sequence[Excitation] | None = None) -> tuple[Finding, ...]:
    """Problems of single channels.

    Args:
        recording: the recording to check.
        moves: its `excitation`, if already known.
    """
    found: list[Finding] = []
    for name, values in recording.channels.items():
        found += _missing(recording.time, name, values)
        good = values[np.isfinite(values)]
        if good.size and np.ptp(good) == 0:
            found.append(_constant(name, float(good[0])))
            continue
        resolution = resolution_of(recording, name)
        found += [*_saturated(name, values, resolution), *_held(recording, name, values, resolution)]
        found += _strays(recording, name, values)
    return (*found, *_steps(recording, excitation(recording) if moves is None else moves))


def longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Length and first index of the longest run of True; (0, 0) when there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    starts, lengths = edges[::2], edges[1::2] - edges[::2]
    if not lengths.size:
        return 0, 0
    longest = int(np.argmax(lengths))
    return int(lengths[longest]), int(starts[longest])


def _missing(time: Array, name: str, values: Array) -> Iterator[Finding]:
    absent = np.isnan(values)
    count = int(absent.sum())
    if count:
        run, start = longest_run(absent)
        every = float(np.median(np.diff(np.flatnonzero(~absent)))) if values.size - count > 1 else 1.0
        if every > HELD and run < 2 * every:
            yield Finding(
                "note",
                "slower",
                name,
                f"{name} has a number at every {every:.0f}th sample, and is "
                f"{'interpolated between' if quantity_of(name) in CORE else 'used at'} these.",
                {"every": every},
            )
            return
        yield Finding(
            "warning",
            "missing",
            name,
            f"{name} has no number in {count} of {values.size} samples, the longest stretch {run} samples "
            f"from {time[start]:.6g} s.",
            {"count": count, "longest_run": run, "at_s": float(time[start])},
        )


def _constant(name: str, value: float) -> Finding:
    reference = quantity_of(name).startswith("reference")
    return Finding(
        "note" if reference else "warning",
        "dead",
        name,
        f"{name} is {value:.6g} throughout"
        + ("." if reference else "; the sensor is dead, not connected, or nothing happened there."),
        {"value": value},
    )


def _saturated(name: str, values: Array, resolution: float) -> Iterator[Finding]:
    """Findings of plateaus at the largest or smallest value."""
    if quantity_of(name) not in EFFORTS:
        return
    top = float(np.nanmax(np.abs(values)))
    for word, extreme in (("largest", np.nanmax(values)), ("smallest", np.nanmin(values))):
        at = np.abs(values - extreme) <= 1e-9 * abs(extreme)
        run, share = longest_run(at)[0], float(at.mean())
        # A coarse channel stays on every level for a while, but longest at a limit.
        elsewhere = longest_run((np.diff(values) == 0) & ~at[1:])[0] + 1 if resolution else 1
        if abs(extreme) > 0.5 * top and run >= max(PLATEAU, 2 * elsewhere) and share > PLATEAU_SHARE:
            yield Finding(
                "warning",
                "saturation",
                name,
                f"{name} stays at its {word} value, {extreme:.4g}, in {100 * share:.1f} % of the samples "
                f"({run} on end): it is limited there.",
                {"value": float(extreme), "share": share, "longest_run": run},
            )


def _steps(recording: Recording, moves: Sequence[Excitation]) -> Iterator[Finding]:
    """Findings of channels that are too coarse for their range, or whose steps exceed their noise."""
    still = {move.place for move in moves if not move.moves or move.trembles}
    coarse, fine = [], []
    for name, values in recording.channels.items():
        step = resolution_of(recording, name)
        if not step or quantity_of(name) == "temperature":
            continue
        levels = float(np.nanmax(values) - np.nanmin(values)) / step
        rests = place_of(name) in still and quantity_of(name) in POSITIONS
        if levels < FEW_LEVELS and not rests:
            coarse.append((name, step, levels))
        elif noise_of(recording, name) < step and not rests:
            fine.append((name, step, levels))
    yield from _grouped(recording, coarse, "warning", f"channels come in fewer than {FEW_LEVELS} steps")
    yield from _grouped(recording, fine, "note", "channels have steps larger than their noise")


def _grouped(
    recording: Recording, steps: Sequence[tuple[str, float, float]], severity: Severity, words: str
) -> Iterator[Finding]:
    """One finding for all channels (name, step, number of steps) with the same fault."""
    if not steps:
        return
    name, step, levels = steps[0]
    if len(steps) > 1:
        cells = [f"{name} ({step:.4g}, {levels:.0f} in its range)" for name, step, levels in steps[:SHOWN]]
        rest = [f"{len(steps) - SHOWN} more"] if len(steps) > SHOWN else []
        sentence = f"{len(steps)} {words}: {listed([*cells, *rest])}."
    else:
        speed = f"{step * recording.sample_rate:.3g} per second"
        extra = f"; a difference of two samples resolves {speed}" if quantity_of(name) in POSITIONS else ""
        sentence = f"{name} comes in steps of {step:.4g}, {levels:.0f} in its range{extra}."
    numbers = {"step": step, "levels": levels, "channels": float(len(steps))}
    yield Finding(severity, "quantisation", name, sentence, numbers)


def _held(recording: Recording, name: str, values: Array, resolution: float) -> Iterator[Finding]:
    """Findings of channels updated more slowly than written: they repeat values, then jump by many steps."""
    jumps = np.diff(values)
    changes = np.flatnonzero(np.isfinite(jumps) & (jumps != 0))
    if changes.size < 10 or quantity_of(name) == "temperature":
        return
    every = float(np.median(np.diff(changes)))
    jump = float(np.median(np.abs(jumps[changes])))
    if every > HELD and jump > 3 * resolution:
        yield Finding(
            "warning",
            "held",
            name,
            f"{name} changes only at every {every:.0f}th sample, "
            f"{recording.sample_rate / every:.4g} times per "
            "second; between them it is held.",
            {"samples": every},
        )


def _strays(recording: Recording, name: str, values: Array) -> Iterator[Finding]:
    noise = noise_of(recording, name)
    if not math.isfinite(noise) or noise <= 0 or quantity_of(name).startswith("reference"):
        return
    # Both differences to the neighbours must be large and of opposite sign: a step has only one.
    jumps = np.diff(values)
    lone = np.minimum(np.abs(jumps[:-1]), np.abs(jumps[1:]))
    far = max(STRAY * noise, STRAY_RANGE * float(np.nanmax(values) - np.nanmin(values)))
    outside = (lone > far) & (jumps[:-1] * jumps[1:] < 0)
    residual = interpolation_residual(recording.time, values, half_width=1)
    stray = np.flatnonzero(outside & (np.abs(residual) > STRAY * noise))
    if stray.size and stray.size <= max(1, MOST_STRAYS * values.size):
        at = float(recording.time[stray[0] + 1])
        yield Finding(
            "warning",
            "stray",
            name,
            f"{name} has {stray.size} stray sample{'s' if stray.size > 1 else ''} far from the "
            "neighbours, the "
            f"first at {at:.6g} s.",
            {"count": float(stray.size), "at_s": at},
        )

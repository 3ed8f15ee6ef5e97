"""From weighed hypotheses on gaps to findings, errors and series."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.answer.adequacy import adequacies
from missing_physics.answer.findings import QUANTILE, RIVAL, STATED
from missing_physics.diagnosis.gear.data import GapData
from missing_physics.diagnosis.gear.laws import keys_of, numbers_of
from missing_physics.inference import Fit, Posterior, Search
from missing_physics.inference.fit import residuals
from missing_physics.results.result import Alternative, ChannelFit, ChannelSeries, Errors, Estimate, Finding

__all__ = ["channel_fits", "channel_of", "findings_of", "rms_of", "series_of"]

Array = NDArray[np.float64]
Key = tuple[str, str]


def channel_of(joint: str) -> str:
    """Name of a gap."""
    return f"{joint}.position - {joint}.motor_position"


def findings_of(found: Search[GapData], known: Posterior) -> tuple[Finding, ...]:
    """What the most probable hypothesis states, joint by joint, with its rivals in the others."""
    data, fit = found.data, known.answer
    right = adequacies(data, fit)
    made = []
    for key in sorted(keys_of(fit.hypothesis.terms), key=lambda key: (_channel(data, key), key)):
        chance, rivals = _chance(known, key), _rivals(known, fit, key)
        if chance > STATED or (chance >= RIVAL and rivals):
            made.append(_finding(found, known, key, chance, rivals))
    return tuple(replace(f, probability=right(f.location) * min(f.probability, 1.0)) for f in made)


def _channel(data: GapData, key: Key) -> int:
    """Number of the gap in which an effect shows."""
    place = key[1].split(".")[0]
    return next(k for k, gap in enumerate(data.gaps[0]) if place in (gap.joint, gap.link))


def _chance(known: Posterior, key: Key) -> float:
    """Probability of all hypotheses that state an effect."""
    held = [key in keys_of(fit.hypothesis.terms) for fit in known.fits]
    return float(known.weights[held].sum())


def _rivals(known: Posterior, fit: Fit, key: Key) -> list[tuple[Key, float]]:
    """Effects that hypotheses without one state instead, with their probabilities."""
    own, found = keys_of(fit.hypothesis.terms), dict[Key, float]()
    for other, weight in zip(known.fits, known.weights):
        theirs = keys_of(other.hypothesis.terms)
        if key not in theirs:
            alone = len(own - theirs) == 1  # nothing else differs: all that is added are rivals
            for rival in theirs - own:
                if alone or rival[1].split(".")[0] == key[1].split(".")[0]:
                    found[rival] = found.get(rival, 0.0) + float(weight)
    return sorted(((rival, p) for rival, p in found.items() if p >= RIVAL), key=lambda one: -one[1])


def _finding(
    found: Search[GapData], known: Posterior, key: Key, chance: float, rivals: list[tuple[Key, float]]
) -> Finding:
    return Finding(
        effect=key[0],
        location=key[1],
        probability=chance,
        parameters=_parameters(found.data, known, key),
        ambiguous_with=tuple(f"{effect}@{at}" for (effect, at), _ in rivals),
        alternatives=tuple(
            Alternative(*rival, p, "it predicts held-out data less well") for rival, p in rivals
        ),
        validation_improvement=_gain(found, known.answer, key),
    )


def _parameters(data: GapData, known: Posterior, key: Key) -> dict[str, Estimate]:
    """Values of the most probable hypothesis; intervals cover those of others with the same effects.

    These differ in the signals that drive the effects: estimates of the torque through the gear.
    """
    answer, found = known.answer, dict[str, Estimate]()
    same = keys_of(answer.hypothesis.terms)
    prismatic = data.gaps[0][_channel(data, key)].is_prismatic
    for fit, weight in zip(known.fits, known.weights):
        if fit is not answer and (weight < RIVAL or keys_of(fit.hypothesis.terms) != same):
            continue
        for name, (term, p) in numbers_of(key, fit.hypothesis.terms).items():
            value, half = term.parameters[name], 0.0
            if p in term.free:
                half = QUANTILE * fit.deviation(f"{term.effect.id}@{term.at}.{name}")
            low, high = max(value - half, p.lower), min(value + half, p.upper)
            unit = p.unit.replace("N m", "N").replace("rad", "m") if prismatic else p.unit
            before = found.get(name)
            if before is not None:
                low, high = min(low, before.ci95[0]), max(high, before.ci95[1])
            if before is None or fit is answer:
                found[name] = Estimate(value, (low, high), unit)
            else:
                found[name] = replace(before, ci95=(low, high))
    return found


def _gain(found: Search[GapData], fit: Fit, key: Key) -> float:
    """Part of the held-out error that an effect removes, compared with the same hypothesis without it."""
    data, k = found.data, _channel(found.data, key)
    less = keys_of(fit.hypothesis.terms) - {key}
    others = [one for one in found.made.values() if keys_of(one.hypothesis.terms) == less]
    if not others:
        return 0.0
    without = max(others, key=found.gain)
    before, after = (np.sqrt(one.errors[~data.seen, k].sum()) for one in (without, fit))
    return float(1.0 - after / before) if before > 0.0 else 0.0


def rms_of(data: GapData, fit: Fit, k: int) -> Errors:
    """Error of a fit in one gap [rad or m]."""
    left = [residuals(data, fit, i)[:, k] for i in range(len(data.gaps))]
    seen = [data.rows_seen(i) for i in range(len(data.gaps))]
    every, chosen = np.concatenate(left), np.concatenate(seen)
    return Errors(float(np.sqrt(np.mean(every[chosen] ** 2))), float(np.sqrt(np.mean(every[~chosen] ** 2))))


def channel_fits(data: GapData, standard: Fit, answer: Fit) -> Iterator[tuple[str, ChannelFit]]:
    """Errors about the encoders' zeros, joint by joint."""
    for k, gap in enumerate(data.gaps[0]):
        before, after = rms_of(data, standard, k), rms_of(data, answer, k)
        unit = "m" if gap.is_prismatic else "rad"
        yield channel_of(gap.joint), ChannelFit(unit, before, after, float(data.noise[k]))


def series_of(data: GapData, standard: Fit, answer: Fit) -> Iterator[ChannelSeries]:
    """The gap of each recording about its zero, what no effect and what the answer makes of it."""
    for k, first in enumerate(data.gaps[0]):
        unit = "m" if first.is_prismatic else "rad"
        for i, gaps in enumerate(data.gaps):
            gap, along = gaps[k], gaps[k].along
            measured = residuals(data, standard, i)[:, k]
            yield ChannelSeries(
                recording=along.motion.source,
                role="train" if i < data.fitted else "validation",
                channel=channel_of(gap.joint),
                unit=unit,
                location=gap.joint,
                time=data.time(i),
                measured=measured,
                nominal=np.zeros_like(measured),
                augmented=measured - residuals(data, answer, i)[:, k],
                held_out=~data.rows_seen(i),
                noise_floor=float(data.noise[k]),
                position=along.position[:, gap.index],
                velocity=along.velocity[:, gap.index],
                variable_units=(unit, f"{unit}/s"),
            )

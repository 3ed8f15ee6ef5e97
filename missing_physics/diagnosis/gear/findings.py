"""From a fitted gap to findings, rungs, errors and series."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from missing_physics.diagnosis.gear.causes import Cause, Meaning
from missing_physics.diagnosis.gear.fit import GapData, GapFit, fit_gap
from missing_physics.diagnosis.gear.play import lost_motion_beside
from missing_physics.diagnosis.gear.search import GapSearch
from missing_physics.results.result import (
    Alternative,
    ChannelFit,
    ChannelSeries,
    Errors,
    Estimate,
    Finding,
    Rung,
)

__all__ = ["channel_fit", "findings_of_gap", "rungs_of", "series_of"]

#: A rival at least this probable is stated as ambiguous.
AMBIGUOUS = 0.05
#: What filtering a torque does to the travel of a hysteresis that it drives, relative: simulated loops with
#: travels of a tenth of the torque's range came out up to 9 % off with statistical errors of 5 %.
CORNERS = 0.1
#: Rivals listed.
LISTED = 4


def findings_of_gap(
    data: GapData, fits: Sequence[GapFit], causes: Sequence[Cause], whole: GapData | None = None
) -> tuple[Finding, ...]:
    """One finding per cause of the first fit; the other fits are shapes that are not excluded.

    `whole` are all recordings, where the first fit fails on the scored ones (`gear/unseen.py`).
    """
    return tuple(_finding(data, fits, cause, causes, whole) for cause in fits[0].causes)


def _finding(
    data: GapData, fits: Sequence[GapFit], cause: Cause, causes: Sequence[Cause], whole: GapData | None
) -> Finding:
    best = fits[0]
    rest = [c for c in best.causes if c.key != cause.key]
    without = fit_gap(data, rest)
    rivals: dict[tuple[str, str], float] = {}
    taken = {c.key for c in best.causes}
    for rival in causes:
        if rival.key not in taken:
            trial = fit_gap(data, [*rest, rival])
            if trial.admissible:
                evidence = trial.evidence_over(without)
                rivals[rival.key] = max(evidence, rivals.get(rival.key, -np.inf))
    own = best.evidence_over(without)
    for key, odds_of_both in lost_motion_beside(data, best, cause, causes, whole).items():
        rivals[key] = max(rivals.get(key, -np.inf), own + odds_of_both)
    logs = np.array([0.0, own, *rivals.values()])
    odds = np.exp(np.clip(logs - logs.max(), -700, 0))
    odds /= odds.sum()
    chances = sorted(zip(rivals, odds[2:]), key=lambda item: -item[1])[:LISTED]
    gain = 1.0 - float(best.block_energies().sum() / max(without.block_energies().sum(), 1e-300))
    return Finding(
        effect=cause.effect,
        location=cause.location,
        probability=float(odds[1]),
        parameters=_parameters(fits, cause),
        ambiguous_with=tuple(f"{e}@{at}" for (e, at), p in chances if p >= AMBIGUOUS),
        alternatives=tuple(
            Alternative(e, at, float(p), _why_not(float(odds[1]), float(p))) for (e, at), p in chances
        ),
        validation_improvement=gain,
    )


def _why_not(chosen: float, rival: float) -> str:
    if rival >= AMBIGUOUS:
        return "cannot be told apart with these data"
    odds = chosen / max(rival, 1e-12)
    return f"the data favour the finding {odds:.3g} to 1" if odds < 1e9 else "does not fit the data"


def _parameters(fits: Sequence[GapFit], cause: Cause) -> dict[str, Estimate]:
    """Values of the best fit; intervals that cover those of all shapes that are not excluded."""
    stated: dict[str, Estimate] = {}
    for fit in fits:
        own = next(c for c in fit.causes if c.key == cause.key)
        for meaning, estimate in _estimates(fit, own):
            before = stated.get(meaning.name, estimate)
            low, high = (
                min(before.ci95[0], estimate.ci95[0]),
                max(before.ci95[1], estimate.ci95[1]),
            )
            stated[meaning.name] = Estimate(before.value, (low, high), meaning.unit)
    for name, value, unit in next(c for c in fits[0].causes if c.key == cause.key).known:
        stated.setdefault(name, Estimate(value, (value, value), unit))
    return stated


def _estimates(fit: GapFit, cause: Cause) -> Iterator[tuple[Meaning, Estimate]]:
    """What the coefficients of a cause say."""
    values, halves = fit.values(cause)
    for k, (meaning, value, half) in enumerate(zip(cause.meanings, values, halves)):
        place = fit.slice_of(cause).start + k
        if meaning.inverse:
            low, high = value - half, value + half
            interval = 1 / high, 1 / low if low > 0 else float("inf")
            yield meaning, Estimate(float(1 / value), (float(interval[0]), float(interval[1])), meaning.unit)
        elif meaning.relative:
            yield meaning, _by_logarithm(fit, cause, meaning, half)
        elif meaning.power:
            if (found := _with_stiffness(fit, place, meaning)) is not None:
                yield meaning, found
        else:
            interval = float(value - half), float(value + half)
            yield meaning, Estimate(float(value), interval, meaning.unit)


def _with_stiffness(fit: GapFit, place: int, meaning: Meaning) -> Estimate | None:
    """factor c / b^power, b the compliance: to first order in the errors of both."""
    spring = fit.compliance
    if spring is None or spring[1] <= 0:
        return None
    c, b = float(fit.coefficients[place]), spring[1]
    value = meaning.factor * c / b**meaning.power
    weights = np.zeros(fit.coefficients.size)
    weights[place] = meaning.factor / b**meaning.power
    weights[spring[0]] = -meaning.power * value / b
    half = fit.half_width(weights)
    return Estimate(value, (value - half, value + half), meaning.unit)


def _by_logarithm(fit: GapFit, cause: Cause, meaning: Meaning, half: float) -> Estimate:
    """A known parameter as the twist sees it, times K^power; its interval is that of its logarithm.

    A travel is known no better than the filter of the torque leaves the corners of its loop.
    """
    half = float(np.hypot(half, CORNERS)) if meaning.name == "travel" else half
    known = next(value for name, value, _ in cause.known if name == meaning.name)
    spring = fit.compliance
    value = float(known * (spring[1] if spring is not None else np.nan) ** -meaning.power)
    return Estimate(value, (float(value * np.exp(-half)), float(value * np.exp(half))), meaning.unit)


def rungs_of(search: GapSearch) -> Iterator[Rung]:
    """Every step of the search; errors in units of the encoders' noise."""
    floor = max(search.start.data.noise_floor, 1e-300)
    for cause, current, trial, evidence, why in search.steps:
        yield Rung(
            effect=cause.effect,
            location=cause.location,
            added_to=tuple(f"{c.effect}@{c.location}" for c in current.causes),
            train_rms=trial.rms(trial.data.fitted) / floor,
            validation_rms=trial.rms(trial.data.scored) / floor,
            evidence=evidence,
            kept=not why,
            why=why or _entered(cause),
        )


def _entered(cause: Cause) -> str:
    reason = "strong evidence, significant, and holds in unseen blocks"
    return f"{cause.shape}: {reason}" if cause.shape else reason


def channel_fit(before: GapFit, after: GapFit, *, prismatic: bool) -> ChannelFit:
    """Errors about free offsets."""
    data = before.data
    return ChannelFit(
        unit="m" if prismatic else "rad",
        before=Errors(before.rms(data.fitted), before.rms(data.scored)),
        after=Errors(after.rms(data.fitted), after.rms(data.scored)),
        noise_floor=data.noise_floor,
    )


def series_of(before: GapFit, after: GapFit, *, prismatic: bool) -> Iterator[ChannelSeries]:
    """The gap of each recording about its offset, what no cause and what the causes make of it."""
    data = before.data
    unit = "m" if prismatic else "rad"
    for number, gap in enumerate(data.gaps):
        own = data.recording == number
        measured = before.residual[own]
        yield ChannelSeries(
            recording=gap.along.motion.source,
            role="train" if data.fitted[own].any() else "validation",
            channel=f"{gap.joint}.position - {gap.joint}.motor_position",
            unit=unit,
            location=gap.joint,
            time=data.time[own],
            measured=measured,
            nominal=np.zeros_like(measured),
            augmented=measured - after.residual[own],
            held_out=data.scored[own],
            noise_floor=data.noise_floor,
            position=data.position[own],
            velocity=data.velocity[own],
            variable_units=(unit, f"{unit}/s"),
        )

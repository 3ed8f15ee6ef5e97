"""The page: what residuals of real machines are like, and how often intervals hold the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from benchmarks.evidence import bullets, head, paragraph, percent, table
from benchmarks.yardstick.likelihood.arms import DURATION, EFFECTS, FILE_ERROR, SEED
from benchmarks.yardstick.likelihood.fits import DRIFT, FitMeasures, Interval
from benchmarks.yardstick.likelihood.measures import FEWEST, clopper_pearson, scatter
from benchmarks.yardstick.likelihood.recorded import Friction, JointMeasures, MachineMeasures

__all__ = ["page"]

#: Headings of the tables of coverage.
COVERAGE = (
    "effect",
    "parameter",
    "inside:",
    "fraction:",
    "its 95 % interval",
    "error, mean:",
    "error, rms:",
    "error, median size:",
)
#: Octaves of the simulated residuals that are listed; few joints have more.
OCTAVES = 4
#: A spectrum counts as white where no octave is above or below the mean by more than this factor.
WHITE = 2.0


def page(
    command: str,
    machines: Sequence[MachineMeasures],
    fits: Sequence[FitMeasures],
    drifting: Sequence[FitMeasures],
) -> str:
    """The evidence page.

    Args:
        command: that makes it.
        machines: of the yardstick.
        fits: of drawn arms.
        drifting: of drawn arms whose torques drift.
    """
    parts = [head("The likelihood: spectra, calibration, coverage", command=command), INTRODUCTION]
    parts.append(bullets(_found(machines, fits, drifting)))
    if machines:
        parts += [_machines(machines), *_disagreements(machines)]
    if fits:
        parts += [_coverage(fits), _under_the_truth(fits)]
    if drifting:
        parts.append(_with_drift(drifting))
    return "\n\n".join(parts) + "\n"


INTRODUCTION = paragraph(
    "The score of a hypothesis supposes a scatter of its residuals, and the intervals of its parameters that",
    "it is true. This page measures both: on real machines for the standard model, and on simulated arms for",
    "the hypothesis that made them.",
)


#: Meaning of the columns of the real machines.
COLUMNS = (
    "octaves: smallest and largest power density of the residual in an octave, relative to the mean over the "
    f"band; octaves have at least {FEWEST} independent samples, the lowest one reaches down to zero",
    "a: independent samples per row by the residual's autocorrelation, relative to two per period of the "
    "end of the band; white noise has 0.9 by the shape of the filter",
    "per block: independent samples of the median held-out block",
    "held-out / fit, held-out / cross-validated: mean square error of held-out rows relative to that of "
    "fitted rows, with and without their own fold",
    "deviates: by the score's Student's t the mean square error of m samples, divided by its level, has an "
    "F distribution of m and 4 degrees of freedom; mean square of the corresponding standard normal "
    "deviates of the held-out blocks, whose expectation is one",
    "residual / noise: rms, relative to the stated or estimated noise of the sensors in the band",
    "agree: friction parameters and offsets whose intervals overlap, of those that plain weighted least "
    "squares of the same rows determines (essential base parameters, no prior, covariance with the same a); "
    "nothing where no torque is recorded",
    "torques apart: rms difference of the two predicted torques relative to the residual",
    "plain held-out: error of plain least squares relative to that of the standard model",
)


def _found(
    machines: Sequence[MachineMeasures], fits: Sequence[FitMeasures], drifting: Sequence[FitMeasures]
) -> list[str]:
    """What was found, in sentences with numbers."""
    found = [*(_of_machines(machines) if machines else ()), *(_of_fits(fits) if fits else ())]
    if drifting:
        share = [own / fit.white for fit in drifting for own in fit.shares]
        found.append(
            f"Where torques also drift with a time constant of {DRIFT:g} s, longer than a block, a falls to "
            f"{_median(share)} and {_counted(_of_effects(drifting))} of the effects' parameters and "
            f"{_counted(_of_standards(drifting))} of friction, offsets and delays are inside: intervals of "
            "what changes slowly are too narrow then."
        )
    return found


def _of_machines(machines: Sequence[MachineMeasures]) -> Iterator[str]:
    joints = [joint for one in machines for joint in one.joints]
    spectra = [joint.octaves for joint in joints if len(joint.octaves) > 1]
    even = sum(all(1 / WHITE <= own.power <= WHITE for own in found) for found in spectra)
    noisy = [joint.over_noise for joint in joints]
    yield (
        f"Real machines ({len(machines)} rows, {len(joints)} joints): the standard model's residual is not "
        f"white, and it is model error, not sensor noise. All octaves are within a factor of {WHITE:g} of "
        f"the mean at {even} of the {len(spectra)} joints with two octaves or more; the residual is "
        f"{_median(noisy, 0)} times the sensors' noise in the median, at most {WHITE:g} times at "
        f"{sum(r <= WHITE for r in noisy)} joints."
    )
    short = sum(joint.per_block < 1.0 for joint in joints)
    relative = [joint.share / one.white for one in machines for joint in one.joints]
    yield (
        "The score takes the correlation into account: of the samples that the band passes it counts "
        f"{_median(relative)} in the median and {min(relative):.2f} at the least; of white noise, 0.90. "
        f"At {short} of {len(joints)} joints a block holds less than one independent sample: blocks are "
        "shorter than they should be."
    )
    ratio = [j.chi_square for j in joints if np.isfinite(j.chi_square)]
    ahead = [j.foreseen for j in joints if np.isfinite(j.foreseen)]
    yield (
        f"Chi-square of held-out rows per sample: {_median(ratio)} in the median with the variance of the "
        f"fit's residual, {_median(ahead)} with the cross-validated one that the score uses; above two at "
        f"{sum(r > 2 for r in ratio)} and {sum(r > 2 for r in ahead)} of {len(ratio)} joints. The first is "
        "largest where a motion is short or the held-out one differs from it; the score's own folds show the "
        "former only."
    )
    squares = [float(np.mean(np.square(j.deviates))) for j in joints if j.deviates]
    yield (
        f"Mean square of the held-out deviates, one if the score is calibrated: {_median(squares)} in the "
        f"median joint, {_range(squares)} at nine tenths of the joints, above two at "
        f"{sum(own > 2 for own in squares)}."
    )
    pairs = [pair for joint in joints for pair in joint.friction]
    apart = [j.apart for j in joints if np.isfinite(j.apart)]
    rival = np.array([j.held_out for j in joints if np.isfinite(j.held_out)])
    yield (
        f"Plain least squares: {_fraction(sum(p.overlaps for p in pairs), len(pairs))} of friction "
        "parameters and offsets have 95 % intervals that overlap with those of the standard model, "
        f"{_fraction(sum(p.agrees for p in pairs), len(pairs))} are inside each other's interval. Predicted "
        f"torques differ by {_median(apart)} of the residual in the median. Its held-out error is more than "
        f"10 % larger at {int(np.sum(rival > 1.1))} joints and more than 10 % smaller at "
        f"{int(np.sum(rival < 1 / 1.1))} of {rival.size}."
    )


def _of_fits(fits: Sequence[FitMeasures]) -> Iterator[str]:
    yield (
        f"Coverage over {len(fits)} simulated fits of the true hypothesis: {_counted(_of_effects(fits))} of "
        f"the effects' parameters and {_counted(_of_standards(fits))} of friction, offsets and delays are "
        "inside their 95 % intervals."
    )
    ratio, ahead = _ratios(fits)
    spectra = [found for fit in fits for found in fit.octaves if len(found) > 1]
    mean = float(np.mean([scatter(found) for found in spectra]))
    squares = [d**2 for fit in fits for d in fit.deviates]
    yield (
        f"Under the truth octaves scatter {mean:.2f} times as much as those of white noise; chi-square of "
        f"held-out rows is {_median(ratio)} with the variance of the fit's residual and {_median(ahead)} "
        f"with the cross-validated one; the deviates' mean square is {float(np.mean(squares)):.2f}, since "
        "the score allows a scatter of the variance that simulated noise does not have."
    )


def _of_effects(fits: Sequence[FitMeasures]) -> list[Interval]:
    return [one for fit in fits for one in fit.of_effect]


def _of_standards(fits: Sequence[FitMeasures]) -> list[Interval]:
    return [one for fit in fits for one in fit.of_standard]


def _machines(machines: Sequence[MachineMeasures]) -> str:
    rows = []
    for one in machines:
        for number_of_joint, joint in enumerate(one.joints):
            rows.append([one.machine if number_of_joint == 0 else "", *_joint(one, joint)])
    headings = [
        "machine",
        "joint",
        "octaves:",
        "a:",
        "per block:",
        "held-out / fit:",
        "held-out / cross-validated:",
        "deviates:",
        "residual / noise:",
        "agree",
        "torques apart:",
        "plain held-out:",
    ]
    refused = [f"{one.machine} ({one.refused})" for one in machines if one.refused]
    total = sum(one.seconds for one in machines)
    return "\n\n".join(
        [
            "## Real machines",
            bullets(COLUMNS),
            table(headings, rows),
            f"Standard models of all machines took {total:.0f} s of one processor."
            + (f" Not measured: {'; '.join(refused)}." if refused else ""),
        ]
    )


def _joint(one: MachineMeasures, joint: JointMeasures) -> list[str]:
    powers = [own.power for own in joint.octaves]
    squares = np.square(joint.deviates)
    agree = sum(pair.overlaps for pair in joint.friction)
    return [
        joint.joint,
        f"{min(powers):.2f} to {max(powers):.2f}" if len(powers) > 1 else "",
        f"{joint.share / one.white:.2f}",
        f"{joint.per_block:.1f}",
        _cell(joint.chi_square),
        _cell(joint.foreseen),
        _cell(float(squares.mean())) if squares.size else "",
        _cell(joint.over_noise),
        f"{agree}/{len(joint.friction)}" if joint.friction else "",
        _cell(joint.apart),
        _cell(joint.held_out),
    ]


def _disagreements(machines: Sequence[MachineMeasures]) -> Iterator[str]:
    rows, why = [], {}
    for one in machines:
        for joint in one.joints:
            for pair in joint.friction:
                if not pair.overlaps:
                    rows.append([one.machine, joint.joint, pair.name, *_both(pair), pair.why])
                    why[pair.why] = why.get(pair.why, 0) + 1
    yield "## Where the two estimators disagree"
    if not rows:
        yield "Nowhere."
        return
    ordered = sorted(why.items(), key=lambda item: -item[1])
    counts = "; ".join(f"{words}: {count}" for words, count in ordered)
    yield (
        f"Estimates with half of their 95 % intervals. {counts[:1].upper()}{counts[1:]}. The standard model "
        "does not allow negative friction, which plain least squares finds where something else acts against "
        "it; its bodies are realisable and have a prior around the robot file, and where plain least squares "
        "of friction alone, with these bodies, agrees, the difference is due to them. In this first fit the "
        "interval of an estimate of zero is that of the barrier that keeps it positive, and too narrow; the "
        "intervals of a diagnosis do not include the barrier."
    )
    yield table(("machine", "joint", "parameter", "standard model:", "plain:", "cause"), rows)


def _both(pair: Friction) -> list[str]:
    return [f"{value:.3g} ± {1.96 * deviation:.2g}" for value, deviation in (pair.ours, pair.plain)]


def _coverage(fits: Sequence[FitMeasures]) -> str:
    rows = []
    for effect in EFFECTS:
        here = [fit for fit in fits if fit.effect == effect]
        named = {one.name: None for fit in here for one in fit.of_effect}
        for position, name in enumerate(named):
            own = [one for fit in here for one in fit.of_effect if one.name == name]
            rows.append([f"`{effect}`" if position == 0 else "", name, *_row(own)])
    for name in ("viscous", "coulomb", "offset", "timing"):
        own = [one for fit in fits for one in fit.of_standard if one.name == name]
        rows.append(["standard model" if name == "viscous" else "", name, *_row(own)])
    for words, quiet in (("noise above the model's error", False), ("noise below it", True)):
        own = [one for fit in fits if fit.quiet is quiet for one in (*fit.of_effect, *fit.of_standard)]
        rows.append([words, "all", *_row(own)])
    rows.append(["all", "all", *_row([*_of_effects(fits), *_of_standards(fits)])])
    refused = [f"{fit.number} ({fit.effect}: {fit.refused})" for fit in fits if fit.refused]
    words = (
        f"Arm k of one or two joints is drawn with the seed ({SEED}, k), k from 0 to {len(fits) - 1}: "
        f"masses, motions of four sines below 0.7 Hz for {DURATION:g} s at 100, 200 or 500 Hz, friction, "
        "offsets, a delay of all torques of about a sample, and in turn none or one of "
        f"{len(EFFECTS) - 1} effects of 5 to 50 % of the torque. Torques are exact along the analytic "
        "motion, with 1 to 10 % of white noise; the "
        f"file's masses are off by {percent(FILE_ERROR, 0)}, and it has no friction. The true hypothesis is "
        "fitted from the starting values that the search takes; a second recording is held out. Errors are in"
        " stated standard deviations: their rms is one if these are right, the median of their size 0.67 if "
        "they are Gaussian, and their mean zero if there is no bias. Every interval includes the model's own "
        "error of 0.3 % of the torque, which no simulated torque has: where the noise in the band is "
        "smaller, intervals are wide on purpose."
    )
    refusal = [f"Fits that a search would discard as impossible: {'; '.join(refused)}."] if refused else []
    return "\n\n".join(["## Coverage of the intervals", words, table(COVERAGE, rows), *refusal])


def _with_drift(fits: Sequence[FitMeasures]) -> str:
    rows = []
    for name in dict.fromkeys(one.name for fit in fits for one in fit.of_standard):
        rows.append(["standard model", name, *_row([one for one in _of_standards(fits) if one.name == name])])
    for effect in filter(None, EFFECTS):
        own = [one for fit in fits if fit.effect == effect for one in fit.of_effect]
        rows.append([f"`{effect}`", "all", *_row(own)])
    rows.append(["all", "all", *_row([*_of_effects(fits), *_of_standards(fits)])])
    words = (
        f"The first {len(fits)} arms again, whose torques also have first-order noise with a time constant "
        f"of {DRIFT:g} s, as large as the white noise of a sample; all of it is in the band. A block of "
        "these arms lasts 0.75 s, so that the correlation reaches over several blocks, as at many real "
        "joints. Intervals include the correlation of blocks within a stretch, of which there are only eight."
    )
    return "\n\n".join(["## Coverage with torques that drift", words, table(COVERAGE, rows)])


def _row(own: Sequence[Interval]) -> list[str]:
    hits = sum(one.contains for one in own)
    low, high = clopper_pearson(hits, len(own)) if own else (0.0, 1.0)
    errors = np.array([one.error for one in own]) if own else np.array([np.nan])
    return [
        f"{hits}/{len(own)}",
        percent(hits / max(len(own), 1), 1),
        f"{100 * low:.0f} to {100 * high:.0f} %",
        f"{np.mean(errors):+.2f}",
        f"{np.sqrt(np.mean(errors**2)):.2f}",
        f"{np.median(np.abs(errors)):.2f}",
    ]


def _under_the_truth(fits: Sequence[FitMeasures]) -> str:
    joints = [found for fit in fits for found in fit.octaves]
    rows = []
    for k in range(OCTAVES):
        powers = [found[k].power for found in joints if len(found) > max(k, 1)]
        if powers:
            words = f"power in octave {k + 1} below the end of the band"
            rows.append([words, "1", *_three(powers)])
    several = [found for found in joints if len(found) > 1]
    rows.append(["scatter of octaves", "1", *_three([scatter(found) for found in several])])
    share = [own / fit.white for fit in fits for own in fit.shares]
    rows.append(["a", "0.9", *_three(share)])
    ratio, ahead = _ratios(fits)
    rows.append(["held-out / fit", "above 1", *_three(ratio)])
    rows.append(["held-out / cross-validated", "1", *_three(ahead)])
    rows.append(["residual / noise", "below 1", *_three([r for fit in fits for r in fit.over_noise])])
    squares = [float(np.mean(np.square(fit.deviates))) for fit in fits]
    rows.append(["mean square of deviates", "below 1", *_three(squares)])
    words = (
        "The same measures for the true hypothesis, over all joints of the fits: expectation, mean, and "
        "where nine tenths of the values are. A fit of p parameters to n independent samples leaves a "
        "residual below the noise and predicts other rows worse, by about p/n each. Simulated noise has one "
        "variance, so blocks differ less than the four degrees of freedom of the score allow, and the "
        "deviates are below one: the score is cautious there."
    )
    headings = "measure", "expected:", "mean:", "median:", "5 %:", "95 %:"
    return "\n\n".join(["## Under the truth", words, table(headings, rows)])


def _ratios(fits: Sequence[FitMeasures]) -> tuple[list[float], list[float]]:
    """Held-out errors of all joints relative to the fit's residual, and to the cross-validated errors."""
    return [r for fit in fits for r in fit.chi_square], [r for fit in fits for r in fit.foreseen]


def _three(values: Sequence[float]) -> list[str]:
    return [f"{float(np.mean(values)):.2f}", f"{float(np.median(values)):.2f}", *_tenths(values)]


def _tenths(values: Sequence[float]) -> list[str]:
    return [f"{float(np.quantile(values, q)):.2f}" for q in (0.05, 0.95)]


def _range(values: Sequence[float]) -> str:
    low, high = _tenths(values)
    return f"{low} to {high}"


def _counted(own: Sequence[Interval]) -> str:
    return _fraction(sum(one.contains for one in own), len(own))


def _fraction(hits: int, trials: int) -> str:
    return f"{percent(hits / max(trials, 1), 1)} ({hits}/{trials})"


def _median(values: Iterable[float], digits: int = 2) -> str:
    return f"{float(np.median(list(values))):.{digits}f}"


def _cell(value: float) -> str:
    if not np.isfinite(value):
        return ""
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.2g}"

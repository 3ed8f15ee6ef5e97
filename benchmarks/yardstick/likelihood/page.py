"""The page: what residuals of real machines are like, and how often intervals hold the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from benchmarks.evidence import head, number, paragraph, percent, table
from benchmarks.yardstick.likelihood.arms import DURATION, EFFECTS, FILE_ERROR, SEED
from benchmarks.yardstick.likelihood.fits import FitMeasures, Interval
from benchmarks.yardstick.likelihood.measures import FEWEST, clopper_pearson, scatter
from benchmarks.yardstick.likelihood.recorded import Friction, JointMeasures, MachineMeasures

__all__ = ["page"]

#: Octaves of the simulated residuals that are listed; few joints have more.
OCTAVES = 4
#: A spectrum counts as white where no octave is above or below the mean by more than this factor.
WHITE = 2.0


def page(command: str, machines: Sequence[MachineMeasures], fits: Sequence[FitMeasures]) -> str:
    """The evidence page.

    Args:
        command: that makes it.
        machines: of the yardstick.
        fits: of drawn arms.
    """
    parts = [head("The likelihood: spectra, calibration, coverage", command=command), INTRODUCTION]
    parts.append(bullets_of(machines, fits))
    if machines:
        parts += [_machines(machines), *_disagreements(machines)]
    if fits:
        parts += [_coverage(fits), _under_the_truth(fits)]
    return "\n\n".join(parts) + "\n"


INTRODUCTION = paragraph(
    "The score of a hypothesis supposes residuals of known spectrum and scatter, and the intervals of its "
    "parameters",
    "that it is right. This page measures both: on real machines for the standard model, and on simulated "
    "arms for",
    "the hypothesis that made them. Nothing here is adjusted to the result.",
)


def bullets_of(machines: Sequence[MachineMeasures], fits: Sequence[FitMeasures]) -> str:
    """What was found, in sentences with numbers."""
    lines = [*(_of_machines(machines) if machines else ()), *(_of_fits(fits) if fits else ())]
    return "\n".join(f"- {line}" for line in lines)


def _of_machines(machines: Sequence[MachineMeasures]) -> Iterator[str]:
    joints = [joint for one in machines for joint in one.joints]
    spectra = [joint.octaves for joint in joints if len(joint.octaves) > 1]
    even = sum(all(1 / WHITE <= own.power <= WHITE for own in found) for found in spectra)
    yield (
        f"Real machines ({len(machines)} rows, {len(joints)} joints): the standard model's residual is not "
        f"white. {even} of {len(spectra)} spectra with two octaves or more are within a factor of {WHITE:g} "
        f"of their mean; the residual is {_median([j.over_noise for j in joints], 0)} times the sensors' "
        "noise in the median."
    )
    short = sum(joint.per_block < 1.0 for joint in joints)
    relative = [joint.share / one.white for one in machines for joint in one.joints]
    yield (
        f"The score takes correlation into account: it counts {percent(float(np.median(relative)), 0)} of "
        f"the independent samples of white noise in the median, {percent(min(relative), 0)} at the least. At "
        f"{short} of {len(joints)} joints a block holds less than one independent sample, which is less than "
        "intended."
    )
    ratio = [j.chi_square for j in joints if np.isfinite(j.chi_square)]
    ahead = [j.foreseen for j in joints if np.isfinite(j.foreseen)]
    yield (
        f"Chi-square of held-out rows: {_median(ratio)} in the median if the variance is that of the fit's "
        f"residual, {_median(ahead)} if it is the cross-validated one that the score uses; above two at "
        f"{sum(r > 2 for r in ratio)} and {sum(r > 2 for r in ahead)} of {len(ratio)} joints."
    )
    squares = [float(np.mean(np.square(j.deviates))) for j in joints if j.deviates]
    yield (
        f"Mean square of the held-out deviates, which is one if the score is calibrated: {_median(squares)} "
        f"in the median joint, {_range(squares)} over nine tenths of the joints."
    )
    pairs = [pair for joint in joints for pair in joint.friction]
    apart = [j.apart for j in joints if np.isfinite(j.apart)]
    rival = [j.held_out for j in joints if np.isfinite(j.held_out)]
    yield (
        f"Plain least squares: {_fraction(sum(p.overlaps for p in pairs), len(pairs))} of friction "
        "parameters and offsets have 95 % intervals that overlap, "
        f"{_fraction(sum(p.agrees for p in pairs), len(pairs))} are inside each other's interval. The "
        f"predicted torques differ by {_median(apart)} of the residual in the median, and held-out errors of "
        f"plain least squares are {_median(rival)} times those of the standard model."
    )


def _of_fits(fits: Sequence[FitMeasures]) -> Iterator[str]:
    own = [one for fit in fits for one in fit.of_effect]
    standard = [one for fit in fits for one in fit.of_standard]
    yield (
        f"Coverage over {len(fits)} simulated fits of the true hypothesis: {_counted(own)} of the effects' "
        f"parameters and {_counted(standard)} of friction, offsets and delays are inside their 95 % "
        "intervals."
    )
    ratio, ahead = _ratios(fits)
    spectra = [found for fit in fits for found in fit.octaves if len(found) > 1]
    mean = float(np.mean([scatter(found) for found in spectra]))
    squares = [d**2 for fit in fits for d in fit.deviates]
    yield (
        f"Under the truth: octaves deviate from one by {number(mean)} times the variance of white noise; "
        f"chi-square of held-out rows is {_median(ratio)} with the variance of the fit's residual, "
        f"{_median(ahead)} with the cross-validated one; held-out deviates have a mean square of "
        f"{number(float(np.mean(squares)))}, since the score allows a scatter of the variance that simulated "
        "noise does not have."
    )


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
            "Octaves: smallest and largest power density of the residual in an octave relative to the mean "
            f"over the band; octaves have at least {FEWEST} independent samples, and the lowest one reaches "
            "down to zero. a: independent samples per row by the residual's autocorrelation, relative to "
            "white noise in the band. Per block: independent samples of the median held-out block. Held-out: "
            "mean square error relative to that of fitted rows, with and without their own fold. Deviates: "
            "if the Student's t of the score is right, the mean square error of a block of m samples over "
            "its level has an F distribution of m and 4 degrees of freedom; the column is the mean square of "
            "the corresponding standard normal deviates, whose expectation is one. "
            "Residual / noise: rms relative to the stated or estimated noise of the sensors in the band.\n\n"
            "Agree: friction parameters and offsets whose intervals overlap, of those that plain least "
            "squares of the same rows determines (essential base parameters by singular values, no prior, "
            "covariance with the same a). Torques apart: rms difference of the predicted torques relative "
            "to the residual. Plain held-out: error of plain least squares relative to the standard "
            "model's. Joints without a recorded torque have none of these.",
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
    counts = "; ".join(f"{words}: {count}" for words, count in sorted(why.items(), key=lambda item: -item[1]))
    yield (
        "Estimates with half of their 95 % intervals. Friction of the standard model is not negative; plain "
        "least squares of a torque measured behind the gear, or of a motion that hardly determines it, is. "
        "Bodies of the standard model have a prior around the robot file and are realisable; where plain "
        "least squares of friction alone, with these bodies, agrees, the difference is due to them. "
        f"{counts}."
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
    whole = [one for fit in fits for one in (*fit.of_effect, *fit.of_standard)]
    rows.append(["all", "all", *_row(whole)])
    refused = [f"{fit.number} ({fit.effect}: {fit.refused})" for fit in fits if fit.refused]
    words = (
        f"Arm k of one or two joints is drawn with the seed ({SEED}, k), k from 0 to {len(fits) - 1}: "
        f"masses, motions of four sines below 0.7 Hz for {DURATION:g} s at 100, 200 or 500 Hz, friction, "
        "offsets, a delay of all torques of about a sample, and in turn none or one of six effects of 5 to "
        "50 % of the torque. Torques are exact along the analytic motion, plus 1 to 10 % of white noise; the "
        f"file's masses are off by {FILE_ERROR:.0%}, and it has no friction. The true hypothesis is fitted "
        "from the starting values that the search would take; a second recording is held out. Fraction: with "
        "its 95 % interval (Clopper and Pearson). Error: rms of estimate minus truth in stated standard "
        "deviations, one if these are right; median: of its absolute value, 0.67 if Gaussian. The model's "
        "own error of 0.3 % of the torque is part of every interval, and no simulated torque has it."
    )
    heads = ("effect", "parameter", "inside:", "fraction:", "interval", "error, rms:", "error, median:")
    refusal = [f"Fits that a search would discard as impossible: {'; '.join(refused)}."] if refused else []
    return "\n\n".join(["## Coverage of the intervals", words, table(heads, rows), *refusal])


def _row(own: Sequence[Interval]) -> list[str]:
    hits = sum(one.contains for one in own)
    low, high = clopper_pearson(hits, len(own)) if own else (0.0, 1.0)
    errors = np.array([one.error for one in own]) if own else np.array([np.nan])
    return [
        f"{hits}/{len(own)}",
        percent(hits / max(len(own), 1), 1),
        f"{100 * low:.0f} to {100 * high:.0f} %",
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
            rows.append([words, "1", number(float(np.mean(powers))), *_tenths(powers)])
    several = [found for found in joints if len(found) > 1]
    rows.append(["scatter of octaves", "1", *_three([scatter(found) for found in several])])
    share = [own / fit.white for fit in fits for own in fit.shares]
    rows.append(["a, relative to white noise", "1", *_three(share)])
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
    return "\n\n".join(
        ["## Under the truth", words, table(("measure", "expected:", "mean:", "5 %:", "95 %:"), rows)]
    )


def _ratios(fits: Sequence[FitMeasures]) -> tuple[list[float], list[float]]:
    """Held-out errors of all joints relative to the fit's residual, and to the cross-validated errors."""
    return [r for fit in fits for r in fit.chi_square], [r for fit in fits for r in fit.foreseen]


def _three(values: Sequence[float]) -> list[str]:
    return [number(float(np.mean(values))), *_tenths(values)]


def _tenths(values: Sequence[float]) -> list[str]:
    return [number(float(np.quantile(values, q))) for q in (0.05, 0.95)]


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

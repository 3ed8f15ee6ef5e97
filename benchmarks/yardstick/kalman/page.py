"""The page: which of the two estimators predicts better, and which one knows its errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.evidence import bullets, head, paragraph, percent, table
from benchmarks.yardstick.kalman.compared import ArmErrors, Compared, JointResult
from benchmarks.yardstick.kalman.filter import TIMES
from benchmarks.yardstick.likelihood.measures import FEWEST

__all__ = ["page"]

#: A difference of held-out errors counts from this factor on [-].
DIFFERENT = 1.1
#: A spectrum counts as white where no octave is above or below the mean by more than this factor [-].
WHITE = 2.0
#: Quantile of the 95 % interval.
QUANTILE = 1.96

INTRODUCTION = paragraph(
    "The diagnosis compares torques in the band of the motion. The alternative is a Kalman filter at the",
    "rate of the recording: positions deviate from their smoothed course by noise and by unknown forces, and",
    "the likelihood of the innovations weighs every frequency by itself. Here the parameters of the standard",
    "model (base parameters, friction, offsets, one delay) are estimated in both ways, without priors: by",
    "such a filter for each joint, with white noise of encoder and torque and three Ornstein-Uhlenbeck",
    f"forces with time constants of {', '.join(f'{time:g}' for time in TIMES)} s, whose five levels have",
    "maximum likelihood in turn with the parameters; and by least squares of the rows in the band. Both are",
    "judged by what they predict, in the band, in recordings that were not fitted, relative to the standard",
    "model of the diagnosis, which has the same rows, and priors.",
)


def page(command: str, machines: Sequence[Compared], arms: Sequence[ArmErrors]) -> str:
    """The evidence page.

    Args:
        command: that makes it.
        machines: of the yardstick.
        arms: drawn ones.
    """
    joints = [joint for one in machines for joint in one.joints]
    found = [*(_of_machines(joints) if joints else ()), *_of_arms(arms)]
    parts = [head("Rows in a band and a Kalman filter at full rate", command=command), INTRODUCTION]
    parts.append(bullets(found))
    if machines:
        parts.append(_machines(machines))
    return "\n\n".join(parts) + "\n"


def _of_machines(joints: Sequence[JointResult]) -> Iterator[str]:
    pairs = [(j.own, j.rows) for j in joints if np.isfinite(j.own) and np.isfinite(j.rows)]
    worse = sum(own > DIFFERENT * rows for own, rows in pairs)
    better = sum(rows > DIFFERENT * own for own, rows in pairs)
    ratio = float(np.exp(np.median([np.log(own / rows) for own, rows in pairs])))
    yield (
        f"Real machines, {len(pairs)} joints with held-out data: the filter's held-out error is more than "
        f"10 % larger than that of the rows at {worse} joints and more than 10 % smaller at {better}; the "
        f"median ratio is {ratio:.2f}."
    )
    larger, smaller = (
        [sum(changed(pair[k]) for pair in pairs) for k in range(2)]
        for changed in (lambda ratio: ratio > DIFFERENT, lambda ratio: ratio < 1.0 / DIFFERENT)
    )
    yield (
        "Relative to the standard model of the diagnosis the filter's is more than 10 % larger at "
        f"{larger[0]} joints and more than 10 % smaller at {smaller[0]}; that of least squares of the rows "
        f"at {larger[1]} and {smaller[1]}."
    )
    spectra = [joint.octaves for joint in joints if len(joint.octaves) > 1]
    white = sum(all(1.0 / WHITE <= power <= WHITE for power in found) for found in spectra)
    squares = [joint.chi_square for joint in joints if np.isfinite(joint.chi_square)]
    yield (
        f"The filter's innovations are within a factor of {WHITE:g} of white in every octave at {white} of "
        f"{len(spectra)} joints, with five levels estimated for each. Their mean square in held-out data, "
        f"one if the levels are right, is {float(np.median(squares)):.2f} in the median and above two at "
        f"{sum(square > 2.0 for square in squares)} of {len(squares)} joints: the error of a rigid model is "
        "not stationary noise."
    )
    agreeing, count = np.sum([joint.friction for joint in joints], axis=0)
    yield (
        f"95 % intervals of {agreeing} of the {count} friction parameters and offsets that both determine "
        "overlap."
    )


def _of_arms(arms: Sequence[ArmErrors]) -> Iterator[str]:
    for drift in dict.fromkeys(arm.drift for arm in arms):
        own = [arm for arm in arms if arm.drift == drift]
        errors = np.concatenate([[arm.own, arm.rows] for arm in own], axis=1)
        spread = np.concatenate([[arm.own_deviation, arm.rows_deviation] for arm in own], axis=1)
        inside = np.mean(np.abs(errors) <= QUANTILE * spread, axis=1)
        size = np.median(np.abs(errors) / spread[1], axis=1)
        kind = f"torques also drift with a time constant of {drift:g} s" if drift else "all noise is white"
        yield (
            "Simulated arms of the standard model with noise of the kinds that the filter supposes "
            f"({len(own)}, {errors.shape[1]} friction parameters and offsets; {kind}): the median error is "
            f"{size[0]:.2f} by the filter and {size[1]:.2f} by the rows, in standard deviations of the rows; "
            f"{percent(float(inside[0]), 1)} and {percent(float(inside[1]), 1)} of the errors are inside "
            "their 95 % intervals."
        )


def _machines(machines: Sequence[Compared]) -> str:
    rows = []
    for one in machines:
        for place, joint in enumerate(one.joints):
            octaves = f"{min(joint.octaves):.2f} to {max(joint.octaves):.2f}" if joint.octaves else ""
            rows.append(
                [
                    one.machine if place == 0 else "",
                    joint.joint,
                    octaves,
                    _cell(joint.chi_square),
                    f"{joint.friction[0]}/{joint.friction[1]}",
                    _cell(joint.own),
                    _cell(joint.rows),
                ]
            )
    columns = (
        "octaves: smallest and largest power density of the fitted innovations in an octave below half of "
        f"the sampling rate, relative to their mean; octaves have at least {FEWEST} frequencies",
        "chi-square: mean square of the held-out innovations relative to their variance by the filter",
        "agree: friction parameters and offsets whose intervals overlap, of those that both determine",
        "filter, rows: held-out error in the band by the parameters of the filter, and by least squares of "
        "the rows, relative to that of the standard model of the diagnosis",
    )
    headings = ("machine", "joint", "octaves:", "chi-square:", "agree", "filter:", "rows:")
    refused = [f"{one.machine} ({one.refused.rstrip('.')})" for one in machines if one.refused]
    seconds = sum(one.seconds for one in machines)
    left = f" Not compared: {'; '.join(refused)}." if refused else ""
    return "\n\n".join(
        [
            "## Real machines",
            bullets(columns),
            table(headings, rows),
            f"The filter took {seconds:.0f} s of one processor for all machines.{left}",
        ]
    )


def _cell(value: float) -> str:
    if not np.isfinite(value):
        return ""
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.2g}"

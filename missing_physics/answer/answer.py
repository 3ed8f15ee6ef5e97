"""From recordings to weighed hypotheses, and from these to the diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from missing_physics.answer.augmented import augmented
from missing_physics.answer.experiments import separating
from missing_physics.answer.findings import Answer, answer_of, is_large, of_bodies
from missing_physics.answer.guard import Guarded, guarded, worse
from missing_physics.answer.load import carried
from missing_physics.answer.locate import BEYOND_NOISE, located
from missing_physics.answer.samples import compared_rows, series_of, without_delay
from missing_physics.answer.unnamed import unnamed
from missing_physics.evaluation import evaluate
from missing_physics.hypotheses import TIMING
from missing_physics.inference import Fit as Fitted
from missing_physics.inference import search, weighed
from missing_physics.inference.data import held_out_windows
from missing_physics.inference.ledger import Search, Step
from missing_physics.inference.posterior import Posterior
from missing_physics.inference.torques.data import TorqueData
from missing_physics.inference.torques.reversals import searched_at_reversals
from missing_physics.plausibility import is_credible_number
from missing_physics.results.comparison import Errors
from missing_physics.results.result import (
    ChannelFit,
    Diagnosis,
    Experiment,
    Finding,
    Fit,
    Result,
    Rung,
    Verdict,
)
from missing_physics.results.samples import Rows
from missing_physics.standard import fit_standard
from missing_physics.standard.bending import model_of
from missing_physics.standard.layout import Information
from missing_physics.standard.prediction import knows_links
from missing_physics.standard.rows import common_band, rows_of, without_friction
from reference_model.effects.base import Effect
from reference_model.effects.catalogue import catalogue, get_effect
from robot_model import Recording, Robot, robot_to_toml, unit_of

__all__ = ["answered", "dismissed", "rung"]

Progress = Callable[[str], None]


def answered(
    robot: Robot,
    recordings: Sequence[Recording],
    validation: Sequence[Recording],
    *,
    cutoff: float | None = None,
    experiments: int | None = None,
    searched: Collection[str] = (),
    extra: Information | None = None,
    progress: Progress,
) -> tuple[Result, tuple[Recording, ...]]:
    """The diagnosis without the comparison of robot files, and the recordings corrected for delays.

    Args:
        robot: nominal.
        recordings: those that are fitted.
        validation: those that are only predicted; if empty, a quarter of each recording is held out.
        cutoff: end of the band [Hz]; five times the motion's bandwidth when None.
        experiments: seed for designing motions that resolve ambiguities; none are designed when None.
        searched: ids of effects that were compared with channels other than torques.
        extra: information on the bodies from other channels.
        progress: called with a phrase whenever something new is tried.

    Raises:
        InputError: the standard model cannot be identified from these recordings.
    """
    progress("fitting the standard model")
    band = common_band(robot, [*recordings, *validation]) if cutoff is None else cutoff
    windows = [] if validation else _windows(robot, recordings, band)
    standard = fit_standard(robot, recordings, cutoff=band, held_out=windows)
    data = TorqueData.of(standard, recordings, validation, extra)
    progress("weighing hypotheses")
    found = search(data, progress)
    data = found.data
    near = replace(standard, weights=replace(standard.weights, reversals=True))
    known = _weighed(found, lambda: TorqueData.of(near, recordings, validation, extra), progress)
    safe = guarded(data, known.answer, found.standard, _without_unnamed_forces(found, known.answer))
    load = carried(found, known.answer, safe.fit)
    safe = (load.safe if load else None) or safe
    bodies = of_bodies(data, load.fit, load.loads) if load else ()
    answer = answer_of(data, known, safe.fit, bodies, found.standard)
    delay = 0.0 if is_large(data, safe.file) else safe.file.parameter(TIMING)
    every = tuple(without_delay(robot, r, delay) for r in (*recordings, *validation))
    rows = compared_rows(data)
    made = tuple(evaluate(robot, one, own.band) for one, own in zip(every[: data.fitted], rows))
    needed: tuple[Experiment, ...] = ()
    motions: dict[str, str] = {}
    if experiments is not None and any(f.ambiguous_with for f in answer.findings):
        progress("designing motions")
        needed, motions = separating(data, known, answer.findings, seed=experiments)
    progress("locating the mismatch")
    mismatch = located(data, robot, made, rows)
    beyond = tuple(m for m in mismatch if m.p_value < BEYOND_NOISE)
    file = robot
    credible = all(is_credible_number(c.name, c.estimate, c.nominal, robot) for c in answer.changes)
    if answer.findings or (beyond and credible):  # changed parameters of the file may explain it
        file = augmented(data, safe.file, _further(answer, safe))
    verdict: Verdict = "unexplained"
    if not answer.findings and not beyond:
        verdict = "consistent"
    elif answer.findings:
        verdict = "ambiguous" if any(f.ambiguous_with for f in answer.findings) else "explained"
    forces = tuple(unnamed(data, answer.fit))
    diagnosis = Diagnosis(
        robot=robot.name,
        recordings=tuple(r.source for r in recordings),
        validation=tuple(r.source for r in validation),
        verdict=verdict,
        summary="",
        mismatch=beyond,
        findings=answer.findings,
        fit=_fit(rows, robot),
        experiments=needed,
        unnamed=forces,
        could_not_tell=(*dismissed(found, answer.findings), *_not_searched(robot, searched)),
        nominal_parameters=answer.changes,
        notes=tuple(_notes(data, bool(validation), bool(forces))),
        timing=answer.timing,
    )
    return (
        Result(
            diagnosis=diagnosis,
            series=series_of(data, rows, robot),
            ladder=tuple(rung(found, step) for step in found.steps),
            augmented_robot_toml=robot_to_toml(file),
            rows=rows,
            experiment_motions=motions,
        ),
        every,
    )


def _weighed(
    found: Search[TorqueData], near_reversals: Callable[[], TorqueData], progress: Progress
) -> Posterior:
    """The posterior, with dry friction laws compared near reversals, too.

    Args:
        found: the search.
        near_reversals: makes rows that include quick reversals. Laws that these prefer are not taken where
            they predict the held-out rows of the search worse.
        progress: called with a phrase when laws are compared.
    """
    known = weighed(found)
    friction = searched_at_reversals(found, known, near_reversals, progress)
    if friction is None:
        return known
    anew = weighed(found, friction)
    return known if worse(found.data, anew.answer, known.answer) else anew


def _without_unnamed_forces(found: Search[Any], answer: Fitted) -> Fitted | None:
    """The best fit that a robot file can represent, if the answer has unnamed forces."""
    if not any(term.effect.is_unknown for term in answer.hypothesis.terms):
        return None
    plain = (fit for fit in found.fits if not any(t.effect.is_unknown for t in fit.hypothesis.terms))
    return next(plain, None)


def _further(answer: Answer, safe: Guarded) -> Mapping[tuple[str, str], Mapping[str, float]]:
    """Effects of the robot file that are parameters of the answer, unless the file's own fit has them."""
    if safe.fit is safe.file:
        return answer.named
    return {key: values for key, values in answer.named.items() if not get_effect(key[0]).standard}


def _windows(
    robot: Robot, recordings: Sequence[Recording], band: float
) -> list[tuple[tuple[float, float], ...]]:
    """Held-out time intervals of each recording [s]."""
    model = model_of(without_friction(robot))
    return [held_out_windows(rows_of(model, r, band).time) for r in recordings]


def _fit(rows: Sequence[Rows], robot: Robot) -> Fit:
    """The compared channels; their errors are added by the comparison."""
    nothing = Errors(float("nan"), float("nan"))
    channels = {}
    prismatic = {joint.name for joint in robot.drives if joint.kind == "prismatic"}
    for k, channel in enumerate(rows[0].channels):
        if any(own.counted[:, k].any() for own in rows):
            unit = unit_of(channel, prismatic=channel.split(".")[0] in prismatic)
            channels[channel] = ChannelFit(unit, nothing, nothing, float(rows[0].noise[k]))
    return Fit(channels, 0.0, tuple(own.band for own in rows))


def dismissed(found: Search[Any], findings: Sequence[Finding]) -> list[str]:
    """Sentences on effects that fit but are not credible."""
    named = {(f.effect, f.location) for f in findings}
    return [
        f"Not named: {get_effect(effect).title} at {place} fits, but {why}."
        for (effect, place), why in found.dismissed.items()
        if (effect, place) not in named
    ]


def _not_searched(robot: Robot, searched: Collection[str]) -> list[str]:
    """A sentence on effects that are possible but not visible in the compared channels, if there are any."""
    every = [effect for effect in catalogue().values() if not _is_searched(effect, robot)]
    titles = [effect.title.lower() for effect in every if effect.id not in searched]
    words = "Not searched for, since no torque along a recorded motion shows them"
    return [f"{words}: {', '.join(titles)}."] if titles else []


def _is_searched(effect: Effect, robot: Robot) -> bool:
    """Whether an effect is searched in torques, or impossible: a fixed base cannot turn, a free one float."""
    of_links = effect.along_link or effect.adds_coordinates
    if effect.turns_base and robot.base.kind == "fixed":
        return True
    if effect.adds_coordinates and effect.place == "base" and robot.base.kind == "free":
        return True
    return effect.is_searched and (not of_links or knows_links(robot))


def _notes(data: TorqueData, validated: bool, unnamed: bool) -> list[str]:
    band = data.runs[0].motion.cutoff
    notes = [f"Torques are compared below {band:.3g} Hz, five times the bandwidth of the motion."]
    if data.layout.scale.any():
        notes.append(
            "No torque is recorded and nothing drives the robot, so forces are known only relative to the "
            "masses of the robot file; the intervals of friction allow these an error of 10 %."
        )
    if unnamed:
        notes.append(
            "A robot file cannot hold a force without a name: the written one and all errors are without it."
        )
    if not validated:
        notes.append("A quarter of each recording was held out, in two stretches.")
    return notes


def rung(found: Search[Any], step: Step) -> Rung:
    """One trial of the search as listed in the report."""
    data, fit = found.data, step.fit
    fitted_blocks = data.fitted_blocks
    counts = np.maximum(data.counts, 1e-300)

    def whitened(which: np.ndarray) -> float:
        total = (fit.errors[which] / step.before.sigma**2).sum()
        return float(np.sqrt(total / max(counts[which].sum(), 1.0)))

    gain = found.score(fit) - found.score(step.before)
    effect, place = step.key
    kept = step.key in {term.key for term in found.best.hypothesis.terms}
    return Rung(
        effect=effect,
        location=place,
        added_to=tuple(f"{t.effect.id}@{t.at}" for t in step.before.hypothesis.terms),
        train_rms=whitened(fitted_blocks),
        validation_rms=whitened(~fitted_blocks),
        evidence=gain,
        kept=kept,
        why=f"log score {gain:+.1f} nats, prior included",
    )

"""The chain from recordings to a diagnosis."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis import words
from missing_physics.diagnosis.augment import augmented_robot, with_inertial
from missing_physics.diagnosis.excitation import Excitation, judge_excitation
from missing_physics.diagnosis.experiments import design_experiments
from missing_physics.diagnosis.explanation import Explanation, View, explain
from missing_physics.diagnosis.judge import beyond_noise, findings_of, reweighed, verdict_of, weigh
from missing_physics.diagnosis.locate import locate
from missing_physics.diagnosis.merge import with_transmission
from missing_physics.diagnosis.model import FinalModel
from missing_physics.diagnosis.naming import Progress, Search, name_effects
from missing_physics.diagnosis.nominal import NominalCheck, check_nominal
from missing_physics.diagnosis.problem import Problem, Segment
from missing_physics.diagnosis.prove import HeldOut, held_out_blocks, proven
from missing_physics.diagnosis.replaced import contests_of, settled, with_history
from missing_physics.diagnosis.reproduction import Reproduction, reproduction
from missing_physics.diagnosis.result import (
    Diagnosis,
    Finding,
    Fit,
    Mismatch,
    Result,
    Rung,
    Stage,
)
from missing_physics.diagnosis.reversals import explain_reversals
from missing_physics.diagnosis.setup import (
    InertialBasis,
    build_problem,
    inertial_basis,
    make_segments,
    nominal_terms,
)
from missing_physics.diagnosis.simulation import Given, Simulated, refit_in_simulation
from missing_physics.diagnosis.simulation_results import refined
from missing_physics.diagnosis.statistics import effective_samples
from missing_physics.diagnosis.terms import Term
from missing_physics.diagnosis.torque_scores import TorqueScores
from missing_physics.diagnosis.transmission import diagnose_transmission
from robot_model import Recording, Robot, robot_to_toml

__all__ = ["Options", "diagnose"]

Array = NDArray[np.float64]

#: Standard deviation by which an inertial combination may credibly be off, as a part of its own size.
CREDIBLE_CHANGE = 0.3


@dataclass(frozen=True)
class Options:
    """Choices of a diagnosis.

    Attributes:
        cutoff: of the low-pass filter [Hz]; found from the data when None.
        seed: of everything that involves chance.
        experiments: whether separating motions are designed.
        simulation: whether what was found is refitted in simulation, where that is possible.
    """

    cutoff: float | None = None
    seed: int = 0
    experiments: bool = True
    simulation: bool = True


def diagnose(
    robot: Robot,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    *,
    options: Options | None = None,
    progress: Callable[[str], None] | None = None,
) -> Result:
    """Find what the robot's description leaves out.

    Args:
        robot: the nominal robot.
        recordings: what is fitted; must hold every moving joint's position.
        validation: what is only scored; when empty, one stretch in four of each recording is held out.
        options: see `Options`.
        progress: called with a phrase whenever something new is tried.

    Raises:
        InputError: a recording lacks what a diagnosis needs.
    """
    began = time.monotonic()
    chosen = options or Options()
    tell: Progress = progress or (lambda phrase: None)
    tell("estimating motion and torque")
    segments = make_segments(robot, [*recordings, *validation], cutoff=chosen.cutoff)
    fitted, scored = segments[: len(recordings)], segments[len(recordings) :]
    excitation = judge_excitation(robot, fitted)
    names = tuple(r.source for r in recordings), tuple(r.source for r in validation)
    gap = diagnose_transmission(
        robot, recordings, validation, segments=segments, seed=chosen.seed, progress=tell
    )
    if not excitation.enough:
        alone = _without_data(robot, names, excitation)
        return replace(with_transmission(alone, gap, robot), seconds=time.monotonic() - began)
    basis = inertial_basis(robot, fitted)
    problem = build_problem(fitted, basis, seed=chosen.seed)
    other = build_problem(scored, basis, seed=chosen.seed) if scored else None
    work = _Work(robot, names, problem, other, basis, excitation, chosen, tell)
    work.recordings = tuple(recordings), tuple(validation), segments
    tell("simulating the robot as described")
    work.reproduced = reproduction(robot, [*recordings, *validation])
    return replace(with_transmission(work.run(), gap, robot), seconds=time.monotonic() - began)


class _Work:
    """One diagnosis under way."""

    def __init__(
        self,
        robot: Robot,
        names: tuple[tuple[str, ...], tuple[str, ...]],
        problem: Problem,
        validation: Problem | None,
        basis: InertialBasis,
        excitation: Excitation,
        options: Options,
        progress: Progress,
    ) -> None:
        self.robot, self.names, self.problem, self.basis = robot, names, problem, basis
        self.recordings: tuple[Sequence[Recording], Sequence[Recording], Sequence[Segment]] = ((), (), ())
        self.excitation, self.options, self.progress = excitation, options, progress
        self.reproduced: Reproduction | None = None
        held = held_out_blocks(problem) if validation is None else None
        train = np.ones(problem.time.size, dtype=bool) if held is None else ~held
        self.validation = validation or problem
        scored = np.ones(self.validation.time.size, dtype=bool) if held is None else held
        self.train, self.scored = train, scored
        scale, memory = self._scale(train)
        self.view = View(scale, train, prior=memory / CREDIBLE_CHANGE**2)
        self.held_out = HeldOut(self.validation, scored, self.view.scale)
        self.scores = TorqueScores(robot, problem, train, self.validation, scored, self.held_out)

    def _scale(self, rows: NDArray[np.bool_]) -> tuple[Array, float]:
        """Error scale of each joint, and rows per independent row.

        The scale is what simple friction and free inertia leave, at least the noise.
        """
        problem = self.problem
        speed = np.maximum(np.abs(problem.velocity).max(0), 1e-12)
        scale, memories = np.ones(len(problem.joints)), [1.0]
        for index in range(scale.size):
            velocity = problem.velocity[:, index] / speed[index]
            moving = rows & (problem.sliding[:, index] > 0)
            if not moving.any():
                continue
            simple = [np.sign(velocity), velocity, np.abs(velocity), np.ones(velocity.size)]
            shape = np.column_stack([problem.nuisance[:, index], *simple])[moving]
            target = problem.residual[moving, index]
            left = target - shape @ np.linalg.lstsq(shape, target, rcond=1e-10)[0]
            scale[index] = max(float(np.sqrt(np.mean(left**2))), float(problem.noise_floor[index]), 1e-300)
            memories.append(left.size / effective_samples(left))
        return scale, float(np.mean(memories))

    def run(self) -> Result:
        terms = nominal_terms(self.robot)
        untouched = explain(self.problem, self.view, [replace(t, frozen=True) for t in terms], nuisance=False)
        mismatch = self._located(untouched)
        search, check = self._named(terms, untouched)
        free = check.free
        wrong = {t.key for t in check.wrong}
        history = (self.problem, self.view)
        best, kept = settled(*history, check.explanation, search.stages, self.held_out, nuisance=free)
        best, weighed = weigh(
            self.problem,
            self.view,
            best,
            nuisance=free,
            progress=self.progress,
            settled={contest.later.key for contest in kept},
        )
        best, reversals = explain_reversals(
            self.problem, self.view, best, nuisance=free, progress=self.progress
        )
        best, gains, dropped = proven(best, best.view, self.held_out, nuisance=free)
        weighed = reweighed(best, weighed)
        won = contests_of(self.problem, best.view, best, search.stages, self.held_out, nuisance=free)
        model = FinalModel(self.robot, self.basis, best, nuisance=free)
        findings = with_history(findings_of(model, weighed, gains), (*kept, *won))
        fit, explained = self.scores.fit(untouched, model.explanation)
        told = tuple(m for m in mismatch if self._told(m))
        changed, remark = self._augmented(model.explanation)
        ladder = (*search.ladder, *check.ladder, *reversals)
        simulated = self._simulated(best, changed, free, ladder, mismatch, findings, fit)
        if simulated.climb is not None:
            findings = refined(findings, simulated.climb, ladder)
            ladder = (*ladder, *simulated.climb.rungs)
        fit = replace(fit, channels={**fit.channels, **simulated.channels})
        verdict = verdict_of(findings, mismatch, explained_part=explained)
        self.progress("designing separating motions")
        experiments, motions = (
            design_experiments(self.robot, self.problem, best, weighed, seed=self.options.seed)
            if self.options.experiments
            else ((), {})
        )
        left = self._located(model.explanation)
        notes = [*words.method_notes(self.problem, self.names), *([remark] if remark else [])]
        if self._complete and self.reproduced is not None:
            notes.append(self.reproduced.words)
        stages = tuple(self._stage(stage) for stage in search.stages)
        diagnosis = Diagnosis(
            robot=self.robot.name,
            recordings=self.names[0],
            validation=self.names[1],
            verdict=verdict,
            summary=words.summary(self.robot, verdict, mismatch, findings, fit),
            mismatch=told,
            findings=findings,
            fit=fit,
            experiments=experiments,
            could_not_tell=(
                *self.excitation.sentences,
                *words.dropped(dropped),
                *words.unproven(search.ladder, findings),
                *words.blind(model.explanation),
                *words.remaining(left, fit),
            ),
            nominal_parameters=(*model.nominal_parameters(wrong), *simulated.numbers),
            stages=(*stages, *simulated.stages),
            notes=(*notes, *simulated.notes),
        )
        return Result(
            diagnosis=diagnosis,
            series=(*self.scores.series(untouched, model.explanation), *simulated.series),
            ladder=ladder,
            augmented_robot_toml=robot_to_toml(simulated.robot),
            experiment_motions=motions,
        )

    @property
    def _complete(self) -> bool:
        """Whether the nominal robot's own run leaves nothing beyond noise."""
        return self.reproduced is not None and self.reproduced.complete

    def _located(self, explanation: Explanation) -> tuple[Mismatch, ...]:
        if self._complete:
            return ()
        return locate(self.problem, self.robot, explanation.residual)

    def _named(self, terms: Sequence[Term], untouched: Explanation) -> tuple[Search, NominalCheck]:
        """What the search finds; nothing where the robot as described does all that was recorded."""
        if self._complete:
            return Search(untouched, untouched), NominalCheck((), untouched, (), free=False)
        search = name_effects(
            self.problem, self.view, terms, proof=self.held_out.refusal, progress=self.progress
        )
        return search, check_nominal(self.problem, self.view, search, self.progress)

    def _simulated(
        self,
        best: Explanation,
        robot: Robot,
        nuisance: bool,
        ladder: Sequence[Rung],
        mismatch: Sequence[Mismatch],
        findings: Sequence[Finding],
        fit: Fit,
    ) -> Simulated:
        """The refit in simulation, where something differs or was named."""
        if not self.options.simulation:
            return Simulated(robot)
        places = {m.location for m in beyond_noise(mismatch)}
        places |= {finding.location.split(".")[0] for finding in findings}
        given = Given(
            nominal=self.robot,
            robot=robot,
            recordings=self.recordings[0],
            validation=self.recordings[1],
            segments=self.recordings[2],
            problem=self.problem,
            best=best,
            nuisance=nuisance,
            ladder=ladder,
            joints=places,
            finished=words.down_to_noise(fit),
            seed=self.options.seed,
        )
        return refit_in_simulation(given, self.progress)

    @staticmethod
    def _told(item: Mismatch) -> bool:
        return item.p_value < 0.05

    def _stage(self, reached: Explanation) -> Stage:
        model = FinalModel(self.robot, self.basis, reached, nuisance=True, usual=True)
        errors = {}
        whole = model.explanation.residual, self.held_out.residual(model.explanation)
        for index, joint in enumerate(self.problem.joints):
            if self.problem.usable[index]:
                errors[f"{joint}.torque"] = self.scores.relative(whole, index)
        return Stage(
            effects=tuple(term.label for term in reached.found),
            parameters={term.label: model.estimates(term) for term in model.explanation.terms},
            nominal_parameters=model.inertial_parameters(),
            relative_error=errors,
        )

    def _augmented(self, best: Explanation) -> tuple[Robot, str]:
        changed = augmented_robot(self.robot, best.terms)
        size = best.nuisance.size
        if size == 0 or best.regression.wald_p_value(np.arange(size)) > 0.01:
            return changed, ""
        return with_inertial(changed, self.basis.names, self.basis.directions @ best.nuisance)


def _without_data(
    robot: Robot, names: tuple[tuple[str, ...], tuple[str, ...]], excitation: Excitation
) -> Result:
    """The answer when the recording cannot support any statement."""
    diagnosis = Diagnosis(
        robot=robot.name,
        recordings=names[0],
        validation=names[1],
        verdict="not_enough_data",
        summary="The recording cannot support any statement: " + " ".join(excitation.sentences),
        mismatch=(),
        findings=(),
        fit=Fit({}, 0.0),
        could_not_tell=excitation.sentences,
    )
    return Result(diagnosis, (), (), robot_to_toml(robot))

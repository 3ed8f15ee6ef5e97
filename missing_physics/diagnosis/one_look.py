"""From motion and torques of all recordings to an answer: steps 3 to 7 of the chain, at one cut-off."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial

from missing_physics.diagnosis.coverage import Coverage
from missing_physics.diagnosis.elastic_gears import with_elastic_gears
from missing_physics.diagnosis.experiments.design import design_experiments
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.location.residual import locate
from missing_physics.diagnosis.named import Named
from missing_physics.diagnosis.naming.final_model import FinalModel
from missing_physics.diagnosis.naming.judge import beyond_noise, findings_of, reweighed, verdict_of, weigh
from missing_physics.diagnosis.naming.kinship import contested
from missing_physics.diagnosis.naming.needless import without_needless
from missing_physics.diagnosis.naming.nominal import NominalCheck, check_nominal
from missing_physics.diagnosis.naming.replaced import contests_of, settled, with_history
from missing_physics.diagnosis.naming.reversals import explain_reversals
from missing_physics.diagnosis.naming.search import Progress, Search, name_effects
from missing_physics.diagnosis.options import Options
from missing_physics.diagnosis.passive.results import PassiveResult
from missing_physics.diagnosis.preparation.proof import proven
from missing_physics.diagnosis.preparation.setup import InertialBasis, nominal_terms
from missing_physics.diagnosis.preparation.split import Split
from missing_physics.diagnosis.preparation.tangent import about_the_fit, better
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.reproduction import Reproduction
from missing_physics.diagnosis.run_search.masses import masses_told
from missing_physics.diagnosis.run_search.mismatch import differing_in_runs
from missing_physics.diagnosis.run_search.rescue import completed, proved, rescued
from missing_physics.diagnosis.run_search.search import found_by_runs
from missing_physics.diagnosis.run_search.sizes import sure_of_size
from missing_physics.diagnosis.runs.confirmation import arbitrated, refused_in_runs
from missing_physics.diagnosis.runs.numbers import plainer, surest
from missing_physics.diagnosis.runs.rivals import with_equals, without_beaten
from missing_physics.diagnosis.runs.scores import scored
from missing_physics.diagnosis.runs.torque_scores import TorqueScores
from missing_physics.diagnosis.simulation.refinement import Given, Simulated, refit_in_simulation
from missing_physics.diagnosis.simulation.results import refined
from missing_physics.diagnosis.terms.real_bodies import UNREAL, unreal
from missing_physics.diagnosis.unnamed.adequacy import (
    Accounts,
    accounts_of,
    adequate,
    believed,
    left_by,
    told_by_torque,
)
from missing_physics.diagnosis.unnamed.findings import unnamed
from missing_physics.diagnosis.written import words
from missing_physics.diagnosis.written.robots import Robots
from missing_physics.diagnosis.written.statement import stated
from missing_physics.results.result import Diagnosis, Finding, Fit, Mismatch, Result, Rung
from robot_model import Recording, Robot, robot_to_toml

__all__ = ["OneLook"]

#: Mismatches with a greater p-value are not told.
TOLD = 0.05
#: Times that effects are named anew about other inertial numbers.
LINEARISATIONS = 2
#: Rounds in which runs decide between names and their rivals.
ARBITRATIONS = 2


class OneLook:
    """One diagnosis under way."""

    def __init__(
        self,
        robot: Robot,
        names: tuple[tuple[str, ...], tuple[str, ...]],
        data: Split,
        basis: InertialBasis,
        covered: Coverage,
        options: Options,
        progress: Progress,
    ) -> None:
        self.robot, self.names, self.basis = robot, names, basis
        self.recordings: tuple[Sequence[Recording], Sequence[Recording], Sequence[Segment]] = ((), (), ())
        self.covered, self.options, self.progress = covered, options, progress
        self.reproduced: Reproduction | None = None
        self.replay: Replay | None = None
        self.passive = PassiveResult()
        self.between = False
        self.nominal, self.data, self.given = data, data, data
        self.scores = TorqueScores(robot, data, data)

    def run(self) -> Result:
        nominal = self.nominal
        frozen = [replace(t, frozen=True) for t in nominal_terms(self.robot)]
        untouched = explain(nominal.problem, nominal.view, frozen, nuisance=False)
        mismatch = self._differing(untouched)
        self.data, search, check = self._named(untouched)
        self.scores = TorqueScores(self.robot, self.data, nominal)
        problem, view, held_out = self.data.problem, self.data.view, self.data.held_out
        free = check.free
        wrong = {t.key for t in check.wrong}
        best, kept = settled(problem, view, check.explanation, search.stages, held_out, nuisance=free)
        refused = {contest.later.key for contest in kept}
        tell = self.progress
        best, weighed = weigh(
            problem, view, best, nuisance=free, progress=tell, settled=refused, proof=held_out.refusal
        )
        best, reversals, contests = explain_reversals(best, held_out, nuisance=free, progress=tell)
        best, needless = without_needless(best, wrong, nuisance=free)
        best, gains, dropped = proven(best, best.view, held_out, nuisance=free)
        self.progress("comparing each name with curves without a law")
        before = left_by(untouched, nominal.held_out)
        now = Named(best, free, weighed, gains, before)
        self._held_against_curves(now, search, untouched)
        contest = contested(now.best, self.data.held_out, contests, nuisance=now.free)
        now.weighed = reweighed(now.best, now.weighed, contest)
        self._by_runs(now, untouched)
        self._searched_by_runs(now, search, untouched)
        best, free, accounts = now.best, now.free, now.accounts
        problem, held_out = self.data.problem, self.data.held_out
        won = contests_of(problem, best.view, best, search.stages, held_out, nuisance=free)
        model = FinalModel(self.robot, self.basis, best, nuisance=free)
        findings = with_history(findings_of(model, now.weighed, now.gains), (*kept, *won))
        real = self._real(best)
        score = scored(self.scores, untouched, model.explanation, self.replay, real, self.passive.gone)
        findings = with_elastic_gears(believed(findings, accounts), problem)
        changed, unreal_bodies = self._robots.running(model.explanation)
        ran = real if score.by_runs else None
        written, remark = self._robots.of_file(model.explanation, self.data, ran)
        ladder = (*self.passive.ladder, *search.ladder, *check.ladder, *reversals)
        emptied = {t.at.split(".")[0] for t, _ in now.refused} - {t.at.split(".")[0] for t in best.found}
        closed = told_by_torque(self.data.problem, accounts, emptied)
        robots = changed, written
        simulated = self._simulated(best, robots, free, ladder, closed, mismatch, findings, score.fit)
        if simulated.climb is not None:
            findings = refined(findings, simulated.climb, ladder)
            ladder = (*ladder, *simulated.climb.rungs)
        told_by = written if simulated.robot is changed else simulated.robot
        again = remark != "" or told_by is not written
        fit, series = stated(told_by, self.recordings, score.fit, score.series, otherwise=again)
        findings = (*self.passive.findings, *findings)
        located = mismatch
        if not (self.between or self._complete or beyond_noise(mismatch)):
            located = differing_in_runs(self.replay) or mismatch
        fit = replace(fit, channels={**fit.channels, **simulated.channels, **(self.passive.fit or {})})
        verdict = verdict_of(findings, mismatch if findings else located, explained_part=score.explained)
        done = self._complete or self.passive.whole or score.by_runs
        more = () if done or verdict == "consistent" else unnamed(best, accounts)
        self.progress("designing separating motions")
        experiments, motions = (
            design_experiments(self.robot, problem, best, now.weighed, seed=self.options.seed)
            if self.options.experiments
            else ((), {})
        )
        left = () if done else self._located(model.explanation)
        notes = [*words.method_notes(problem, self.names), *([remark] if remark else []), *score.notes]
        if self._complete and self.reproduced is not None:
            notes.append(self.reproduced.words)
        usual = partial(FinalModel, self.robot, self.basis, nuisance=True, usual=True)
        stages = tuple(self.scores.stage(usual(reached)) for reached in search.stages)
        diagnosis = Diagnosis(
            robot=self.robot.name,
            recordings=self.names[0],
            validation=self.names[1],
            verdict=verdict,
            summary=words.summary(self.robot, verdict, located, findings, fit, more),
            mismatch=tuple(m for m in located if m.p_value < TOLD),
            findings=findings,
            fit=fit,
            experiments=experiments,
            could_not_tell=(
                *self.covered.sentences,
                *words.dropped((*needless, *dropped, *now.refused, *now.needless), best),
                *words.unproven(search.ladder, findings),
                *words.unseen(best, held_out),
                *words.blind(model.explanation),
                *words.remaining(left, fit),
            ),
            unnamed=more,
            nominal_parameters=(*model.nominal_parameters(wrong), *simulated.numbers),
            stages=(*stages, *simulated.stages),
            notes=(*notes, *simulated.notes),
        )
        return Result(
            diagnosis=diagnosis,
            series=(*series, *simulated.series),
            ladder=ladder,
            augmented_robot_toml=robot_to_toml(simulated.robot),
            real=not unreal_bodies,
            experiment_motions=motions,
            stated=told_by,
            explained=score.explained,
            runs_whole=score.by_runs,
        )

    @property
    def _complete(self) -> bool:
        """Whether the nominal robot's own run leaves nothing beyond noise."""
        return self.reproduced is not None and self.reproduced.complete

    def _held_against_curves(self, now: Named, search: Search, untouched: Explanation) -> None:
        """Names for which curves without a law would do go, unless runs prove them or what was refused."""
        named, held_out = now.best, self.data.held_out
        now.best, now.accounts, now.refused = adequate(named, held_out, before=now.before, nuisance=now.free)
        if now.refused and proved(self.replay, search.start, named, self._real):
            now.best, now.refused, now.by_runs = named, (), True
            now.accounts = Accounts({}, accounts_of(named, held_out, now.before).left)
        worse = sum(item.left - now.before[k] for k, item in now.accounts.left.items()) > 0
        saved = None
        if not now.best.found:
            saved = rescued(self.replay, search, named, self._real, self.progress)
        if saved is not None:
            now.refused = ()
            self._proven_by_runs(now, saved)
        if not now.best.found and (now.refused or worse or self.passive.gone > 0):
            self._without_names(now, untouched)  # runs tell nominal numbers better

    def _by_runs(self, now: Named, untouched: Explanation) -> None:
        """What runs say of the names: rivals, what is not enough, or needless, and what moves otherwise."""
        plain = plainer(self.replay, now.best, self._real)
        if plain is not now.best:
            now.best, now.free = plain, False
        run = self._arbitrated(now)
        more = completed(self.replay, run, self._real, self.progress)
        if more is not None and more.whole:
            self._proven_by_runs(now, more.explanation)
            run = self._arbitrated(now)
        elif more is not None:
            run = more.explanation
        if run is not now.best:
            known = {term.key for term in now.best.found}
            now.best, now.free = run, now.free and run.nuisance.size > 0
            if not now.by_runs:  # what runs put in another's place is proven by them, too
                accounts = accounts_of(run, self.data.held_out, now.before)
                weights = {key: account for key, account in accounts.terms.items() if key in known}
                now.accounts = replace(accounts, terms=weights)
            _, now.gains, _ = proven(run, run.view, self.data.held_out, nuisance=now.free)
        for last in (False, True):  # once more with the numbers that runs tell
            final = partial(FinalModel, self.robot, self.basis, nuisance=now.free)
            now.best, now.weighed, gone = sure_of_size(
                run, now.weighed, self.replay, self._real, final, nuisance=now.free, progress=self.progress
            )
            now.needless = (*now.needless, *gone)
            if last and not gone:
                break
            if not now.best.found:
                self._without_names(now, untouched)
            now.renumber(surest(self.replay, now.best, self._real))
            run = now.best
        # what lies between encoders is not complete yet: see `confirmed`
        refuted = "" if self.between else refused_in_runs(self.replay, now.best, self._real)
        if any(unreal(self.robot, term) for term in now.best.found):
            refuted = UNREAL
        if refuted:
            now.refused, now.weighed = (*now.refused, *((term, refuted) for term in now.best.found)), ()
            self._without_names(now, untouched)

    def _searched_by_runs(self, now: Named, search: Search, untouched: Explanation) -> None:
        """What a search by runs alone finds, beside what is named where that leaves much."""
        if self.passive.findings or self.between or self._complete:
            return
        nothing = search.start if search.start.problem is self.data.problem else untouched
        best = now.best if now.best.found else nothing
        if found := found_by_runs(self.replay, best, nothing, self.basis, self._real, self.progress):
            now.beaten, now.beside = found.beaten, found.beside
            now.refused = ()  # refused beside other names, if at all
            self._proven_by_runs(now, found.explanation)
            if not found.weighed:
                self._by_runs(now, untouched)
            now.weighed = found.weighed or with_equals(now.weighed, found.name, found.equals)

    def _arbitrated(self, now: Named) -> Explanation:
        """After an exchange once more: what came in has rivals of its own, and so has what is left."""
        fewest, tell = 0 if self.passive.terms else 1, self.progress
        run, now.weighed, needless = masses_told(self.replay, now.best, now.weighed, self._real, tell)
        now.needless, known = (*now.needless, *needless), {term.key for term in run.found}
        for k in range(ARBITRATIONS):
            if k > 0:
                self._weigh_anew(now, run, nuisance=now.free and run.nuisance.size > 0)
            run, now.weighed, needless = arbitrated(
                self.replay, run, now.weighed, self._real, nuisance=now.free, progress=tell, fewest=fewest
            )
            now.needless = (*now.needless, *needless)
            if {term.key for term in run.found} == known or not run.found:
                break
        return run

    def _weigh_anew(self, now: Named, best: Explanation, *, nuisance: bool) -> None:
        """Names beside each other as they stand; a regression compares them with numbers as it finds them."""
        free = explain(best.problem, best.view, [t.released for t in best.terms], nuisance=nuisance)
        tell, named = self.progress, {term.key: term for term in best.found}
        _, items = weigh(best.problem, best.view, free, nuisance=nuisance, progress=tell, exchange=False)
        items = tuple(replace(item, term=named[item.term.key]) for item in items)
        now.weighed = without_beaten(items, now.beaten, now.beside)

    def _proven_by_runs(self, now: Named, best: Explanation) -> None:
        """Names that runs prove need no account along the motion."""
        now.best, now.free, now.by_runs = best, best.nuisance.size > 0, True
        now.accounts = Accounts({}, accounts_of(best, self.data.held_out, now.before).left)
        self._weigh_anew(now, best, nuisance=now.free)
        _, now.gains, _ = proven(best, best.view, self.data.held_out, nuisance=now.free)

    def _without_names(self, now: Named, untouched: Explanation) -> None:
        now.best, now.free = self._as_described(untouched), False
        now.accounts = accounts_of(now.best, self.data.held_out, now.before)

    def _as_described(self, untouched: Explanation) -> Explanation:
        """The robot as described, with what runs told: with names go the numbers that were tuned beside them.

        What is estimated from here on starts from it, too.
        """
        self.data = self.given
        self.scores = TorqueScores(self.robot, self.data, self.nominal)
        if not self.passive.terms:
            return untouched
        return explain(self.data.problem, self.data.view, untouched.terms, nuisance=False)

    def _located(self, explanation: Explanation) -> tuple[Mismatch, ...]:
        return () if self._complete else locate(explanation.problem, self.robot, explanation.residual)

    def _differing(self, untouched: Explanation) -> tuple[Mismatch, ...]:
        """Where the nominal robot differs: in the fitted data, or else in the held-out recordings."""
        fitted = self._located(untouched)
        if self._complete or beyond_noise(fitted) or self.nominal.validation is self.nominal.problem:
            return fitted
        held_out = self.nominal.held_out
        found = locate(held_out.problem, self.robot, held_out.residual(untouched))
        elsewhere = tuple(replace(m, words=f"in the held-out recording, {m.words}") for m in found)
        return elsewhere if beyond_noise(elsewhere) else fitted

    def _named(self, untouched: Explanation) -> tuple[Split, Search, NominalCheck]:
        """Effects and wrong numbers, with everything linearised about the numbers that they come to.

        Nothing where the robot as described, or with what runs told, does all that was recorded.
        """
        data = self.given
        if self._complete or self.passive.whole:
            if self.passive.whole:  # without what is missing
                untouched = explain(data.problem, data.view, untouched.terms, nuisance=False)
            return data, Search(untouched, untouched), NominalCheck((), untouched, (), free=False)
        search, check = self._name(data)
        for _ in range(0 if self.passive.terms else LINEARISATIONS):
            moved = about_the_fit(data, self.basis, check.explanation, check.free, seed=self.options.seed)
            if moved is None:
                break
            self.progress("linearising about other masses and inertias")
            again, checked = self._name(moved)
            if not better(checked.explanation, check.explanation):
                break
            data, search, check = moved, again, checked
        return data, search, check

    def _name(self, data: Split) -> tuple[Search, NominalCheck]:
        terms = nominal_terms(self.robot)
        search = name_effects(
            data.problem, data.view, terms, proof=data.held_out.refusal, progress=self.progress
        )
        return search, check_nominal(data.problem, data.view, search, self.progress)

    def _simulated(
        self,
        best: Explanation,
        robots: tuple[Robot, Robot],
        nuisance: bool,
        ladder: Sequence[Rung],
        closed: Collection[str],
        mismatch: Sequence[Mismatch],
        findings: Sequence[Finding],
        fit: Fit,
    ) -> Simulated:
        """The refit in simulation, where something differs or was named, but not at `closed` joints.

        It starts from the first of `robots`, and free runs are scored with the second where it changes none.
        """
        places = {m.location for m in beyond_noise(mismatch)} | {f.location.split(".")[0] for f in findings}
        places &= set(self.data.problem.joints) - set(closed)
        given = Given(
            nominal=self.robot,
            robot=robots[0],
            written=robots[1],
            replay=self.replay,
            recorded=self.recordings,
            problem=self.data.problem,
            best=best,
            nuisance=nuisance,
            ladder=ladder,
            joints=places if self.options.simulation else (),
            finished=words.down_to_noise(fit),
            seed=self.options.seed,
        )
        return refit_in_simulation(given, self.progress)

    @property
    def _robots(self) -> Robots:
        return Robots(self.robot, self.basis, self.passive.terms)

    def _real(self, best: Explanation) -> Robot | None:
        return self._robots.real(best)

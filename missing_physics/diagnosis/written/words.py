"""Sentences of a diagnosis, for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from missing_physics.diagnosis.candidates.fitted import blind_parameters
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.preparation.proof import UNCONFIRMED, HeldOut
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Finding, Fit, Mismatch, Rung, Unnamed, Verdict
from reference_model.effects.catalogue import catalogue
from robot_model import Robot

__all__ = [
    "blind",
    "down_to_noise",
    "dropped",
    "inertial_unit",
    "labelled",
    "method_notes",
    "remaining",
    "summary",
    "title",
    "unproven",
    "unseen",
]

#: Why a name goes that no run needs.
NO_RUN_NEEDS = (
    "run in closed loop without it, the robot reproduces every recorded channel to within the sensors' noise"
)
HINDERS_RUNS = "run in closed loop without it, the robot comes closer to every recording than with it"

#: A joint whose residual exceeds its noise floor by this factor is said to hold more.
ABOVE_NOISE = 1.2


def inertial_unit(name: str) -> str:
    """Unit of an inertial number of `RobotModel.inertial_names`."""
    if name.endswith(".mass"):
        return "kg"
    return "kg m" if ".first_moment" in name else "kg m^2"


def summary(
    robot: Robot,
    verdict: Verdict,
    mismatch: Sequence[Mismatch],
    findings: Sequence[Finding],
    fit: Fit,
    unnamed: Sequence[Unnamed] = (),
) -> str:
    """One paragraph."""
    sentences = [*_sentences(robot, verdict, mismatch, findings, fit)]
    if unnamed and findings and verdict != "unexplained":
        sentences.append("Part of the mismatch has no name.")
    return " ".join([*sentences, *(item.words for item in unnamed)])


def _sentences(
    robot: Robot, verdict: Verdict, mismatch: Sequence[Mismatch], findings: Sequence[Finding], fit: Fit
) -> Iterator[str]:
    if verdict == "consistent":
        bend = " and the error of the model of flexible links" if robot.flexible_links else ""
        yield f"The recording agrees with {robot.name} to within the sensors' noise{bend}."
        return
    if mismatch:
        yield "Where it differs: " + mismatch[0].words
    if findings:
        names = [f"{title(f.effect)} at {f.location} ({f.probability:.0%})" for f in findings]
        yield "What is missing: " + ", ".join(names) + "."
        change = "falls" if fit.validation_improvement >= 0.0 else "grows"
        yield f"On data that were not fitted the error {change} by {abs(fit.validation_improvement):.0%}."
    yield from _free_runs(fit)
    if verdict == "ambiguous":
        unsure = [f for f in findings if f.ambiguous_with]
        for finding in unsure:
            yield (
                f"{title(finding.effect)} at {finding.location} cannot be told apart from "
                f"{', '.join(finding.ambiguous_with)} with these data."
            )
    if verdict == "unexplained" and findings:
        yield "What is named is not sufficient, or is doubtful; the rest of the mismatch has no name."
    elif verdict == "unexplained":
        yield "The mismatch is real, and no effect of the catalogue explains it."


def _free_runs(fit: Fit) -> Iterator[str]:
    """What became of the positions in simulation."""
    for channel, errors in fit.channels.items():
        before, after = errors.before.validation_rms, errors.after.validation_rms
        if channel.endswith(".position") and after < before:
            yield (
                f"In free runs the error of {channel} falls from {before:.3g} to "
                f"{after:.3g} {errors.unit} rms."
            )


def down_to_noise(fit: Fit) -> bool:
    """Whether every channel is explained to about what its noise leaves, fitted and held out."""
    return all(
        max(c.after.train_rms, c.after.validation_rms) <= ABOVE_NOISE * c.noise_floor
        for c in fit.channels.values()
    )


def title(effect_id: str) -> str:
    """Name of an effect for people."""
    effect = catalogue().get(effect_id)
    return effect.title if effect else effect_id.replace("_", " ").capitalize()


def labelled(label: str) -> str:
    """``Coulomb friction at joint1`` of the label ``coulomb_friction@joint1``."""
    effect, _, place = label.partition("@")
    return f"{title(effect)} at {place}" if place else title(effect)


def dropped(terms: Sequence[tuple[Term, str]], best: Explanation) -> Iterator[str]:
    """What was fitted and then not believed, nor named by `best` in the end."""
    named = {term.key for term in best.found}
    for term, why in terms:
        if term.key not in named:
            yield f"{title(term.effect.id)} at {term.at} is not named: {why}."


def unproven(ladder: Sequence[Rung], found: Sequence[Finding]) -> Iterator[str]:
    """Effects with strong evidence in the fitted data that the held-out data did not confirm."""
    named = {(finding.effect, finding.location) for finding in found}
    told: set[tuple[str, str]] = set()
    for rung in ladder:
        key = (rung.effect, rung.location)
        if rung.kept or UNCONFIRMED not in rung.why or key in named or key in told:
            continue
        told.add(key)
        effect = catalogue().get(rung.effect)
        locked = effect is not None and any(p.name == "order" for p in effect.parameters)
        yield (
            f"{title(rung.effect)} at {rung.location} is not named: it fits the training data "
            f"(evidence {rung.evidence:.3g}) but {rung.why}."
            + (
                " Its phase is tied to the encoder's zero, which need not be the same in two recordings."
                if locked
                else ""
            )
        )


def unseen(explanation: Explanation, held_out: HeldOut) -> Iterator[str]:
    """Findings that do not act in the held-out data, events but for those, which say so themselves."""
    for term in explanation.found:
        if not term.effect.is_event and held_out.silent(explanation, term):
            yield (
                f"{title(term.effect.id)} at {term.at} does not act in the held-out data; it is proven on "
                "stretches of the fitted recording, each predicted from the others."
            )


def blind(explanation: Explanation) -> Iterator[str]:
    """Parameters of the findings on which the data hold no information."""
    for term in explanation.found:
        own = {p.name for p in term.effect.parameters}
        names = [n for n in (*term.unseen, *blind_parameters(explanation, term, told=True)) if n in own]
        if names:
            listed = ", ".join(name.replace("_", " ") for name in names)
            yield (
                f"{title(term.effect.id)} at {term.at}: the data do not determine its {listed}, "
                "left at zero or at a starting value."
            )


def remaining(left: Sequence[Mismatch], fit: Fit) -> Iterator[str]:
    """What is still above the noise after the findings."""
    for item in left:
        channel = fit.channels[item.channel]
        after, floor = channel.after.train_rms, channel.noise_floor
        if item.p_value > 0.01 or after < ABOVE_NOISE * floor:
            continue
        shape = item.words.split("; ", 1)[1] if "; " in item.words else "no dependence was found."
        yield (
            f"{item.channel}: {after:.3g} {channel.unit} rms remain in the fitted data against {floor:.3g} "
            f"{channel.unit} of sensor noise; of this remainder {shape}"
        )


def method_notes(problem: Problem, names: tuple[tuple[str, ...], tuple[str, ...]]) -> Iterator[str]:
    """How the data were treated."""
    low_pass = problem.segments[0].motion.low_pass
    yield (
        f"Motion and torque were compared below {low_pass.cutoff:.3g} Hz, at "
        f"{low_pass.rate / low_pass.stride:.4g} samples per second."
    )
    yield from dict.fromkeys(s.motion.remark for s in problem.segments if s.motion.remark)
    if names[1]:
        yield "Held-out errors are those of the validation recordings; nothing was refitted there."
    else:
        yield (
            "No validation recording was given, so one stretch in four of each recording was held out "
            "from every fit."
        )

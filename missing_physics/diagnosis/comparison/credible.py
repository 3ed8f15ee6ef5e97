"""Names and numbers that no machine has are not stated."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

from missing_physics.diagnosis.written import words
from missing_physics.diagnosis.written.bodies import NOT_REAL
from missing_physics.plausibility import NOT_CREDIBLE, before, implausible
from missing_physics.results.result import Finding, ParameterChange, Result, Rung
from missing_physics.results.samples import held_joints
from reference_model.dynamics.inertial import inertial_names, nominal_inertial
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from robot_model import Robot, robot_from_toml, robot_to_toml

__all__ = ["credible", "in_the_file", "with_priors"]

#: Ends of names of numbers that are not negative in any machine.
NEVER_NEGATIVE = (".mass", ".inertia.xx", ".inertia.yy", ".inertia.zz", ".reflected_inertia")


def credible(result: Result, robot: Robot) -> Result:
    """`result` without names that cannot be, and with a sentence on each explanation dismissed for that.

    Nor are names stated at joints of whose torque no fitted sample counts; what lies between two encoders
    is judged without it.

    Args:
        result: a diagnosis with its robot file.
        robot: as the user described it.
    """
    told = result.diagnosis
    held = held_joints(result.rows)
    reasons = {(f.effect, f.location): _reason(f, robot) or _at_rest(f, held) for f in told.findings}
    gone = {key: why for key, why in reasons.items() if why}
    written = robot_from_toml(result.augmented_robot_toml)
    if gone:
        own = {(use.effect, use.at): use for use in robot.effects}
        kept = tuple(
            own.get((use.effect, use.at), use)
            for use in written.effects
            if (use.effect, use.at) not in gone or (use.effect, use.at) in own
        )
        written = written.model_copy(update={"effects": kept})
        result = replace(result, augmented_robot_toml=robot_to_toml(written))
    findings = tuple(with_priors(f, robot) for f in told.findings if (f.effect, f.location) not in gone)
    unreal = any(NOT_REAL in note for note in told.notes)
    diagnosis = replace(
        told,
        findings=findings,
        nominal_parameters=() if unreal else told.nominal_parameters,
        could_not_tell=(*told.could_not_tell, *_sentences(gone, result.ladder, findings)),
    )
    return replace(result, diagnosis=diagnosis)


def in_the_file(
    changes: Sequence[ParameterChange], robot: Robot, *, standard: bool
) -> tuple[ParameterChange, ...]:
    """Re-estimated numbers as the robot file that is written has them.

    Data tell combinations of masses and inertias; a single number of an estimate may be none of a body, as a
    moment of inertia below nothing. The file holds real bodies, and numbers that it does not hold are not
    stated.

    Args:
        changes: numbers as estimated.
        robot: the file.
        standard: whether it holds the standard model or the robot as described instead of the answer.
    """
    if standard:
        return ()
    held = dict(zip(inertial_names(robot), nominal_inertial(robot)))
    stated = []
    for change in changes:
        value = held.get(change.name, change.estimate)
        low, high = change.ci95
        if change.name.endswith(NEVER_NEGATIVE):
            low = max(low, 0.0)
        if low <= value <= high:
            stated.append(replace(change, estimate=value, ci95=(low, high)))
    return tuple(stated)


def with_priors(finding: Finding, robot: Robot) -> Finding:
    """A finding whose numbers tell where they could lie before, so that those that say nothing are seen."""
    return replace(
        finding,
        parameters={
            name: replace(estimate, prior95=before(finding.effect, finding.location, name, robot))
            for name, estimate in finding.parameters.items()
        },
    )


def _reason(finding: Finding, robot: Robot) -> str:
    values = {name: estimate.value for name, estimate in finding.parameters.items()}
    if finding.effect == "torque_saturation":  # judged where the torque that was needed is known
        return ""
    return implausible(finding.effect, finding.location, values, robot)


def _at_rest(finding: Finding, held: Collection[str]) -> str:
    """Why nothing is named at a joint that is held."""
    if isinstance(get_effect(finding.effect), GearEffect) or finding.location.split(".")[0] not in held:
        return ""
    return "no fitted recording moves that joint; it only yields to the motion of others"


def _sentences(
    gone: dict[tuple[str, str], str], ladder: Sequence[Rung], findings: Sequence[Finding]
) -> Iterator[str]:
    """On each explanation that was dismissed, once."""
    named = {(f.effect, f.location) for f in findings}
    reasons = dict(gone)
    for rung in ladder:
        if not rung.kept and rung.why.startswith(NOT_CREDIBLE):
            reasons.setdefault((rung.effect, rung.location), rung.why)
    for (effect, place), why in reasons.items():
        if (effect, place) not in named:
            yield f"Not named: {words.title(effect)} at {place} fits, but {why}."

"""What a refit in simulation changes in a diagnosis: findings, stages, numbers; contradictions are told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from missing_physics.diagnosis.free_run.numbers import adjustables
from missing_physics.diagnosis.naming.final_model import PRIOR_95
from missing_physics.diagnosis.naming.judge import AMBIGUOUS
from missing_physics.diagnosis.simulation.fit import CREDIBLE_CHANGE, Reached
from missing_physics.diagnosis.simulation.ladder import Climb, Entry
from missing_physics.results.result import (
    Alternative,
    Errors,
    Estimate,
    Finding,
    ParameterChange,
    Rung,
    Stage,
)
from missing_physics.wording.numbers import within_text
from reference_model.effects.catalogue import used_effects
from robot_model import Robot

__all__ = ["changed_numbers", "refined", "simulated_stages"]


def refined(findings: Sequence[Finding], climb: Climb, ladder: Sequence[Rung]) -> tuple[Finding, ...]:
    """The regression's findings with the numbers of the simulation, then what the simulation added."""
    if not climb.kept:
        return tuple(findings)
    present = {(use.effect, use.at) for use in climb.reached.robot.effects}
    found = [_refined(f, climb.reached) for f in findings if (f.effect, f.location) in present or _else(f)]
    known = {(f.effect, f.location) for f in found}
    gone = {(f.effect, f.location): f for f in findings}
    for entry in climb.entries:
        if entry.term.key in present and entry.term.key not in known:
            found.append(_added(entry, climb.reached, ladder, gone))
    return tuple(found)


def _else(finding: Finding) -> bool:
    """Whether a finding is none that a robot file can hold, so that no free run could remove it."""
    return finding.location.count(".") > 0


def _estimates(effect: str, at: str, reached: Reached) -> dict[str, Estimate]:
    start = f"{effect}@{at}."
    return {n.removeprefix(start): e for n, e in reached.estimates.items() if n.startswith(start)}


def _refined(finding: Finding, reached: Reached) -> Finding:
    own = _estimates(finding.effect, finding.location, reached)
    if not own:
        return finding
    words = []
    for name, estimate in own.items():
        before = finding.parameters.get(name)
        if before is None:
            continue
        apart = "" if before.ci95[0] <= estimate.value <= before.ci95[1] else ", which contradicts it"
        words.append(f"{name} {within_text(before.value, before.ci95, before.unit)}{apart}")
    note = "Refined in simulation; the regression gave " + "; ".join(words) + "." if words else ""
    return replace(finding, parameters={**finding.parameters, **own}, note=_joined(finding.note, note))


def _joined(*sentences: str) -> str:
    return " ".join(s for s in sentences if s)


def _added(
    entry: Entry, reached: Reached, ladder: Sequence[Rung], gone: Mapping[tuple[str, str], Finding]
) -> Finding:
    term = entry.term
    evidence = np.array([0.0, entry.evidence, *(e for _, e in entry.rivals)])
    odds = np.exp(np.clip(evidence - evidence.max(), -700, 0))
    probability = odds[1:] / odds.sum() * (1.0 - entry.p_value)
    rivals = [(t, float(p)) for (t, _), p in zip(entry.rivals, probability[1:])]
    alternatives = [
        Alternative(t.effect.id, t.at, p, f"free runs favour the finding (evidence {entry.evidence - e:.3g})")
        for (t, p), (_, e) in zip(rivals, entry.rivals)
    ]
    if entry.replaces is not None and entry.replaces.key in gone:
        alternatives.insert(0, _replaced(entry, gone[entry.replaces.key]))
    return Finding(
        effect=term.effect.id,
        location=term.at,
        probability=float(probability[0]),
        parameters=_estimates(term.effect.id, term.at, reached),
        ambiguous_with=tuple(t.label for t, p in rivals if p >= AMBIGUOUS),
        alternatives=tuple(alternatives),
        validation_improvement=1.0 - (entry.error_after / max(entry.error_before, 1e-300)) ** 2,
        note=_joined(_confirmed(entry), *_refused(term.key, ladder)),
    )


def _confirmed(entry: Entry) -> str:
    fall = 1.0 - entry.error_after / max(entry.error_before, 1e-300)
    return (
        f"Named in simulation: with it the position error of free runs that were not fitted falls by "
        f"{fall:.0%} (p = {entry.p_value:.2g})."
    )


def _refused(key: tuple[str, str], ladder: Sequence[Rung]) -> Iterator[str]:
    """What the regression had to say about an effect that it did not name."""
    tried = [r for r in ladder if (r.effect, r.location) == key and not r.kept]
    if tried:
        best = max(tried, key=lambda rung: rung.evidence)
        yield f"The regression refused it: {best.why} (evidence {best.evidence:.3g})."
    else:
        yield "The regression saw no reason to weigh it in full."


def _replaced(entry: Entry, before: Finding) -> Alternative:
    return Alternative(
        before.effect,
        before.location,
        entry.p_value,
        f"the regression named it; exchanged in simulation, where free runs that were not fitted err "
        f"{entry.error_before / max(entry.error_after, 1e-300):.3g} times as much with it",
    )


def changed_numbers(nominal: Robot, climb: Climb) -> tuple[ParameterChange, ...]:
    """Numbers of the nominal robot that were freed in simulation."""
    return _changes(nominal, climb.reached) if climb.kept else ()


def _changes(nominal: Robot, reached: Reached) -> tuple[ParameterChange, ...]:
    known, changes = adjustables(nominal), []
    for name, e in reached.estimates.items():
        if "@" not in name:
            before, half = known[name].value, PRIOR_95 * CREDIBLE_CHANGE * known[name].typical
            prior = before - half, before + half
            changes.append(
                ParameterChange(name, e.unit, before, e.value, e.ci95, "refined in simulation", prior)
            )
    return tuple(changes)


def simulated_stages(nominal: Robot, climb: Climb, levels: Sequence[Sequence[float]]) -> tuple[Stage, ...]:
    """One stage for every robot that was kept; `levels` are the rms positions of both parts, shape (2, n)."""
    own = {(use.effect, use.at) for use in nominal.effects}
    stages = []
    for _, reached in climb.kept:
        relative = reached.rms / np.maximum(np.asarray(levels), 1e-300)
        stages.append(
            Stage(
                effects=tuple(
                    f"{use.effect}@{use.at}"
                    for use in reached.robot.effects
                    if (use.effect, use.at) not in own
                ),
                parameters=_all_estimates(reached),
                nominal_parameters=_changes(nominal, reached),
                relative_error={
                    f"{joint.name}.position": Errors(float(relative[0, k]), float(relative[1, k]))
                    for k, joint in enumerate(nominal.moving_joints)
                },
            )
        )
    return tuple(stages)


def _all_estimates(reached: Reached) -> dict[str, dict[str, Estimate]]:
    """The refined parameters of every effect."""
    found = {}
    for used in used_effects(reached.robot):
        own = _estimates(used.effect.id, used.at, reached)
        if own:
            found[f"{used.effect.id}@{used.at}"] = own
    return found

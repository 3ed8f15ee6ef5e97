"""Missing effects, with their probabilities and alternatives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from missing_physics.answer.adequacy import adequacies
from missing_physics.answer.bodies import Load, is_on_body
from missing_physics.bodies.pseudo_inertia import COUNT
from missing_physics.hypotheses import BODIES, TIMING, Term
from missing_physics.inference import Fit, Posterior, absent
from missing_physics.inference.fit import FILE
from missing_physics.inference.ledger import unstated
from missing_physics.inference.torques.data import TorqueData
from missing_physics.results.comparison import Timing
from missing_physics.results.result import Alternative, Estimate, Finding, ParameterChange
from missing_physics.standard.model import EFFECTS
from reference_model.effects.base import Parameter, SensorEffect
from reference_model.effects.catalogue import catalogue, get_effect
from robot_model import Drive, Joint

__all__ = ["QUANTILE", "RIVAL", "STATED", "Answer", "answer_of", "is_large", "keys_of", "of_bodies"]

Array = NDArray[np.float64]
#: A finding, and the error energy that it explains.
Weighty = tuple[Finding, float]

#: Quantile of the 95 % interval.
QUANTILE = 1.96
#: A rival with at least this probability is not excluded, and makes a finding ambiguous: one in twenty.
RIVAL = 0.05
#: Prefix of the ids of unnamed forces.
UNNAMED = "unknown_"
#: Findings that are less probable than this are not reported.
STATED = 0.5
#: The effect of a parameter is rounding if below this fraction of another one's, at typical values [-].
ROUNDING = 1e-9
#: Delay of the only torque up to which it is attributed to recording [samples]: half by a hold, one by a bus.
LARGEST = 1.5
#: Effect and parameter for a torque recorded early: its command precedes its effect, or the encoder is late.
EARLY = "actuator_lag", "time_constant"


@dataclass(frozen=True)
class Answer:
    """The answer of a search.

    Attributes:
        fit: the most probable hypothesis.
        findings: missing effects, the one that removes most of the residual first.
        changes: re-estimated parameters of the robot file.
        timing: delays due to recording.
        named: effects of the findings that are parameters of the fit, with their values.
    """

    fit: Fit
    findings: tuple[Finding, ...]
    changes: tuple[ParameterChange, ...]
    timing: tuple[Timing, ...]
    named: dict[tuple[str, str], dict[str, float]]


def answer_of(
    data: TorqueData,
    known: Posterior,
    fit: Fit,
    bodies: Sequence[Weighty] = (),
    standard: Fit | None = None,
) -> Answer:
    """The answer from the weighed hypotheses.

    Args:
        data: the rows.
        known: the hypotheses.
        fit: the reported fit.
        bodies: findings about bodies (`of_bodies`).
        standard: the fit of the standard model.
    """
    found: list[Finding] = []
    for term in fit.hypothesis.terms:
        if term.effect.is_unknown or term.is_given:
            continue
        if bodies and is_on_body(term.effect):
            continue
        probability = _chance(data, known, term)
        if probability > STATED or (probability >= RIVAL and _rivals(data, known, fit, term)):
            found.append(_of_term(data, known, fit, term, probability))
    named: dict[tuple[str, str], dict[str, float]] = {}
    for finding in _of_parameters(data, known, fit):
        found.append(finding)
        named[finding.effect, finding.location] = {k: e.value for k, e in finding.parameters.items()}
    large = is_large(data, fit)
    for finding in _of_delays(data, known, fit, common=large):
        found.append(finding)
        named[finding.effect, finding.location] = {k: e.value for k, e in finding.parameters.items()}
    timing = () if large else tuple(_timing(data, fit))
    weight = {(f.effect, f.location): _removed(data, fit, f) for f in found}
    for finding, energy in bodies:
        found.append(finding)
        weight[finding.effect, finding.location] = energy
    found.sort(key=lambda f: -weight[f.effect, f.location])
    adequate = adequacies(data, fit, standard)
    found = [replace(f, probability=adequate(f.effect, f.location) * min(f.probability, 1.0)) for f in found]
    found = [_with_twins(data, finding) for finding in found]
    changes = (*_changes(data, fit), *_changes_of_laws(data, fit, found))
    return Answer(fit, tuple(found), changes, timing, named)


def _chance(data: TorqueData, known: Posterior, term: Term) -> float:
    """Probability of an effect, including delays reported as this effect."""
    delays = sum(
        float(weight)
        for fit, weight in zip(known.fits, known.weights)
        if term.key not in _keys(fit) and term.key in set(_delays(data, fit))
    )
    return known.probability(term.key) + delays


def _of_term(data: TorqueData, known: Posterior, fit: Fit, term: Term, probability: float) -> Finding:
    rivals = _rivals(data, known, fit, term)
    shown = _shown(data, term)
    parameters = {p.name: _estimate(data, fit, term, p, term.parameters[p.name]) for p in shown}
    stated = [
        _label(key, term.at) for key, _ in rivals if not _is_more_general(key, (term.effect.id, term.at))
    ]
    notes = list(_replacing(data, fit, term.effect.id, term.at))
    if term.run is not None and len(data.runs) > 1:
        source = data.runs[term.run].rows.source
        notes.append(f"It occurred in {source} only, so the robot file does not include it.")
    notes += _unseen(term, shown)
    for p in term.effect.parameters:
        if p.name in term.located and p not in term.free:
            notes.append(f"{p.name} is held at {term.parameters[p.name]:.3g}, as only the direction counts.")
    return Finding(
        effect=term.effect.id,
        location=term.at,
        probability=probability,
        parameters=parameters,
        ambiguous_with=tuple(dict.fromkeys([*stated, *_simpler(term, parameters)])),
        alternatives=_alternatives(rivals, (term.effect.id, term.at)),
        validation_improvement=_gain(data, known, fit, term.key),
        note=" ".join(notes),
    )


def _alternatives(
    rivals: Sequence[tuple[tuple[str, str], float]], named: tuple[str, str]
) -> tuple[Alternative, ...]:
    why = {
        False: "it predicts held-out data less well",
        True: "it is more general and predicts no better; it may differ at speeds that were not compared",
    }
    return tuple(Alternative(*key, p, why[_is_more_general(key, named)]) for key, p in rivals)


def _is_more_general(key: tuple[str, str], than: tuple[str, str]) -> bool:
    """Whether an effect is a higher rung of the family of another one at its place."""
    one, other = get_effect(key[0]), get_effect(than[0])
    same = key[1] == than[1] and other.family is not None and one.family == other.family
    return same and one.rung > other.rung


def _unseen(term: Term, shown: Collection[Parameter]) -> list[str]:
    names = ", ".join(p.name for p in term.free if p not in shown)
    return [f"These recordings do not show {names}."] if names else []


def _shown(data: TorqueData, term: Term) -> list[Parameter]:
    """Estimated parameters on which the compared rows depend at all."""
    slopes = [
        np.abs(data.columns(term, run)[:, :, 1:]).max(axis=0, initial=0.0) for run in range(data.fitted)
    ]
    size = np.max(slopes, axis=0) / data.size[:, None]
    sensitivity = [float(own) * p.typical for own, p in zip(size.max(axis=0), term.free)]
    return [p for p, own in zip(term.free, sensitivity) if own > ROUNDING * max(sensitivity)]


def of_bodies(data: TorqueData, fit: Fit, carried: Sequence[Load]) -> tuple[Weighty, ...]:
    """Findings about the bodies of a fit, with the energy that they explain (`_removed`)."""
    top = next(load for load in carried if load.effect)
    return tuple(_of_body(data, fit, top, body, carried) for body in top.bodies)


def _of_body(data: TorqueData, fit: Fit, top: Load, body: str, carried: Sequence[Load]) -> Weighty:
    """A load on a link, or wrong mass properties of it."""
    effect, key = get_effect(top.effect), (top.effect, body)
    term = next((t for t in fit.hypothesis.terms if t.key == key), None)
    probable: dict[tuple[str, str], float] = {}
    for load in carried:
        for link in load.bodies:
            probable[load.effect, link] = probable.get((load.effect, link), 0.0) + load.probability
    named = {(top.effect, link) for link in top.bodies}
    rivals = [(other, p) for other, p in probable.items() if other not in named and p >= RIVAL]
    rivals.sort(key=lambda one: -one[1])
    why = "the bodies that the recordings determine differ from the robot file in another way"
    note = ""
    if term is None:
        parameters, energy = _changed(data, fit, body)
    else:
        shown = _shown(data, term)
        parameters = {p.name: _estimate(data, fit, term, p, term.parameters[p.name]) for p in shown}
        note = " ".join(_unseen(term, shown))
        energy = sum(_energy(data.columns(term, run)[:, :, 0], fit) for run in range(data.fitted))
    finding = Finding(
        effect=effect.id,
        location=body,
        probability=probable[key],
        parameters=parameters,
        ambiguous_with=tuple(_label(other, body) for other, _ in rivals),
        alternatives=tuple(Alternative(*other, p, why) for other, p in rivals),
        note=note,
    )
    return finding, energy


def _changed(data: TorqueData, fit: Fit, body: str) -> tuple[dict[str, Estimate], float]:
    """Differences of a body from the file, named as in `inertia`, and the energy they explain."""
    first = data.layout.names.index(f"{body}.mass")
    places = np.arange(first, first + COUNT)
    found = {}
    for place, p in zip(places, get_effect("inertia").parameters):
        if any(design[:, :, place].any() for design in data.designs[: data.fitted]):
            value = float(fit.parameters[place] - data.file_values[place])
            half = QUANTILE * float(fit.deviations[place])
            found[p.name] = Estimate(value, (value - half, value + half), p.unit)
    away = fit.parameters[places] - data.file_values[places]
    return found, sum(_energy(data.designs[run][:, :, places] @ away, fit) for run in range(data.fitted))


def _energy(torques: Array, fit: Fit) -> float:
    """Sum of squares of torques in units of the residual."""
    return float(np.sum((torques / fit.sigma) ** 2))


def _replacing(data: TorqueData, fit: Fit, effect: str, joint: str) -> Iterator[str]:
    """A sentence if an effect replaces a law of its family in the robot file."""
    for law in absent(data, fit.hypothesis):
        if law.at == joint and law.effect.family and law.effect.family == get_effect(effect).family:
            yield f"It replaces the robot file's {law.effect.id}."


def _simpler(term: Term, parameters: Mapping[str, Estimate]) -> Iterator[str]:
    """Simpler effects that are not excluded, since the interval of essential parameters contains zero."""
    for simpler, names in term.effect.contains.items():
        sizes = [parameters[p.name] for p in term.free if p.absent == 0.0 and p.name not in names.values()]
        if sizes and all(e.ci95[0] <= 0.0 <= e.ci95[1] for e in sizes):
            yield simpler


def _rivals(data: TorqueData, known: Posterior, fit: Fit, term: Term) -> list[tuple[tuple[str, str], float]]:
    """Terms of hypotheses without a given term that replace it, with their probabilities."""
    return _replacements(
        data, known, fit, term.at, lambda other: term.key in {t.key for t in other.hypothesis.terms}
    )


def _replacements(
    data: TorqueData, known: Posterior, fit: Fit, at: str, has: Callable[[Fit], bool]
) -> list[tuple[tuple[str, str], float]]:
    """Rivals: effects of hypotheses that lack something and replace it.

    Args:
        data, known, fit: see `answer_of`.
        at: place of what is replaced.
        has: whether a fit contains what is replaced.
    """
    own = _said(data, fit)
    found: dict[tuple[str, str], float] = {}
    for other, weight in zip(known.fits, known.weights):
        if has(other):
            continue
        theirs = _said(data, other)
        alone = len(own - theirs) == 1  # nothing else is missing: all additional terms are rivals
        for key in theirs - own:
            if key[0].startswith(UNNAMED):
                continue
            if alone or key[1].split(".")[0] == at.split(".")[0]:
                found[key] = found.get(key, 0.0) + float(weight)
    return sorted(((key, p) for key, p in found.items() if p >= RIVAL), key=lambda item: -item[1])


def _said(data: TorqueData, fit: Fit) -> set[tuple[str, str]]:
    """Everything that a fit says is missing: terms, delays, and friction and offsets that the file lacks.

    Not those that belong to a force without a name.
    """
    terms = fit.hypothesis.terms
    unnamed = {f"{term.at}.{name}" for term in terms if term.effect.is_unknown for name in term.effect.along}
    added = {(EFFECTS[k][0], j) for j, k in _added(data, fit) if f"{j}.{k}" not in unnamed}
    return {term.key for term in terms} | set(_delays(data, fit)) | added


def _added(data: TorqueData, fit: Fit) -> Iterator[tuple[str, str]]:
    """Joints and kinds of friction and offsets that a fit estimates and the robot file lacks."""
    for joint in data.joints:
        for kind in EFFECTS:
            name = f"{joint}.{kind}"
            if _is_free(fit, name) and data.file_values[fit.layout.names.index(name)] == 0.0:
                yield joint, kind


def _delays(data: TorqueData, fit: Fit) -> Iterator[tuple[str, str]]:
    """Effects as which additional delays of joints are reported."""
    for joint in data.joints:
        if _is_free(fit, f"{joint}.{TIMING}"):
            delays = fit.parameter(f"{joint}.{TIMING}") > 0.0
            yield ("sensor_delay", f"{joint}.torque") if delays else (EARLY[0], joint)


def _label(key: tuple[str, str], place: str) -> str:
    return key[0] if key[1] == place else f"{key[0]}@{key[1]}"


def _estimate(data: TorqueData, fit: Fit, term: Term, p: Parameter, value: float) -> Estimate:
    half = QUANTILE * fit.deviation(f"{term.effect.id}@{term.at}.{p.name}")
    # Smaller values than a recording shows are possible, but not larger ones than it has room for.
    low, high = max(value - half, p.lower), min(value + half, term.range_of(p)[1])
    return Estimate(value, (low, high), _unit(data, term.at, p.unit))


def _unit(data: TorqueData, at: str, unit: str) -> str:
    joint = next((j for j in _axes(data) if j.name == at.split(".")[0]), None)
    if joint is None or joint.kind != "prismatic":
        return unit
    return unit.replace("N m", "N").replace("rad", "m")


def _axes(data: TorqueData) -> tuple[Drive | Joint, ...]:
    """Drives, and joints moved through transmissions."""
    return (*data.standard.nominal.drives, *data.standard.nominal.joints)


def _of_parameters(data: TorqueData, known: Posterior, fit: Fit) -> Iterator[Finding]:
    """Findings of friction and offsets that are zero in the robot file."""
    for joint, kind in _added(data, fit):
        effect, parameter, sign = EFFECTS[kind]
        name = f"{joint}.{kind}"
        if name in fit.hypothesis.of_unnamed:
            continue
        probability = known.freed(name)
        rivals = _replacements(data, known, fit, joint, partial(_is_free, name=name))
        if probability <= STATED and (probability < RIVAL or not rivals):
            continue
        p = get_effect(effect).parameter(parameter)
        value, half = sign * fit.parameter(name), QUANTILE * fit.deviation(name)
        if abs(value) < half or not _is_significant(data, fit, name):  # it may as well be absent
            continue
        interval = max(value - half, p.lower), value + half
        estimate = Estimate(value, interval, _unit(data, joint, p.unit))
        probable = [_label(key, joint) for key, _ in rivals if not _is_more_general(key, (effect, joint))]
        same = (*probable, *_same_while_sliding(fit, joint, effect, value))
        yield Finding(
            effect,
            joint,
            probability,
            {parameter: estimate},
            ambiguous_with=tuple(dict.fromkeys(same)),
            alternatives=_alternatives(rivals, (effect, joint)),
            note=" ".join(_replacing(data, fit, effect, joint)),
        )


def _with_twins(data: TorqueData, finding: Finding) -> Finding:
    """The finding with the errors of sensors that no recording distinguishes from it or from its rivals.

    They are as probable as the finding itself.
    """
    own, place = _twins(data, finding.effect, finding.location), finding.location
    rivals = [label.partition("@") for label in finding.ambiguous_with]
    theirs = [key for effect, _, at in rivals for key in _twins(data, effect, at or place)]
    labels = (*finding.ambiguous_with, *(_label(key, place) for key in (*own, *theirs)))
    return replace(
        finding, probability=finding.probability / (1 + len(own)), ambiguous_with=tuple(dict.fromkeys(labels))
    )


def _twins(data: TorqueData, effect: str, at: str) -> list[tuple[str, str]]:
    """Errors of recorded channels of a joint that no recording distinguishes from an effect there."""
    channels = frozenset.intersection(*(run.channels for run in data.runs))
    every = [one for one in catalogue().values() if isinstance(one, SensorEffect)]
    pairs = [
        (one.id, f"{at}.{quantity}")
        for one in every
        for quantity, same in one.same_as.items()
        if same == effect
    ]
    return [(one, channel) for one, channel in pairs if channel in channels]


def _same_while_sliding(fit: Fit, joint: str, effect: str, value: float) -> Iterator[str]:
    """Friction laws that are equivalent to an offset while the joint slides.

    They are equivalent as long as the friction in either direction opposes the motion.
    """
    laws = [term.parameters for term in fit.hypothesis.terms if term.at == joint and term.is_given]
    level = fit.parameter(f"{joint}.coulomb") + sum(law.get("coulomb_torque", 0.0) for law in laws)
    if abs(value) <= level:
        for other in catalogue().values():
            if other.is_friction_law and effect in other.contains:
                yield other.id


def _is_significant(data: TorqueData, fit: Fit, name: str) -> bool:
    """Whether the contribution of a standard model parameter exceeds the error of any model."""
    place = fit.layout.names.index(name)
    parts = [np.mean((design[:, :, place] * fit.parameters[place]) ** 2, axis=0) for design in data.designs]
    return bool(np.any(np.max(parts, axis=0) > data.error**2))


def _of_delays(data: TorqueData, known: Posterior, fit: Fit, *, common: bool) -> Iterator[Finding]:
    """Findings of delays of one joint's torque relative to others, and of large delays of the only torque."""
    counted = data.counts[data.fitted_blocks].sum(axis=0) > 0.0
    names = [name for name, fitted in zip(data.joints, counted) if fitted]
    for joint in names:
        name = f"{joint}.{TIMING}"
        own = _is_free(fit, name)
        delay = fit.parameter(name) + (fit.parameter(TIMING) if common else 0.0)
        deviation = np.hypot(fit.deviation(name), fit.deviation(TIMING) if common else 0.0)
        if not (own or common) or abs(delay) <= QUANTILE * deviation:  # it may as well be absent
            continue
        probability = known.freed(name) if own else _chance_large(data, fit)
        others = _replacements(data, known, fit, joint, partial(_is_free, name=name)) if own else []
        if probability <= STATED and (probability < RIVAL or not others):
            continue
        low, high = abs(delay) - QUANTILE * deviation, abs(delay) + QUANTILE * deviation
        # Either of two joints that differ may be the delayed one; an early torque may be a late encoder.
        odd = next((n for n in names if n != joint), "") if own and not common and len(names) == 2 else ""
        effect, at, parameter = EARLY[0], joint, EARLY[1]
        if delay > 0.0:
            effect, at, parameter = "sensor_delay", f"{joint}.torque", "delay"
        rivals = [_label(key, at) for key, _ in others]
        if delay > 0.0:
            rivals += [f"{EARLY[0]}@{odd}"] if odd else []
        else:
            rivals += [f"sensor_delay@{joint}.position"] + ([f"sensor_delay@{odd}.torque"] if odd else [])
        estimate = {parameter: Estimate(abs(delay), (low, high), "s")}
        yield Finding(effect, at, probability, estimate, ambiguous_with=tuple(dict.fromkeys(rivals)))


def _is_free(fit: Fit, name: str) -> bool:
    place = fit.layout.names.index(name)
    return bool(fit.layout.free[place]) and name not in fit.hypothesis.from_file


def is_large(data: TorqueData, fit: Fit) -> bool:
    """Whether the common delay belongs to the only compared torque rather than to the recording."""
    return _chance_large(data, fit) > STATED


def _chance_large(data: TorqueData, fit: Fit) -> float:
    """Probability that the common delay belongs to the only compared torque.

    A delay shared by several torques is due to the recording.
    """
    if np.sum(data.counts[data.fitted_blocks].sum(axis=0) > 0.0) > 1:
        return 0.0
    limit, delay = LARGEST / data.runs[0].motion.sampling, fit.parameter(TIMING)
    deviation = max(fit.deviation(TIMING), 1e-300)
    return float(norm.sf((limit - delay) / deviation) + norm.cdf((-limit - delay) / deviation))


def _timing(data: TorqueData, fit: Fit) -> Iterator[Timing]:
    delay, half = fit.parameter(TIMING), QUANTILE * fit.deviation(TIMING)
    if half > 0.0:
        rate = data.runs[0].motion.sampling
        for run in data.runs:
            interval = delay - half, delay + half
            yield Timing(run.rows.source, "torque", delay, interval, delay * rate, undone=True)


def _changes(data: TorqueData, fit: Fit) -> Iterator[ParameterChange]:
    """Re-estimated parameters of the robot file on which some recorded torque depends."""
    free_of_cost = unstated(data)
    for place, name in enumerate(fit.layout.names[: data.start.size]):
        joint, _, kind = name.rpartition(".")
        nominal = float(data.file_values[place])
        if not fit.layout.free[place] or TIMING in name or name.startswith("gravity"):
            continue
        if not any(design[:, :, place].any() for design in data.designs):
            continue
        if joint in data.joints and kind in EFFECTS and nominal == 0.0:
            continue  # reported as a finding
        value, half = fit.parameter(name), QUANTILE * fit.deviation(name)
        if name in free_of_cost and value <= half:
            continue  # not distinguished from zero
        known = FILE * abs(nominal)
        if joint not in data.joints:  # relative to the body's scale, as a coordinate of its centre may be 0
            known = data.standard.estimate.width * float(fit.layout.size[place])
        wide = QUANTILE * known
        is_from_file = name in fit.hypothesis.from_file or (
            joint not in data.joints and BODIES in fit.hypothesis.from_file
        )
        if is_from_file and joint not in data.joints:
            wide = QUANTILE * min(data.standard.estimate.width, FILE) * float(fit.layout.size[place])
        if is_from_file and abs(value - nominal) <= max(wide, half):
            continue
        yield ParameterChange(
            name,
            _unit_of_number(data, joint, kind),
            nominal,
            value,
            (value - half, value + half),
            "",
            (nominal - wide, nominal + wide),
        )


def _changes_of_laws(data: TorqueData, fit: Fit, found: Sequence[Finding]) -> Iterator[ParameterChange]:
    """Changed parameters of the robot file's friction laws, beyond its tolerance or of absent laws.

    Laws replaced by another one are reported with that finding.
    """
    for term, name in fit.hypothesis.freed:
        value = term.parameters[name]
        interval = _estimate(data, fit, term, term.effect.parameter(name), value).ci95
        change = _change_of_law(data, term, name, value, interval)
        if not change.prior95[0] <= value <= change.prior95[1]:
            yield change
    replaced = {(f.location, get_effect(f.effect).family) for f in found}
    for term in absent(data, fit.hypothesis):
        if term.effect.family is None or (term.at, term.effect.family) not in replaced:
            for p in term.effect.estimated:
                if p.absent is not None and term.file_value(p.name) != p.absent:
                    yield _change_of_law(data, term, p.name, p.absent, (p.absent, p.absent))


def _change_of_law(
    data: TorqueData, term: Term, name: str, value: float, interval: tuple[float, float]
) -> ParameterChange:
    nominal, unit = term.file_value(name), _unit(data, term.at, term.effect.parameter(name).unit)
    wide = QUANTILE * FILE * abs(nominal)
    before = nominal - wide, nominal + wide
    return ParameterChange(f"{term.effect.id}@{term.at}.{name}", unit, nominal, value, interval, "", before)


def _unit_of_number(data: TorqueData, joint: str, kind: str) -> str:
    if joint in data.joints:
        plain = {"viscous": "N m s/rad", "reflected_inertia": "kg m^2"}.get(kind, "N m")
        prismatic = next(j for j in _axes(data) if j.name == joint).kind == "prismatic"
        linear = {"viscous": "N s/m", "reflected_inertia": "kg"}.get(kind, "N")
        return linear if prismatic else plain
    if kind == "mass":
        return "kg"
    return "kg m" if joint.endswith("first_moment") else "kg m^2"


def _gain(data: TorqueData, known: Posterior, fit: Fit, key: tuple[str, str]) -> float:
    """Fraction of the held-out error that an effect removes, relative to the same hypothesis without it."""
    less, laws = _keys(fit) - {key}, {law.key for law in absent(data, fit.hypothesis) if law.at == key[1]}
    others = [f for f in known.fits if _keys(f) == less or (laws and _keys(f) == less | laws)]
    if not others:
        return 0.0
    best, held_out = others[0], ~data.fitted_blocks
    before, after = (np.sqrt((f.errors[held_out].sum(axis=0) / fit.sigma**2).sum()) for f in (best, fit))
    return float(1.0 - after / before) if before > 0.0 else 0.0


def keys_of(data: TorqueData, fit: Fit) -> set[tuple[str, str]]:
    """Effects and places of a fit, including delays reported as effects."""
    return {*_keys(fit), *_delays(data, fit)}


def _keys(fit: Fit) -> set[tuple[str, str]]:
    return {term.key for term in fit.hypothesis.terms}


def _removed(data: TorqueData, fit: Fit, finding: Finding) -> float:
    """Error energy that a finding explains in the fitted recordings, in units of the residual."""
    terms = [t for t in fit.hypothesis.terms if t.key == (finding.effect, finding.location)]
    total = 0.0
    for i in range(data.fitted):
        for term in terms:
            total += float(np.sum((data.columns(term, i)[:, :, 0] / fit.sigma) ** 2))
        if not terms:
            joint = finding.location.split(".")[0]
            kinds = [k for k, (effect, _, _) in EFFECTS.items() if effect == finding.effect] or [TIMING]
            place = fit.layout.names.index(f"{joint}.{kinds[0]}")
            part = data.designs[i][:, :, place] * fit.parameters[place] / fit.sigma
            total += float(np.sum(part**2))
    return total

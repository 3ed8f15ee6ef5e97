"""The score of one case: the answer against the truth, the true model, and the baselines."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pyarrow.csv as pa_csv

from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import EXACT, Concealed, with_exact
from missing_physics.challenge.concealing.recorded_torque import logged
from missing_physics.challenge.concealing.tuning import corrects_file, may_correct_file
from missing_physics.challenge.draws.warming import EFFECT as BY_TEMPERATURE
from missing_physics.challenge.scoring.baselines import baselines, measured_joints, torque_error
from missing_physics.challenge.scoring.held_out import held_out_errors
from missing_physics.challenge.scoring.information import IDENTIFIABLE, distances
from missing_physics.challenge.scoring.probability import probability_score
from missing_physics.challenge.scoring.result import NO_ANSWER, CaseScore, Finding, ModelScore
from missing_physics.challenge.torques.along import ArmAlong
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, robot_from_toml, robot_to_toml

__all__ = ["anchor", "closed_loop", "judged", "scored", "stated_and_there"]

#: How far two machines may differ in what they make of one truth [share of the largest].
ROUNDING = 1e-3
#: Numbers that were fitted to a recording differ by so many times more.
TUNING = 10
#: A number in a robot file.
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?!\w)")


def scored(design: Design, files: Mapping[str, bytes]) -> dict[str, bytes]:
    """`score.json` of a case from its files and those of its answer.

    Raises:
        InputError: the recordings are not those that the design makes.
    """
    case = with_exact(design, files[EXACT]) if EXACT in files else Concealed(design)
    recordings = _read(files["recording.csv"]), _read(files["validation.csv"])
    _same_files(case, files)
    facts = json.loads(files["answer.json"])
    given = robot_from_toml(files["robot.toml"].decode())
    answer, augmented, words = _answered(design, given, files)
    nominal, better = case.completed(given), None if augmented is None else case.completed(augmented)
    train, held_out = ArmAlong(case.sensed_by, case.exact[0]), ArmAlong(nominal, case.exact[1])
    distance = distances(train, design.hidden)
    models = baselines(ArmAlong(nominal, case.exact[0]), held_out, *recordings)
    models["diagnosis"] = _answer_model(better, answer, case.exact[1], recordings[1])
    proper = probability_score(*stated_and_there(design, given, answer))
    score = CaseScore(
        number=design.number,
        name=design.name,
        family=design.family,
        robot=f"{design.shipped}, exact beams" if design.beams else design.shipped,
        hidden=design.labels,
        foreign=design.foreign.kind if design.foreign else "",
        identifiable={label: value >= IDENTIFIABLE for label, value in distance.items()},
        distance=distance,
        errors=closed_loop(case, nominal, better, recordings[1]),
        models=models,
        seconds=facts["seconds"],
        attempts=facts["attempts"],
        message="" if answer else words or facts["message"] or facts["status"],
        conditions=dict(design.conditions.words),
        file_exact=design.conditions.factors.file_exact,
        log_score=proper.log,
        brier=proper.brier,
        held_out=held_out_errors(case, {"nominal": nominal, "answer": better}, recordings[1]),
        **judged(design, given, answer),
    )
    return {"score.json": (json.dumps(asdict(score), indent=1) + "\n").encode()}


def _read(content: bytes) -> Recording:
    table = pa_csv.read_csv(io.BytesIO(content))
    columns = {name: table[name].to_numpy() for name in table.column_names}
    return Recording(columns.pop("time"), columns)


def _same_files(case: Concealed, files: Mapping[str, bytes]) -> None:
    """Two makings of a case on one machine agree to the last digit, on two machines to rounding."""
    for name, made in zip(("recording.csv", "validation.csv"), case.recordings):
        _same(name, made, _read(files[name]))
    texts = robot_to_toml(case.given), files["robot.toml"].decode("utf-8", "replace")
    one, two = ([float(number) for number in NUMBER.findall(text)] for text in texts)
    rounding = ROUNDING * (TUNING if case.design.family == "tuned_away" else 1)
    same = NUMBER.sub("", texts[0]) == NUMBER.sub("", texts[1])
    if not same or not np.allclose(one, two, rtol=rounding, atol=1e-9):
        raise InputError("robot.toml is not what the truth makes.")


def _same(file: str, made: Recording, found: Recording) -> None:
    for name in made:
        scale = max(float(np.abs(made[name]).max()), 1e-12)
        same = name in found and len(found.time) == len(made.time)
        if not same or not float(np.abs(made[name] - found[name]).max()) <= ROUNDING * scale:
            raise InputError(f"{file} is not what the truth makes: {name} differs.")


def _answered(
    design: Design, given: Robot, files: Mapping[str, bytes]
) -> tuple[Mapping[str, Any] | None, Robot | None, str]:
    """diagnosis.json and the robot of the answer; neither, and why, where they cannot be used."""
    if "diagnosis.json" not in files:
        return None, None, ""
    try:
        answer = json.loads(files["diagnosis.json"])
        judged(design, given, answer)
        text = files.get("robot.augmented.toml")
        augmented = robot_from_toml(text.decode()) if text is not None else None
    except Exception as error:  # whatever an answer holds, the other cases have a score
        return None, None, f"no usable answer: {type(error).__name__}: {error}"
    return answer, augmented, ""


def judged(design: Design, given: Robot, answer: Mapping[str, Any] | None) -> dict[str, Any]:
    """What the answer says, held against the truth; keys of `CaseScore`."""
    if answer is None:
        hides = bool(design.hidden)
        nothing = {"stated_improvement": None, "in_set": None, "findings": ()}
        place = False if hides or design.foreign else None
        return {
            **nothing,
            "verdict": NO_ANSWER,
            "place": place,
            "right_name": False if hides else None,
        }
    findings = tuple(_finding(design, given, item) for item in answer["findings"])
    named = {finding.label for finding in findings}
    stated = {label for finding in findings for label in finding.set}
    ambiguous = answer["verdict"] == "ambiguous" and design.hidden
    return {
        "verdict": str(answer["verdict"]),
        "findings": findings,
        "place": _place(design, given, answer),
        "right_name": set(design.labels) <= named if design.hidden else None,
        "in_set": set(design.labels) <= stated if ambiguous else None,
        "stated_improvement": answer["fit"]["validation_improvement"],
    }


def _finding(design: Design, given: Robot, item: Mapping[str, Any]) -> Finding:
    label, probability = f"{item['effect']}@{item['location']}", float(item["probability"])
    if not 0 <= probability <= 1:
        raise ValueError(f"a probability of {probability:g}")
    truth = next((use for use in design.hidden if f"{use.effect}@{use.at}" == label), None)
    covered = {}
    for name, estimate in item["parameters"].items() if truth else ():
        low, high = estimate["ci95"]
        if truth is not None and name in truth.parameters and None not in (low, high):
            covered[name] = bool(low <= truth.parameters[name] <= high)
    right = truth is not None or label in _springs(design) or corrects_file(design, given, item)
    return Finding(label, probability, right, (label, *item["ambiguous_with"]), covered)


def stated_and_there(
    design: Design, given: Robot, answer: Mapping[str, Any] | None
) -> tuple[dict[str, float], set[str]]:
    """What an answer says and what is true, for `probability_score`.

    Returns:
        Probability of every effect that it mentions, by label, a finding's before a rival's, and the labels
        of what is hidden and of findings that are right besides. A rival without numbers that may stand for
        a wrong number of the robot file is neither right nor wrong, and left out.
    """
    findings = answer["findings"] if answer else ()
    stated: dict[str, float] = {}
    for rival in (rival for item in findings for rival in item.get("alternatives", ())):
        label, probability = f"{rival['effect']}@{rival['location']}", rival["probability"]
        if probability is not None and not may_correct_file(design, given, label):
            stated[label] = max(float(probability), stated.get(label, 0.0))
    judged_ones = [_finding(design, given, item) for item in findings]
    stated |= {finding.label: finding.probability for finding in judged_ones}
    return stated, {*design.labels, *(finding.label for finding in judged_ones if finding.right)}


def _springs(design: Design) -> set[str]:
    """The springs of hidden gears: play and losses in a gear have one in series or beside them.

    With it written as an effect of its own the robot moves alike.
    """
    return {
        f"joint_elasticity@{use.at}"
        for use in design.hidden
        if isinstance(get_effect(use.effect), GearEffect) and use.parameters.get("stiffness", 0.0) > 0
    }


def _place(design: Design, robot: Robot, answer: Mapping[str, Any]) -> bool | None:
    """Every hidden place is a finding's; where nothing is named, it is where the mismatch is located."""
    hidden = [use.at for use in design.hidden] + ([design.foreign.joint] if design.foreign else [])
    if not hidden:
        return None
    if answer["verdict"] == "consistent":
        return False
    told = answer["findings"] or answer["mismatch"]
    places = {anchor(robot, item["location"]) for item in told}
    return {anchor(robot, at) for at in hidden} <= places


def anchor(robot: Robot, at: str) -> str:
    """The joint at which a joint, its channel or the link beyond it sits; `base` for the base."""
    place = at.split(".")[0]
    for joint in robot.joints:
        if place in (joint.name, joint.child):
            return joint.name
    return place


def closed_loop(
    case: Concealed, given: Robot, augmented: Robot | None, recording: Recording
) -> dict[str, float]:
    """Errors of `nominal`, `answer` and `truth` on the held-out recording, each run in closed loop.

    `given` and `augmented` are robots that the case has completed with controller, reference and sensors.
    The truth is Exudyn's run without noise; the others run in the reference model. A joint that warms cannot
    be run there, so that there are no errors where its friction minds.
    """
    if any(use.effect == BY_TEMPERATURE for use in case.design.hidden):
        return {}
    quiet = tuple(s.model_copy(update={"noise": 0.0, "resolution": 0.0}) for s in given.sensors)
    channels = _compared(case.design, given)
    errors = {"truth": _error(case.noiseless(1), recording, given, channels)}
    for name, robot in (("nominal", given), ("answer", augmented)):
        if robot is None:
            continue
        try:
            there = case.path.finer(robot.model_copy(update={"sensors": quiet}))
            error = _error(_as_logged(case, simulate(there, any_bodies=True)), recording, given, channels)
        except Exception:  # an answer may be any robot; one that cannot be run has no error
            continue
        if np.isfinite(error):
            errors[name] = error
    return errors


def _as_logged(case: Concealed, run: Recording) -> Recording:
    """A run on the finer grid as the log has it, its torques delayed or filtered like the machine's."""
    joints = [joint for joint in case.joints if f"{joint}.torque" in run]
    kept = case.path.logged(run, joints)
    return kept.with_channels({f"{joint}.torque": logged(kept, joint) for joint in joints})


def _compared(design: Design, robot: Robot) -> list[str]:
    """Torques, any other channel whose sensor is at fault, both encoders of a gear and rates of the base.

    The positions of a controlled joint follow its reference whatever the model.
    """
    further = [use.at for use in design.hidden if "." in use.at]
    for use in design.hidden:
        if isinstance(get_effect(use.effect), GearEffect):
            further += [f"{use.at}.position", f"{use.at}.motor_position"]
    if any(use.at == "base" for use in design.hidden):
        further += [f"base.angular_velocity.{axis}" for axis in "xyz"]
    return [s.channel for s in robot.sensors if s.channel.endswith(".torque") or s.channel in further]


def _error(model: Recording, recording: Recording, robot: Robot, channels: Sequence[str]) -> float:
    squares = []
    for channel in channels:
        sensor = robot.sensor(channel)
        assert sensor is not None
        noise = max(float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12))), 1e-12)
        squares.append(np.mean(((recording[channel] - model[channel]) / noise) ** 2))
    return float(np.sqrt(np.mean(squares)))


def _answer_model(
    augmented: Robot | None, answer: Mapping[str, Any] | None, exact: Recording, recording: Recording
) -> ModelScore:
    """The answer as the baselines are scored: its torque along the exact held-out motion."""
    if augmented is None or answer is None:
        return ModelScore((), None, NO_ANSWER)
    named = tuple(f"{item['effect']}@{item['location']}" for item in answer["findings"])
    try:
        along = ArmAlong(augmented, exact)
        left = np.zeros_like(along.torque)
        for k in measured_joints(along):
            left[:, k] = recording[f"{along.joints[k]}.torque"] - along.nominal()[:, k]
        error = torque_error(along, left)
    except Exception:  # as above
        return ModelScore(named, None, NO_ANSWER)
    return ModelScore(named, error if np.isfinite(error) else None)

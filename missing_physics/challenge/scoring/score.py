"""The score of one case: comparison of the answer with the truth, the true model, and the baselines."""

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

__all__ = ["anchor", "closed_loop", "judged", "scored", "stated_and_true"]

#: Tolerance for the same truth simulated on two machines, relative to the largest value.
ROUNDING = 1e-3
#: Factor on this tolerance for parameters that were fitted to a recording.
TUNING = 10
#: A number in a robot file.
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?!\w)")


def scored(design: Design, files: Mapping[str, bytes]) -> dict[str, bytes]:
    """`score.json` of a case from its files and those of its answer.

    Raises:
        InputError: the recordings are not those of the design.
    """
    case = with_exact(design, files[EXACT]) if EXACT in files else Concealed(design)
    recordings = _read(files["recording.csv"]), _read(files["validation.csv"])
    _check_files(case, files)
    facts = json.loads(files["answer.json"])
    given = robot_from_toml(files["robot.toml"].decode())
    answer, augmented, words = _answered(design, given, files)
    nominal, better = case.completed(given), None if augmented is None else case.completed(augmented)
    train, held_out = ArmAlong(case.sensed_by, case.exact[0]), ArmAlong(nominal, case.exact[1])
    distance = distances(train, design.hidden)
    models = baselines(ArmAlong(nominal, case.exact[0]), held_out, *recordings)
    models["diagnosis"] = _answer_model(better, answer, case.exact[1], recordings[1])
    proper = probability_score(*stated_and_true(design, given, answer))
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


def _check_files(case: Concealed, files: Mapping[str, bytes]) -> None:
    """Check the files; generated twice they agree exactly on one machine, and to rounding on two."""
    for name, made in zip(("recording.csv", "validation.csv"), case.recordings):
        _check_recording(name, made, _read(files[name]))
    texts = robot_to_toml(case.given), files["robot.toml"].decode("utf-8", "replace")
    one, two = ([float(number) for number in NUMBER.findall(text)] for text in texts)
    rounding = ROUNDING * (TUNING if case.design.family == "tuned_away" else 1)
    same = NUMBER.sub("", texts[0]) == NUMBER.sub("", texts[1])
    if not same or not np.allclose(one, two, rtol=rounding, atol=1e-9):
        raise InputError("robot.toml is not what the truth makes.")


def _check_recording(file: str, made: Recording, found: Recording) -> None:
    for name in made:
        scale = max(float(np.abs(made[name]).max()), 1e-12)
        same = name in found and len(found.time) == len(made.time)
        if not same or not float(np.abs(made[name] - found[name]).max()) <= ROUNDING * scale:
            raise InputError(f"{file} is not what the truth makes: {name} differs.")


def _answered(
    design: Design, given: Robot, files: Mapping[str, bytes]
) -> tuple[Mapping[str, Any] | None, Robot | None, str]:
    """diagnosis.json and the robot of the answer; neither, and the reason, if they are unusable."""
    if "diagnosis.json" not in files:
        return None, None, ""
    try:
        answer = json.loads(files["diagnosis.json"])
        judged(design, given, answer)
        text = files.get("robot.augmented.toml")
        augmented = robot_from_toml(text.decode()) if text is not None else None
    except Exception as error:  # an unusable answer must not affect the other cases
        return None, None, f"no usable answer: {type(error).__name__}: {error}"
    return answer, augmented, ""


def judged(design: Design, given: Robot, answer: Mapping[str, Any] | None) -> dict[str, Any]:
    """Comparison of the answer with the truth, with the keys of `CaseScore`."""
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
    rivals = (r if "@" in r else f"{r}@{item['location']}" for r in item["ambiguous_with"])
    return Finding(label, probability, right, (label, *rivals), covered)


def stated_and_true(
    design: Design, given: Robot, answer: Mapping[str, Any] | None
) -> tuple[dict[str, float], set[str]]:
    """Stated probabilities and true labels, for `probability_score`.

    Returns:
        Probability of every mentioned effect by label, with findings taking precedence over rivals; and the
        labels of the hidden effects and of other right findings. A rival without parameters that may correct
        a wrong parameter of the robot file is neither right nor wrong, and excluded.
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
    """Joint elasticities of hidden gear effects: backlash and losses have a spring in series or in parallel.

    Written as a separate effect it gives the same motion.
    """
    return {
        f"joint_elasticity@{use.at}"
        for use in design.hidden
        if isinstance(get_effect(use.effect), GearEffect) and use.parameters.get("stiffness", 0.0) > 0
    }


def _place(design: Design, robot: Robot, answer: Mapping[str, Any]) -> bool | None:
    """Whether every hidden place is that of a finding or, without findings, of the located mismatch."""
    hidden = [use.at for use in design.hidden] + ([design.foreign.joint] if design.foreign else [])
    if not hidden:
        return None
    if answer["verdict"] == "consistent":
        return False
    located = answer["findings"] or answer["mismatch"]
    places = {anchor(robot, item["location"]) for item in located}
    return {anchor(robot, at) for at in hidden} <= places


def anchor(robot: Robot, at: str) -> str:
    """The joint of a joint, its channel or its child link; `base` for the base."""
    place = at.split(".")[0]
    for joint in robot.joints:
        if place in (joint.name, joint.child):
            return joint.name
    return place


def closed_loop(
    case: Concealed, given: Robot, augmented: Robot | None, recording: Recording
) -> dict[str, float]:
    """Errors of `nominal`, `answer` and `truth` on the held-out recording, each simulated in closed loop.

    `given` and `augmented` are robots completed by the case with controller, reference and sensors.
    The truth is Exudyn's simulation without noise; the others use the reference model, which cannot
    simulate a joint that warms up, so that there are no errors if its friction depends on temperature.
    """
    if any(use.effect == BY_TEMPERATURE for use in case.design.hidden):
        return {}
    noiseless = tuple(s.model_copy(update={"noise": 0.0, "resolution": 0.0}) for s in given.sensors)
    channels = _compared(case.design, given)
    errors = {"truth": _error(case.noiseless(1), recording, given, channels)}
    for name, robot in (("nominal", given), ("answer", augmented)):
        if robot is None:
            continue
        try:
            completed = case.path.finer(robot.model_copy(update={"sensors": noiseless}))
            error = _error(_as_logged(case, simulate(completed, any_bodies=True)), recording, given, channels)
        except Exception:  # an answer may contain any robot, also one that cannot be simulated
            continue
        if np.isfinite(error):
            errors[name] = error
    return errors


def _as_logged(case: Concealed, run: Recording) -> Recording:
    """A simulation on the finer grid as it would be logged, with torques delayed or filtered."""
    joints = [joint for joint in case.joints if f"{joint}.torque" in run]
    kept = case.path.logged(run, joints)
    return kept.with_channels({f"{joint}.torque": logged(kept, joint) for joint in joints})


def _compared(design: Design, robot: Robot) -> list[str]:
    """Compared channels: torques, channels of faulty sensors, both encoders of a gear and rates of the base.

    Positions of controlled joints are excluded, since they follow the reference whatever the model.
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
    """Score of the answer like a baseline: its torque along the exact held-out motion."""
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

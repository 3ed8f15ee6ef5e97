"""Unusable answers, and answers that correct tuned parameters."""

from __future__ import annotations

import json
from functools import cache

import pytest
from challenge_cases import ARM, answer, design, hiding

from missing_physics.challenge.concealing.conceal import concealed
from missing_physics.challenge.concealing.tuning import corrects_file
from missing_physics.challenge.scoring import score as scoring
from missing_physics.challenge.scoring.result import case_score
from missing_physics.challenge.scoring.score import judged, scored
from robot_model import robot_from_toml, robot_to_toml

COULOMB = hiding("coulomb_friction", "joint1", torque=8.0)
FACTS = json.dumps({"status": "done", "message": "", "attempts": 1, "seconds": 1.0}).encode()


@cache
def case() -> dict[str, bytes]:
    return {**concealed(COULOMB), "answer.json": FACTS}


def told(said: bytes, robot: bytes | None = None) -> object:
    files = {**case(), "diagnosis.json": said}
    files |= {"robot.augmented.toml": case()["robot.toml"] if robot is None else robot}
    return case_score(json.loads(scored(COULOMB, files)["score.json"]))


def without(key: str) -> bytes:
    return json.dumps({k: v for k, v in answer("explained").items() if k != key}).encode()


def stated(**changes: object) -> bytes:
    said = answer("explained", ("coulomb_friction", "joint1", 0.99))
    said["findings"][0].update(changes)  # type: ignore[index]
    return json.dumps(said).encode()


@pytest.mark.parametrize(
    ("said", "robot"),
    [
        (b"{", None),
        (b"[]", None),
        (without("findings"), None),
        (without("verdict"), None),
        (without("fit"), None),
        (without("mismatch"), None),
        (stated(probability="sure"), None),
        (stated(probability=float("nan")), None),
        (stated(parameters={"torque": {}}), None),
        (json.dumps(answer()).encode(), b"nonsense"),
        (json.dumps(answer()).encode(), b"\xff"),
    ],
)
def test_unusable_answer_counts_as_no_answer(said: bytes, robot: bytes | None) -> None:
    """Its case has a score, and the others theirs."""
    found = told(said, robot)
    assert found.verdict == "no answer"  # type: ignore[attr-defined]
    assert found.message.startswith("no usable answer: ")  # type: ignore[attr-defined]
    assert (found.place, found.right_name) == (False, False)  # type: ignore[attr-defined]
    assert found.improvable  # type: ignore[attr-defined]
    assert found.improvement is None  # type: ignore[attr-defined]


def test_answer_with_an_unsimulable_robot_has_no_improvement(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def breaks(robot: object, **how: object) -> object:
        calls.append(robot)
        if len(calls) == 1:
            return real(robot, **how)  # the nominal robot
        raise ZeroDivisionError

    real = scoring.simulate
    monkeypatch.setattr(scoring, "simulate", breaks)
    found = told(stated())
    assert len(calls) == 2
    assert found.right_name  # type: ignore[attr-defined]
    assert found.improvable  # type: ignore[attr-defined]
    assert found.improvement is None  # type: ignore[attr-defined]


def test_answer_with_another_robot_is_scored() -> None:
    other = robot_to_toml(design(ARM).nominal).encode()
    found = told(stated(), other)
    assert found.right_name  # type: ignore[attr-defined]
    assert found.improvement < 0  # type: ignore[attr-defined]


TUNED = design(ARM).model_copy(update={"family": "tuned_away"})


def given(factor: float) -> object:
    """The nominal robot with its second link and all friction tuned."""
    nominal = TUNED.nominal
    link = nominal.links[1]
    inertia = tuple(factor * moment for moment in link.inertia)
    links = (nominal.links[0], link.model_copy(update={"mass": factor * link.mass, "inertia": inertia}))
    return robot_from_toml(robot_to_toml(nominal.model_copy(update={"links": links})))


@pytest.mark.parametrize("factor", [0.7, 1.3])
@pytest.mark.parametrize(
    ("effect", "name"),
    [("payload", "mass"), ("inertia", "mass"), ("inertia", "inertia_zz"), ("inertia", "first_moment_x")],
)
@pytest.mark.parametrize("sign", [-1, 1])
def test_only_findings_that_correct_tuned_parameters_are_right(
    factor: float, effect: str, name: str, sign: int
) -> None:
    item = {"effect": effect, "location": "link2", "parameters": {name: {"value": 0.1 * sign}}}
    assert corrects_file(TUNED, given(factor), item) == (sign * (1 - factor) > 0)  # type: ignore[arg-type]
    assert not corrects_file(TUNED, given(factor), {**item, "location": "link1"})  # type: ignore[arg-type]
    assert not corrects_file(TUNED, TUNED.nominal, item)


@pytest.mark.parametrize("factor", [0.6, 1.5])
@pytest.mark.parametrize("told", [0.5, 1.0, 1.7])
def test_finding_of_tuned_friction_replaces_the_whole_coefficient(factor: float, told: float) -> None:
    """In the place of the file's number, so that less than that takes back what was tuned to more."""
    use = TUNED.nominal.effects[0]
    [(name, value)] = use.parameters.items()
    other = use.model_copy(update={name: factor * value})
    tuned = TUNED.nominal.model_copy(update={"effects": (other, *TUNED.nominal.effects[1:])})
    item = {"effect": use.effect, "location": use.at, "parameters": {name: {"value": told * value}}}
    assert corrects_file(TUNED, tuned, item) == ((told > factor) == (factor < 1))


def test_change_in_the_wrong_direction_is_a_wrong_name() -> None:
    said = answer("explained", ("payload", "link2", 0.99))
    for value, right in ((0.5, True), (-0.5, False)):
        said["findings"][0]["parameters"] = {"mass": {"value": value, "ci95": [None, None]}}  # type: ignore[index]
        found = judged(TUNED, given(0.7), said)["findings"]  # type: ignore[arg-type]
        assert [finding.right for finding in found] == [right]

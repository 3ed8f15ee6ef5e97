"""Counting: findings against the truth, causes of failure, shares, and the pages made of them."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from challenge_cases import ARM, answer, design, hiding, score

from missing_physics.challenge.along import ArmAlong
from missing_physics.challenge.baselines import _library
from missing_physics.challenge.conceal import Concealed
from missing_physics.challenge.page import markdown
from missing_physics.challenge.result import CaseScore, Finding, ModelScore, Report, case_score
from missing_physics.challenge.score import judged
from missing_physics.challenge.summary import Goal, Share, cause_of, summary_of, wilson
from missing_physics.challenge.truth import Foreign
from missing_physics.reporting.challenge_report import render_challenge
from robot_model import EffectUse

COULOMB = hiding("coulomb_friction", "joint1", ARM, torque=3.0)
FACTS = {"first case": 10000, "cases": 3, "isolation of the diagnosis": "none"}


def told(case: object, **said: object) -> dict:
    return judged(case, case.nominal, said["said"])  # type: ignore[attr-defined, arg-type]


def test_regressors_hold_no_measured_torque() -> None:
    """A measured torque would explain itself."""
    made = Concealed(COULOMB)
    channels = {name: np.full_like(made.exact[0].time, 7.0) for name in ("joint1.torque", "joint2.torque")}
    other = dataclasses.replace(made.exact[0], channels={**made.exact[0].channels, **channels})
    one, two = (_library(ArmAlong(made.given, exact)) for exact in (made.exact[0], other))
    assert np.array_equal(one, two)


def test_a_right_answer() -> None:
    given = answer("explained", ("coulomb_friction", "joint1", 0.99))
    given["findings"][0]["parameters"] = {  # type: ignore[index]
        "torque": {"value": 3.1, "ci95": [2.9, 3.2], "unit": "N m"}
    }
    result = told(COULOMB, said=given)
    assert result["place"]
    assert result["right_name"]
    assert result["findings"][0].right
    assert result["findings"][0].covered == {"torque": True}


@pytest.mark.parametrize("bounds", [[3.01, 4.0], [2.0, 2.99]])
def test_an_interval_that_misses(bounds: list[float]) -> None:
    given = answer("explained", ("coulomb_friction", "joint1", 0.99))
    given["findings"][0]["parameters"] = {"torque": {"value": 3.1, "ci95": bounds}}  # type: ignore[index]
    assert told(COULOMB, said=given)["findings"][0].covered == {"torque": False}


@pytest.mark.parametrize(
    ("named", "place", "name"),
    [
        (("viscous_friction", "joint1", 0.99), True, False),
        (("coulomb_friction", "joint2", 0.99), False, False),
        (("payload", "link1", 0.99), True, False),
        (("sensor_gain", "joint1.torque", 0.99), True, False),
    ],
)
def test_wrong_names_and_places(named: tuple[str, str, float], place: bool, name: bool) -> None:
    result = told(COULOMB, said=answer("explained", named))
    assert (result["place"], result["right_name"]) == (place, name)
    assert not result["findings"][0].right


def test_a_located_mismatch_without_a_name_has_its_place() -> None:
    given = {**answer("unexplained"), "mismatch": [{"location": "joint1"}]}
    result = told(COULOMB, said=given)
    assert (result["place"], result["right_name"]) == (True, False)


def test_ambiguous_sets() -> None:
    given = answer("ambiguous", ("stribeck_friction", "joint1", 0.6))
    assert told(COULOMB, said=given)["in_set"] is False
    given["findings"][0]["ambiguous_with"] = ["coulomb_friction@joint1"]  # type: ignore[index]
    assert told(COULOMB, said=given)["in_set"] is True
    assert told(COULOMB, said=answer("explained"))["in_set"] is None


def test_no_answer_is_no_success() -> None:
    result = judged(COULOMB, COULOMB.nominal, None)
    assert (result["verdict"], result["place"], result["right_name"]) == ("no answer", False, False)


def test_foreign_physics_has_a_place_and_no_name() -> None:
    case = design(ARM).model_copy(
        update={"foreign": Foreign(kind="cubic_spring", joint="joint2", parameters={}), "family": "foreign"}
    )
    result = told(case, said={**answer("unexplained"), "mismatch": [{"location": "joint2"}]})
    assert (result["place"], result["right_name"]) == (True, None)


def test_the_spring_of_a_gear_with_losses_may_be_named_by_itself() -> None:
    lossy = {"effect": "gear_hysteresis", "at": "joint1", "torque": 2.0, "travel": 1e-4}
    said = answer("explained", ("gear_hysteresis", "joint1", 0.99), ("joint_elasticity", "joint1", 0.99))
    for stiffness, right in ((1e4, True), (0.0, False)):
        use = EffectUse.model_validate({**lossy, "stiffness": stiffness})
        found = told(COULOMB.model_copy(update={"hidden": (use,)}), said=said)["findings"]
        assert [finding.right for finding in found] == [True, right]


def test_saying_that_a_tuned_robot_is_wrong_is_right() -> None:
    case = COULOMB.model_copy(update={"family": "tuned_away"})
    found = told(case, said=answer("explained", ("inertia", "link2", 0.99)))["findings"]
    assert found[0].right
    assert not told(COULOMB, said=answer("explained", ("inertia", "link2", 0.99)))["findings"][0].right


WRONG = Finding("payload@link1", 0.99, False)
RIGHT = Finding("coulomb_friction@joint1", 0.99, True)
NOTHING = {"hidden": (), "identifiable": {}, "distance": {}, "place": None, "right_name": None}


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"findings": (RIGHT,)}, ""),
        ({"verdict": "no answer"}, "no answer"),
        ({"family": "none", **NOTHING, "verdict": "consistent"}, ""),
        ({"family": "none", **NOTHING, "verdict": "unexplained"}, "false alarm"),
        ({"family": "none", **NOTHING, "findings": (WRONG,)}, "false alarm"),
        ({**NOTHING, "foreign": "drag", "findings": (WRONG,), "place": True}, "foreign physics named"),
        ({**NOTHING, "foreign": "drag", "place": False}, "foreign physics not located"),
        ({**NOTHING, "foreign": "drag", "place": True}, ""),
        ({"in_set": False, "right_name": False}, "truth outside the ambiguous set"),
        ({"in_set": True, "right_name": False, "findings": (WRONG,)}, ""),
        ({"right_name": False, "verdict": "consistent"}, "nothing named (consistent)"),
        ({"right_name": False, "findings": (WRONG,)}, "another name at the place"),
        ({"right_name": False, "findings": (WRONG,), "place": False}, "named at another place"),
        ({"findings": (RIGHT, WRONG)}, "named, and something else that is not there"),
        (
            {"right_name": False, "findings": (WRONG,), "identifiable": {"coulomb_friction@joint1": False}},
            "wrong name where the data cannot tell",
        ),
        ({"right_name": False, "identifiable": {"coulomb_friction@joint1": False}}, ""),
    ],
)
def test_causes_of_failure(changes: dict, cause: str) -> None:
    assert cause_of(score(**changes)) == cause


def test_wilson_has_its_closed_form() -> None:
    """The bounds solve |p - x| = z sqrt(p (1 - p) / n) for p."""
    z = 1.959964
    for hits, count in [(0, 10), (3, 10), (10, 10), (190, 200)]:
        for bound in wilson(hits, count):
            left = abs(bound - hits / count)
            # The root turns the rounding of a bound at 0 or 1 into its square root.
            assert left == pytest.approx(z * np.sqrt(max(bound * (1 - bound), 0.0) / count), abs=1e-7)
    assert wilson(0, 0) == (0.0, 1.0)


def test_goals_tell_reached_from_proven() -> None:
    assert Goal("a", Share(0, 0), least=0.9).verdict == "no case"
    assert Goal("a", Share(9, 10), least=0.95).verdict == "missed, not proven by so many cases"
    assert Goal("a", Share(5, 10), least=0.95).verdict == "missed"
    assert Goal("a", Share(10, 10), least=0.95).verdict == "reached, not proven by so many cases"
    assert Goal("a", Share(1000, 1000), least=0.95).verdict == "reached"
    assert Goal("a", Share(9, 100), most=0.01).verdict == "missed"
    assert Goal("a", Share(5, 5), 0.90, 0.98).verdict == "missed, not proven by so many cases"


def test_the_answer_has_no_part_in_what_is_identifiable() -> None:
    """Cases that the truth calls untellable do not count for names, whatever was answered."""
    clear = score(findings=(RIGHT,))
    dim = score(number=2, right_name=False, identifiable={"coulomb_friction@joint1": False})
    goals = {goal.name: goal.share for goal in summary_of(Report((clear, dim), {}, FACTS)).goals}
    assert goals["name right, identifiable single effects"] == Share(1, 1)


def test_counting() -> None:
    cases = (
        score(findings=(RIGHT,)),
        score(number=2, findings=(WRONG,), right_name=False),
        score(number=3, family="none", **NOTHING, verdict="consistent"),
        score(
            number=4, family="foreign", **{**NOTHING, "place": True}, foreign="drag", verdict="unexplained"
        ),
    )
    found = summary_of(Report(cases, {}, FACTS))
    shares = {goal.name: goal.share for goal in found.goals}
    assert shares["a wrong name stated with more than 0.9"] == Share(1, 4)
    assert shares["false alarm where nothing is missing"] == Share(0, 1)
    assert shares["foreign physics left unnamed"] == Share(1, 1)
    assert shares["name right, identifiable single effects"] == Share(1, 2)
    assert found.confusion == {
        ("coulomb_friction", "coulomb_friction"): 1,
        ("coulomb_friction", "payload"): 1,
        ("foreign", "(unexplained)"): 1,
        ("none", "(consistent)"): 1,
    }
    assert found.calibration[-1][-1] == Share(1, 2)
    assert [case.number for case, _ in found.failures] == [2]
    assert found.improvement == pytest.approx((5.0 - 1.4) / (5.0 - 1.0))


def test_a_score_survives_its_notation() -> None:
    one = score(findings=(RIGHT,), models={"a": ModelScore(("x",), 1.0)})
    assert case_score(json.loads(json.dumps(dataclasses.asdict(one)))) == one


EVIL = "<script>alert(1)</script>"


def evil() -> CaseScore:
    return score(findings=(Finding(EVIL, 0.5, False),), right_name=False, message=EVIL, robot=EVIL)


def test_nothing_in_the_page_runs() -> None:
    page = render_challenge(Report((evil(),), {7: EVIL}, {**FACTS, "x": EVIL}))
    assert EVIL not in page
    assert page.count("<script>") == 2
    assert "https://" not in page.split("<script>")[0]


def test_the_markdown_page_lists_every_failure() -> None:
    cases = (score(number=41, verdict="no answer", message="boom"), score(number=42, findings=(RIGHT,)))
    page = markdown(Report(cases, {43: "diverges"}, FACTS), command="make", environment="now.")
    assert "- 41 (plain, single_axis)" in page
    assert "- 42 " not in page
    assert "43 could not be simulated: diverges" in page
    assert "so that they prove nothing" in page


def test_the_page_says_which_numbers_are_used_up() -> None:
    facts = {**FACTS, "first case": 21000}
    page = markdown(Report((score(),), {}, facts), command="c", environment="e")
    assert (
        "Cases 21000 to 21002: numbers kept for scoring. Scored before, and used up: 20000 to 20039" in page
    )

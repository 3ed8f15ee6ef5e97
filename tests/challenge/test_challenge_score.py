"""Scores: findings against the truth, causes of failure, fractions, and the resulting pages."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from challenge_cases import ARM, answer, design, hiding, made, score

from missing_physics.challenge.cases.truth import Foreign
from missing_physics.challenge.page import interval, markdown, wanted
from missing_physics.challenge.scoring.baselines import _library
from missing_physics.challenge.scoring.result import CaseScore, Finding, ModelScore, Report, case_score
from missing_physics.challenge.scoring.score import judged
from missing_physics.challenge.scoring.shortfalls import shortfalls
from missing_physics.challenge.scoring.summary import Goal, Share, cause_of, false_alarm, summary_of, wilson
from missing_physics.challenge.torques.along import ArmAlong
from missing_physics.reporting.pages.challenge_report import render_challenge
from robot_model import EffectUse

COULOMB = hiding("coulomb_friction", "joint1", ARM, torque=3.0)
FACTS = {"first case": 10000, "cases": 3, "isolation of the diagnosis": "none"}


def told(case: object, **said: object) -> dict:
    return judged(case, case.nominal, said["said"])  # type: ignore[attr-defined, arg-type]


def test_baseline_regressors_contain_no_measured_torque() -> None:
    """A measured torque would explain itself."""
    case = made(COULOMB)
    channels = {name: np.full_like(case.exact[0].time, 7.0) for name in ("joint1.torque", "joint2.torque")}
    other = dataclasses.replace(case.exact[0], channels={**case.exact[0].channels, **channels})
    one, two = (_library(ArmAlong(case.given, exact)) for exact in (case.exact[0], other))
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


def test_verdict_consistent_counts_as_no_place() -> None:
    given = {**answer("consistent"), "mismatch": [{"location": "joint1"}]}
    assert told(COULOMB, said=given)["place"] is False


def test_ambiguous_sets() -> None:
    given = answer("ambiguous", ("stribeck_friction", "joint1", 0.6))
    assert told(COULOMB, said=given)["in_set"] is False
    given["findings"][0]["ambiguous_with"] = ["coulomb_friction@joint1"]  # type: ignore[index]
    assert told(COULOMB, said=given)["in_set"] is True
    given["findings"][0]["ambiguous_with"] = ["coulomb_friction"]  # type: ignore[index]
    assert told(COULOMB, said=given)["in_set"] is True  # at the same place
    assert told(COULOMB, said=answer("explained"))["in_set"] is None


def test_missing_answer_is_not_a_success() -> None:
    result = judged(COULOMB, COULOMB.nominal, None)
    assert (result["verdict"], result["place"], result["right_name"]) == ("no answer", False, False)


def test_foreign_physics_is_right_if_located_and_unnamed() -> None:
    case = design(ARM).model_copy(
        update={"foreign": Foreign(kind="cubic_spring", joint="joint2", parameters={}), "family": "foreign"}
    )
    result = told(case, said={**answer("unexplained"), "mismatch": [{"location": "joint2"}]})
    assert (result["place"], result["right_name"]) == (True, None)


def test_spring_of_a_gear_with_losses_may_be_named_separately() -> None:
    lossy = {"effect": "gear_hysteresis", "at": "joint1", "torque": 2.0, "travel": 1e-4}
    said = answer("explained", ("gear_hysteresis", "joint1", 0.99), ("joint_elasticity", "joint1", 0.99))
    for stiffness, right in ((1e4, True), (0.0, False)):
        use = EffectUse.model_validate({**lossy, "stiffness": stiffness})
        found = told(COULOMB.model_copy(update={"hidden": (use,)}), said=said)["findings"]
        assert [finding.right for finding in found] == [True, right]


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
        ({"findings": (RIGHT, WRONG)}, "named, and a wrong effect besides"),
        (
            {"right_name": False, "findings": (WRONG,), "identifiable": {"coulomb_friction@joint1": False}},
            "wrong name where the data cannot tell",
        ),
        ({"right_name": False, "identifiable": {"coulomb_friction@joint1": False}}, ""),
    ],
)
def test_causes_of_failure(changes: dict, cause: str) -> None:
    assert cause_of(score(**changes)) == cause


CORRECTED = Finding("inertia@link1", 0.99, True)


@pytest.mark.parametrize(
    ("changes", "alarm"),
    [
        ({"verdict": "consistent"}, False),
        ({"verdict": "explained", "findings": (CORRECTED,)}, False),
        ({"verdict": "unexplained"}, False),
        ({"verdict": "explained", "findings": (CORRECTED, WRONG)}, True),
    ],
)
def test_difference_due_to_file_errors_is_not_a_false_alarm(changes: dict, alarm: bool) -> None:
    case = score(family="none", **NOTHING, file_exact=False, **changes)
    assert false_alarm(case) is alarm
    if changes["verdict"] != "consistent":  # the same answer to an exact file
        assert false_alarm(dataclasses.replace(case, file_exact=True)) is True
    assert false_alarm(score()) is None


def test_additional_correction_of_the_file_is_not_a_wrong_name() -> None:
    both = {"findings": (RIGHT, CORRECTED), "right_name": True}
    assert score(**both).exactly is True
    assert score(**{**both, "findings": (RIGHT, WRONG)}).exactly is False
    assert score(**{**both, "right_name": False}).exactly is False
    foreign = {**NOTHING, "family": "foreign", "foreign": "drag", "place": True}
    assert cause_of(score(**foreign, findings=(CORRECTED,))) == ""
    assert goals_of(score(**foreign, findings=(CORRECTED,)))["foreign physics left unnamed"].share.hits == 1


def test_wilson_interval_equals_its_closed_form() -> None:
    """The bounds solve |p - x| = z sqrt(p (1 - p) / n) for p."""
    z = 1.959964
    for hits, count in [(0, 10), (3, 10), (10, 10), (190, 200)]:
        for bound in wilson(hits, count):
            left = abs(bound - hits / count)
            # The root turns the rounding of a bound at 0 or 1 into its square root.
            assert left == pytest.approx(z * np.sqrt(max(bound * (1 - bound), 0.0) / count), abs=1e-7)
    assert wilson(0, 0) == (0.0, 1.0)


def test_goals_distinguish_reached_from_proven() -> None:
    assert Goal("a", Share(0, 0), least=0.9).verdict == "no case"
    assert Goal("a", Share(9, 10), least=0.95).verdict == "missed, not proven by so many cases"
    assert Goal("a", Share(5, 10), least=0.95).verdict == "missed"
    assert Goal("a", Share(10, 10), least=0.95).verdict == "reached, not proven by so many cases"
    assert Goal("a", Share(1000, 1000), least=0.95).verdict == "reached"
    assert Goal("a", Share(9, 100), most=0.01).verdict == "missed"
    assert Goal("a", Share(5, 5), 0.90, 0.98).verdict == "missed, not proven by so many cases"


def test_identifiability_does_not_depend_on_the_answer() -> None:
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


def goals_of(*cases: CaseScore) -> dict[str, Goal]:
    return {goal.name: goal for goal in summary_of(Report(cases, {}, FACTS)).goals}


def test_unidentifiable_effects_count_among_all_cases() -> None:
    dim = score(number=2, right_name=False, place=False, identifiable={"coulomb_friction@joint1": False})
    both = score(number=3, findings=(RIGHT, WRONG))
    mixed = score(number=4, family="mixed", right_name=False, identifiable={"coulomb_friction@joint1": False})
    goals = goals_of(score(findings=(RIGHT,)), dim, both, mixed)
    assert goals["place right, everything hidden, foreign physics too"].share == Share(3, 4)
    assert goals["name right, all single effects"].share == Share(2, 3)
    exact = goals["exactly the hidden effect and nothing else, identifiable single effects"]
    assert exact.share == Share(1, 2)
    assert exact.verdict == ""
    assert goals["all names right, identifiable mixed effects"].share.count == 0
    assert goals["all names right, all mixed effects"].share == Share(0, 1)


def test_crash_is_not_counted_as_leaving_physics_unnamed() -> None:
    """Foreign physics of which a crashed diagnosis says nothing was not left unnamed."""
    silent = {"family": "foreign", **NOTHING, "foreign": "drag", "place": False}
    goals = goals_of(score(**silent, verdict="no answer"), score(number=2, **silent, verdict="unexplained"))
    assert goals["foreign physics left unnamed"].share == Share(1, 2)


def test_answer_that_cannot_be_simulated_counts_as_no_improvement() -> None:
    lost = score(number=2, errors={"nominal": 5.0, "truth": 1.0})
    level = score(number=3, errors={"nominal": 1.0, "truth": 1.0})
    found = summary_of(Report((score(), lost, level), {}, FACTS))
    goals = {goal.name: goal.share for goal in found.goals}
    assert goals["at least 80 % of the true model's improvement"] == Share(1, 2)
    assert found.unrun == 1
    assert found.improvement == pytest.approx(0.45)
    page = markdown(Report((score(), lost), {}, FACTS), command="c", environment="e")
    assert "1 of these cases have no answer" in page


def test_confusion_uses_the_most_probable_name() -> None:
    """However right a less probable one is; and the right effect elsewhere is not the right one."""
    sure, elsewhere = Finding("payload@link1", 0.9, False), Finding("coulomb_friction@joint2", 0.9, False)
    right = Finding("coulomb_friction@joint1", 0.2, True)
    cases = (score(findings=(sure, right)), score(number=2, findings=(elsewhere, right)))
    assert summary_of(Report(cases, {}, FACTS)).confusion == {
        ("coulomb_friction", "coulomb_friction, elsewhere"): 1,
        ("coulomb_friction", "payload"): 1,
    }


def stated(probability: float, right: int, count: int) -> list[CaseScore]:
    return [
        score(number=k, findings=(Finding("a@b", probability, k < right),), right_name=k < right)
        for k in range(count)
    ]


@pytest.mark.parametrize(
    ("cases", "verdict", "points"),
    [
        (stated(0.95, 9, 9), "no case", None),  # too few to count
        (stated(0.96, 10, 10), "reached, not proven by so many cases", 4.0),
        (stated(0.95, 95, 100), "reached, not proven by so many cases", 0.0),
        (stated(0.95, 380, 400), "reached", 0.0),
        (stated(0.95, 8, 10), "missed, not proven by so many cases", 15.0),
        (stated(0.95, 5, 10), "missed", 45.0),
        (stated(0.95, 380, 400) + stated(0.55, 3, 10), "missed, not proven by so many cases", 25.0),
    ],
)
def test_calibration_is_a_goal(cases: list[CaseScore], verdict: str, points: float | None) -> None:
    goal = summary_of(Report(tuple(cases), {}, FACTS)).goals[-1]
    assert goal.verdict == verdict
    if points is not None:
        assert 100 * goal.share.value == pytest.approx(points, abs=1e-9)
        assert f"{points:.1f} points" in interval(goal.share)
    assert wanted(goal) == "at most 5 points"


def test_all_cases_that_miss_a_goal_are_listed() -> None:
    missed = Finding("coulomb_friction@joint1", 0.99, True, (), {"torque": False, "a": True})
    dim = {"identifiable": {"coulomb_friction@joint1": False}, "right_name": False, "place": False}
    cases = (
        score(number=11, findings=(missed,)),
        score(number=12, errors={"nominal": 5.0, "answer": 2.0, "truth": 1.0}),
        score(number=13, errors={"nominal": 5.0, "truth": 1.0}),
        score(number=14, findings=(WRONG,), **dim),
        score(number=15, right_name=False, in_set=True),
    )
    assert shortfalls(cases) == {
        "place not right": ("14",),
        "not everything hidden named": ("14 (not identifiable)", "15 (in its set)"),
        "a wrong name (probability)": ("14 payload@link1 (0.99)",),
        "under 80% of the true model's improvement": ("12 (75%)", "13 (no answer that runs)"),
        "true parameter outside its interval": ("11 coulomb_friction@joint1 (torque)",),
    }
    report = Report(cases, {}, FACTS)
    for page in (markdown(report, command="c", environment="e"), render_challenge(report)):
        for words in (
            "14 (not identifiable)",
            "13 (no answer that runs)",
            "11 coulomb_friction@joint1 (torque)",
        ):
            assert words in page


def test_both_pages_list_missed_goals_and_how_to_repeat_a_case() -> None:
    report = Report((score(findings=(WRONG,), right_name=False),), {}, {**FACTS, "first case": 22000})
    for page in (markdown(report, command="c", environment="e"), render_challenge(report)):
        for words in (
            "missing-physics challenge --cases 1 --seed N",
            "docs/challenge.md",
            "scored 2 times before",
            "goals 2 are missed",
        ):
            assert words in page.replace("\n", " ")


def test_score_is_restored_from_json() -> None:
    one = score(findings=(RIGHT,), models={"a": ModelScore(("x",), 1.0)})
    assert case_score(json.loads(json.dumps(dataclasses.asdict(one)))) == one


EVIL = "<script>alert(1)</script>"


def evil() -> CaseScore:
    return score(findings=(Finding(EVIL, 0.5, False),), right_name=False, message=EVIL, robot=EVIL)


def test_challenge_page_escapes_text() -> None:
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


def test_page_lists_case_numbers_used_by_earlier_scores() -> None:
    facts = {**FACTS, "first case": 21000}
    page = markdown(Report((score(),), {}, facts), command="c", environment="e")
    assert (
        "Cases 21000 to 21002: numbers kept for scoring. Scored before, and used up: 20000 to 20039" in page
    )

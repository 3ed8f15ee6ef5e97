"""diagnosis.json: documented keys and types, reproducible text, finite numbers."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from documented_keys import SHAPE, check

from missing_physics.diagnosis.comparison.summary import summary
from missing_physics.results.comparison import Compared, Comparison, LogScore, Timing
from missing_physics.results.result import (
    Alternative,
    ChannelFit,
    Curve,
    Dependence,
    Diagnosis,
    Errors,
    Estimate,
    Experiment,
    Finding,
    Fit,
    Mismatch,
    ParameterChange,
    Unnamed,
)
from robot_model import load_robot

FINDING = Finding(
    effect="stribeck_friction",
    location="joint2",
    probability=0.97,
    parameters={"static_torque": Estimate(4.4, (4.1, math.nan), "N m")},
    alternatives=(Alternative("lugre_friction", "joint2", 0.02, "the data favour the finding 48 to 1"),),
)
MISMATCH = Mismatch(
    "joint2",
    "joint2.torque",
    0.83,
    1e-9,
    windows=((3.1, 3.9),),
    depends_on=(Dependence("joint2.velocity", (-0.02, 0.02), 0.7),),
    frequency_hz=(1.85,),
    words="joint2: 83% of the mismatch.",
)
UNNAMED = Unnamed(
    location="joint2",
    channel="joint2.torque",
    unit="N m",
    depends_on=("joint2.velocity",),
    share=0.6,
    left=1.0,
    knots=((-1.0, 1.0),),
    curves=(Curve("", (-0.5, 0.5), ((-0.6, -0.4), (0.4, 0.6))),),
    words="Something swings.",
)
COMPARED = Compared("N m", Errors(1.0, 1.1), Errors(0.4, 0.5), Errors(0.2, 0.21), 0.18)
DIAGNOSIS = Diagnosis(
    robot="arm",
    recordings=("a.csv",),
    validation=(),
    verdict="explained",
    summary="words",
    mismatch=(MISMATCH,),
    findings=(FINDING,),
    fit=Fit(
        {
            "joint2.torque": ChannelFit(
                "N m", Errors(1.0, 1.1), Errors(0.2, np.float64(0.21)), 0.18, standard=Errors(0.4, 0.5)
            )
        },
        0.81,
    ),
    experiments=(Experiment(("a", "b"), "do", "why", "experiment_1.csv"),),
    could_not_tell=("something",),
    unnamed=(UNNAMED,),
    comparison=Comparison({"joint2.torque": COMPARED}),
    log_score=LogScore(-9.0, -5.0, -4.0),
    timing=(Timing("a.csv", "torque", 0.002, (0.001, 0.003), 0.5, undone=True),),
    nominal_parameters=(
        ParameterChange("link1.mass", "kg", 2.0, 2.1, (2.0, 2.2), prior95=(1.0, 3.0)),
        ParameterChange("link2.mass", "kg", 2.0, 2.9, (2.8, 3.0), prior95=(1.0, 3.0)),
    ),
)


def test_the_file_has_the_documented_keys_and_types() -> None:
    data = json.loads(DIAGNOSIS.to_json())
    check(data, SHAPE)
    assert data["schema"] == 2
    assert next(iter(data)) == "schema"
    assert [change["name"] for change in data["nominal_changes"]] == ["link2.mass", "link1.mass"]
    assert data["findings"][0]["parameters"]["static_torque"] == {
        "value": 4.4,
        "ci95": [4.1, None],
        "unit": "N m",
        "prior95": [None, None],
    }
    assert data["mismatch"][0]["windows"] == [[3.1, 3.9]]


def test_non_finite_numbers_become_null() -> None:
    for value in (math.nan, math.inf, -math.inf, np.float64("nan")):
        text = Diagnosis(**{**vars(DIAGNOSIS), "fit": Fit({}, value)}).to_json()
        assert json.loads(text, parse_constant=pytest.fail)["fit"]["validation_improvement"] is None


def test_the_text_is_the_same_each_time_and_unicode_stays() -> None:
    assert DIAGNOSIS.to_json() == DIAGNOSIS.to_json()
    assert "größer" in Diagnosis(**{**vars(DIAGNOSIS), "summary": "größer"}).to_json()
    assert DIAGNOSIS.to_json().endswith("}\n")


def finding(probability: float, *rivals: str) -> Finding:
    return Finding("coulomb_friction", "joint1", probability, {}, ambiguous_with=rivals)


def test_summaries_explain_the_verdict() -> None:
    robot = load_robot("two_link_arm")
    fit = Fit({}, 0.81)

    def message(verdict: str, *findings: Finding) -> str:
        return summary(robot, verdict, (MISMATCH,), findings, fit)  # type: ignore[arg-type]

    assert message("consistent").startswith("The recording agrees with two_link_arm")
    explained = message("explained", FINDING)
    assert MISMATCH.words in explained
    assert "Stribeck friction at joint2 (97%)" in explained
    assert "falls by 81%" in explained
    ambiguous = message("ambiguous", finding(0.5, "gravity@base"))
    assert "Coulomb friction at joint1 cannot be told apart from gravity@base" in ambiguous
    assert "no effect of the catalogue explains it" in message("unexplained")
    assert "no effect of the catalogue explains it" not in explained
    assert "has no name" not in explained
    beside = summary(robot, "explained", (MISMATCH,), (FINDING,), fit, (UNNAMED,))
    assert beside.endswith("Part of the mismatch has no name. Something swings.")
    assert summary(robot, "unexplained", (MISMATCH,), (), fit, (UNNAMED,)).endswith("Something swings.")

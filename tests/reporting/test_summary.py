"""The printed summary: complete, ordered by importance, and plain text outside a terminal."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import pytest
from reporting_cases import empty_result, hidden_friction
from rich.console import Console

from missing_physics.plausibility import before
from missing_physics.reporting import print_summary
from missing_physics.reporting.elements.verdicts import moved_texts
from missing_physics.results.result import Estimate, ParameterChange, Result, Timing, Unnamed
from robot_model import read_robot


def printed(result: Result, *, terminal: bool = False) -> str:
    out = io.StringIO()
    console = Console(
        file=out, width=100, force_terminal=terminal, color_system="auto" if not terminal else "256"
    )
    print_summary(result, console)
    return out.getvalue()


def test_summary_states_effect_place_size_and_fit_in_this_order() -> None:
    result = hidden_friction(seconds=4.0)
    text = printed(result)
    fit = result.diagnosis.fit.channels["joint2.torque"]
    before, after = fit.before.validation_rms, fit.after.validation_rms
    parts = [
        "EXPLAINED: Coulomb friction and Torque offset at joint2",
        "Numbers of the robot file that the recordings contradict",
        "joint2.viscous_friction.coefficient 1.310 [1.270, 1.350] N m s/rad, in the robot file 1.200",
        "Changes sign with the velocity of joint2 and keeps its size.",
        "4.40 ± 0.30 N m",
        "0.800 ± 0.010 N m",
        "98 %",
        f"{before:.2f} -> {after:.4f} N m rms",
        "Temperature dependence: no temperature channel.",
    ]
    places = [text.find(part) for part in parts]
    assert -1 not in places, parts[places.index(-1)]
    assert places == sorted(places)


def changed(name: str, estimate: float, half: float, prior: float) -> ParameterChange:
    """A number that is 1 kg in the robot file."""
    interval, before = (estimate - half, estimate + half), (1.0 - prior, 1.0 + prior)
    return ParameterChange(name, "kg", 1.0, estimate, interval, prior95=before)


def test_changed_file_parameters_follow_the_verdict_most_significant_first() -> None:
    """What counts is the change relative to what was credible, not the one in kg."""
    result = hidden_friction(seconds=4.0)
    changes = (
        changed("small.mass", 1.5, 0.1, prior=1.0),
        changed("sure.mass", 1.2, 0.1, prior=0.1),
        changed("right.mass", 1.3, 0.4, prior=0.1),
    )
    moved = replace(result, diagnosis=replace(result.diagnosis, nominal_parameters=changes))
    text = printed(moved)
    heading, below = text.split("Numbers of the robot file that the recordings contradict")
    assert heading.startswith("EXPLAINED")
    assert "Where model and recording differ" not in heading
    listed = below.split("Where model and recording differ")[0]
    assert listed.index("sure.mass 1.20 [1.10, 1.30] kg") < listed.index("small.mass 1.50 [1.40, 1.60] kg")
    assert "right.mass" not in text
    page = moved_texts(moved.diagnosis)
    assert [words.split(".")[0] for words in page] == ["sure", "small"]


def test_summary_is_plain_text_outside_a_terminal() -> None:
    text = printed(hidden_friction(seconds=4.0))
    assert "\x1b" not in text
    assert "\x1b" in printed(hidden_friction(seconds=4.0), terminal=True)


def test_names_in_the_summary_are_not_markup() -> None:
    assert "[bold]x[/bold]" in printed(hidden_friction(seconds=4.0, name="[bold]x[/bold]"))


@pytest.mark.parametrize("verdict", ["consistent", "not_enough_data", "unexplained", "ambiguous"])
def test_summary_prints_all_verdicts(verdict: str) -> None:
    for series in (True, False):
        text = printed(empty_result(verdict, series=series))  # type: ignore[arg-type]
        assert verdict.replace("_", " ").upper() in text
        told = "Changes sign" if verdict == "unexplained" else f"A summary that says {verdict}."
        assert told in text


@pytest.mark.parametrize("verdict", ["explained", "partly_explained"])
def test_without_findings_changed_file_parameters_are_reported(verdict: str) -> None:
    result = hidden_friction(seconds=4.0)
    told = replace(result.diagnosis, verdict=verdict, findings=())  # type: ignore[arg-type]
    text = printed(replace(result, diagnosis=told))
    assert f"{verdict.replace('_', ' ').upper()}: numbers of the robot file" in text
    assert "Numbers of the robot file are off" in text
    assert "named, modelled and proven" not in text


def test_asymmetric_interval_is_printed_unchanged() -> None:
    result = hidden_friction(seconds=4.0)
    finding = replace(result.diagnosis.findings[0], parameters={"torque": Estimate(1.0, (0.9, 1.6), "N m")})
    text = printed(replace(result, diagnosis=replace(result.diagnosis, findings=(finding,))))
    assert "1.00 [0.90, 1.60] N m" in text


def test_long_lists_are_shortened_with_a_note() -> None:
    result = hidden_friction(seconds=4.0)
    many = tuple(f"point {n}" for n in range(20))
    text = printed(replace(result, diagnosis=replace(result.diagnosis, could_not_tell=many)))
    assert "and 12 more" in text


def test_finding_with_remaining_residual_is_reported_with_a_reservation() -> None:
    """`unexplained` beside names must not read as if they were the answer."""
    result = hidden_friction(seconds=4.0)
    doubted = replace(result, diagnosis=replace(result.diagnosis, verdict="unexplained"))
    text = printed(doubted)
    assert "UNEXPLAINED: perhaps Coulomb friction" in text
    assert "the findings do not explain it" in text
    assert "not named" not in text


def test_first_line_lists_the_rivals_of_each_finding_in_brackets() -> None:
    """`A, B or C and D` would leave open which of them belong together."""
    result = hidden_friction(seconds=4.0)
    first, *others = result.diagnosis.findings
    open_ = replace(first, ambiguous_with=("lugre_friction", "actuator_lag@joint1"))
    text = printed(replace(result, diagnosis=replace(result.diagnosis, findings=(open_, *others))))
    headline = " ".join(text.split("\n\n")[0].split())
    assert (
        "Coulomb friction (or LuGre friction or Actuator lag at joint1) and Torque offset at joint2"
        in headline
    )


def test_findings_are_grouped_by_place_and_fractions_by_kind() -> None:
    result = hidden_friction(seconds=4.0)
    friction, offset = result.diagnosis.findings
    spring = replace(offset, effect="cable_spring", location="joint1")
    torque = result.diagnosis.mismatch[0]
    gap = replace(
        torque, channel="joint1.position", location="joint1", share=1.0, words="its encoders differ"
    )
    mixed = replace(result.diagnosis, findings=(friction, spring, offset), mismatch=(gap, torque))
    text = printed(replace(result, diagnosis=mixed))
    below = text.index("What is missing")
    places = [text.index(words, below) for words in ("Coulomb", "Torque offset", "Cable or hose spring")]
    assert places == sorted(places)
    assert text.index(torque.words) < text.index("its encoders differ")


def test_named_effects_with_an_unnamed_remainder_do_not_claim_completeness() -> None:
    result = hidden_friction(seconds=4.0)
    more = Unnamed("joint1", "joint1.torque", "N m", ("joint1.velocity",), 0.5, 1.0, (), (), "A curve.")
    text = printed(replace(result, diagnosis=replace(result.diagnosis, unnamed=(more,))))
    assert "a further force has no name" in text
    assert "The mismatch is named" not in text


def test_parameters_not_informed_by_the_recording_are_omitted() -> None:
    """Neither a finding's number nor one of the robot file."""
    result = hidden_friction(seconds=4.0)
    told = {
        "mass": Estimate(0.0, (-38.0, 38.0), "kg", prior95=(-0.014, 0.014)),
        "first_moment_z": Estimate(-0.0015, (-0.0016, -0.0014), "kg m", prior95=(-0.001, 0.001)),
    }
    finding = replace(result.diagnosis.findings[0], parameters=told)
    text = printed(replace(result, diagnosis=replace(result.diagnosis, findings=(finding,))))
    assert "38" not in text.split("What is missing")[1].split("On held-out")[0]
    assert "first_moment_z  -0.00150 ± 1.0e-4 kg m" in text
    assert "These data do not determine: mass." in text


def test_prior_of_a_mass_property_is_that_of_its_body() -> None:
    robot = read_robot("two_link_arm")[0]
    low, high = before("inertia", "link1", "mass", robot)
    assert low == -high
    assert 0.3 * robot.link("link1").mass < high < robot.link("link1").mass
    assert before("coulomb_friction", "joint1", "torque", robot) == (-math.inf, math.inf)


def test_offsets_of_several_recordings_are_one_line() -> None:
    result = hidden_friction(seconds=4.0)
    found = tuple(
        Timing(recording, channel, 1e-3 * late, (0.0, 2e-3), late, undone=False)
        for recording, channel, late in (
            ("a", "torque", 0.4),
            ("b", "torque", 1.3),
            ("", "torque of joint1", 0.7),
            ("", "position of joint1", 0.5),
        )
    )
    text = printed(replace(result, diagnosis=replace(result.diagnosis, timing=found)))
    assert text.count("Timing:") == 1
    told = " ".join(text[text.index("Timing:") :].split())
    assert told.startswith(
        "Timing: torque is 0.40 to 1.30 samples (0.8 ms) late; position is 0.50 samples (0.5 ms) late; this"
    )

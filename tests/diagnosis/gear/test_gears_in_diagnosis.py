"""Gears in a diagnosis: exact laws along a torque, the augmented robot file, joint torques."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from two_encoders import arm, half_open

import exudyn_model
from missing_physics.diagnosis import diagnose
from missing_physics.diagnosis.gear.hysteresis import dahl
from missing_physics.diagnosis.gear.transmission import TransmissionResult
from missing_physics.diagnosis.gear_file.effects import compliant_joints, found_gears
from missing_physics.diagnosis.gear_file.merge import with_transmission
from missing_physics.diagnosis.pipeline import Options
from missing_physics.results.result import (
    ChannelFit,
    Errors,
    Estimate,
    Finding,
    Result,
)
from reference_model.simulation import simulate
from robot_model import Recording, Robot, robot_from_toml, robot_to_toml


@given(
    twists=st.lists(st.floats(-3e-3, 3e-3), min_size=1, max_size=20),
    stiffness=st.floats(1e3, 1e5),
    height=st.floats(0.0, 30.0),
    travel=st.floats(1e-5, 1e-3),
)
@example(twists=[1.6e-3], stiffness=1e3, height=5e-324, travel=1.2e-4)  # a ratio that underflows
def test_hysteresis_state_from_the_torque_equals_that_from_the_twist(
    twists: list[float], stiffness: float, height: float, travel: float
) -> None:
    e, z, states, torques = 0.0, 0.0, [0.0], [0.0]
    for twist in twists:
        way = 1.0 if twist > e else -1.0
        z = way + (z - way) * np.exp(-abs(twist - e) / travel)
        e = twist
        states.append(z)
        torques.append(stiffness * e + height * z)
    found = dahl(np.array(torques), stiffness * travel, height)
    # a torque of some hundred N m holds differences of the state to rounding times K travel / T
    assert np.abs(found - states).max() < 1e-6


def test_torques_beyond_the_hysteresis_range_reach_the_limiting_branch() -> None:
    for travel in (1e-8, 1e-4, 1e-1):
        found = dahl(np.array([0.0, 900.0, -900.0, 900.0]), travel, 1.0)
        # before the flank is 1 - |z| = exp(-(900 - 2) / travel), which is nothing
        assert found.tolist() == [0.0, 1.0, -1.0, 1.0]
    # where 1 - |z| is next to the smallest number there is
    for ratio in np.linspace(600.0, 800.0, 41):
        assert dahl(np.array([0.0, ratio]), 1.0, 1.4).tolist() == [0.0, 1.0]


def finding(effect: str, at: str = "joint1", **values: float) -> Finding:
    parameters = {name: Estimate(value, (0.9 * value, 1.1 * value), "") for name, value in values.items()}
    return Finding(effect, at, 1.0, parameters)


def gap(*findings: Finding) -> TransmissionResult:
    return TransmissionResult(findings=findings)


ELASTIC = finding("joint_elasticity", stiffness=8e3, damping=8.0)


def test_gear_findings_become_effects_of_both_engines() -> None:
    lossy = finding("gear_hysteresis", torque=3.0, travel=2e-4)
    for findings in ([ELASTIC], [ELASTIC, finding("backlash", half_width=5e-4)], [ELASTIC, lossy]):
        gears = found_gears(arm(), gap(*findings))
        assert {use.effect for use in gears.uses} == {f.effect for f in findings}
        assert compliant_joints(arm(), gap(*findings)) == ("joint1",)
        assert gears.words == ()
        robot = arm(duration=0.05).with_effects(*gears.uses)
        simulate(robot, sensors=False)
        exudyn_model.simulate(robot, sensors=False)
    assert gears.uses[0].parameters == {"stiffness": 8e3, "damping": 8.0}


def test_flanks_of_unknown_stiffness_are_assumed_and_that_is_reported() -> None:
    gears = found_gears(arm(), gap(finding("backlash", half_width=5e-4)))
    assert gears.uses[0].parameters["stiffness"] > 1e5
    assert any("assumes" in words for words in gears.words)
    simulate(arm(duration=0.05).with_effects(*gears.uses), sensors=False)


def test_effects_that_cannot_be_simulated_are_omitted_with_a_note() -> None:
    play, lossy = finding("backlash", half_width=5e-4), finding("gear_hysteresis", torque=3.0, travel=2e-4)
    both = found_gears(arm(), gap(ELASTIC, play, lossy))
    assert [use.effect for use in both.uses] == ["joint_elasticity", "backlash"]
    assert any("cannot be simulated together" in words for words in both.words)
    lost = found_gears(arm(), gap(finding("gear_hysteresis", amplitude=1e-4, travel=0.1)))
    assert lost.uses == ()
    assert any("depends on the motion" in words for words in lost.words)
    listed = arm({"effect": "joint_elasticity", "at": "joint1", "stiffness": 1e4})
    assert found_gears(listed, gap(ELASTIC)).uses == ()
    assert compliant_joints(listed, None) == ("joint1",)
    data = arm().model_dump()
    data["joints"][0]["actuator"]["rotor_inertia"] = 0.0
    assert "rotor_inertia" in found_gears(Robot.model_validate(data), gap(ELASTIC)).words[0]


def test_faulty_encoder_is_not_used_for_the_joint_motion() -> None:
    late = finding("sensor_delay", "joint1.position", delay=1e-3)
    assert compliant_joints(arm(), gap(ELASTIC, late)) == ()
    assert compliant_joints(arm(), None) == ()


def between(*findings: Finding, left: float) -> TransmissionResult:
    """A gap of a hundred times the noise, of which `left` remains."""
    channel = ChannelFit("rad", Errors(100.0, 100.0), Errors(left, left), 1.0)
    return TransmissionResult(findings=findings, fit={"joint1.position - joint1.motor_position": channel})


def test_headline_is_that_of_the_gears_if_only_gear_effects_are_named() -> None:
    """A tenth of the noise's hundredfold is left: 90 %, whatever the torques, which name nothing, show."""
    play = finding("backlash", half_width=5e-4)
    found = with_transmission(half_open(), between(play, left=10.0), arm()).diagnosis
    assert found.fit.validation_improvement == pytest.approx(0.9)
    assert (
        with_transmission(half_open(), between(left=10.0), arm()).diagnosis.fit.validation_improvement == 0.0
    )
    named = half_open()
    named = replace(named, diagnosis=replace(named.diagnosis, findings=(finding("viscous_friction"),)))
    assert (
        with_transmission(named, between(play, left=10.0), arm()).diagnosis.fit.validation_improvement == 0.0
    )


def test_encoder_errors_are_written_to_the_augmented_robot() -> None:
    """With the numbers found, within the catalogue's bounds, and once."""
    cycle = finding("encoder_eccentricity", "joint2.motor_position", cosine=1e-3, sine=-0.5, order=1.0)
    late = finding("sensor_delay", "joint1.position", delay=1e-3)
    bent = finding("link_flexibility", "link1", static_deflection=1e-5)  # which no file can hold
    merged = with_transmission(half_open(), between(cycle, late, bent, left=20.0), arm())
    written = robot_from_toml(merged.augmented_robot_toml)
    new = [use for use in written.effects if use not in arm().effects]
    assert {(use.effect, use.at): use.parameters for use in new} == {
        ("encoder_eccentricity", "joint2.motor_position"): {"cosine": 1e-3, "sine": -0.1, "order": 1.0},
        ("sensor_delay", "joint1.position"): {"delay": 1e-3},
    }
    simulate(written.model_copy(update={"reference": arm(duration=0.05).reference}))
    again = with_transmission(merged, between(late, left=20.0), arm())
    assert again.augmented_robot_toml == merged.augmented_robot_toml
    bare = arm().model_copy(update={"sensors": arm().sensors[:2]})
    blind = replace(half_open(), augmented_robot_toml=robot_to_toml(bare))
    unwritten = with_transmission(blind, between(late, left=20.0), bare)
    assert robot_from_toml(unwritten.augmented_robot_toml).effects == bare.effects
    assert any("lists no sensor" in words for words in unwritten.diagnosis.could_not_tell)


@pytest.mark.parametrize(
    ("probability", "rivals", "verdict"),
    [(0.99, (), "explained"), (0.6, (), "explained"), (0.93, ("joint_elasticity@joint1",), "ambiguous")],
)
def test_only_listed_rivals_make_a_gear_finding_ambiguous(
    probability: float, rivals: tuple[str, ...], verdict: str
) -> None:
    """Only a rival that is listed makes it so."""
    play = replace(finding("backlash", half_width=5e-4), probability=probability, ambiguous_with=rivals)
    merged = with_transmission(half_open(verdict="consistent"), between(play, left=20.0), arm())
    assert merged.diagnosis.verdict == verdict


#: Noise of the torque wears down the state of friction in a gear, which comes out a few percent too large.
WORN = 0.03
SPRING = {"stiffness": 8e3, "damping": 8.0}
#: Gravity, what is named and its numbers, what is hidden.
CASES: dict[str, tuple[bool, dict[str, Any], list[dict[str, Any]]]] = {
    "joint_elasticity": (
        False,
        {"joint_elasticity": SPRING},
        [{"effect": "joint_elasticity", "at": "joint1", **SPRING}],
    ),
    "joint_elasticity under a load": (  # which presses on one flank all the time, so that play may be there
        True,
        {"joint_elasticity": SPRING},
        [{"effect": "joint_elasticity", "at": "joint1", **SPRING}],
    ),
    "backlash": (  # without gravity, which would hold the flanks together
        False,
        {"backlash": {"half_width": 5e-4}, "joint_elasticity": {"stiffness": 3e4}},
        [{"effect": "backlash", "at": "joint1", "half_width": 5e-4, "stiffness": 3e4, "damping": 10.0}],
    ),
    "gear_hysteresis": (
        False,
        {"gear_hysteresis": {"torque": 4.0, "travel": 3e-4}, "joint_elasticity": {"stiffness": 1e4}},
        [
            {"effect": "gear_hysteresis", "at": "joint1", "torque": 4.0, "travel": 3e-4, "stiffness": 1e4}
            | {"damping": 5.0}
        ],
    ),
    "nothing": (True, {}, []),
}


def recorded(robot: Robot, seed: int) -> tuple[Recording, Recording]:
    """By Exudyn: the reference motion, and one with other phases."""
    assert robot.reference is not None
    moved = tuple(
        motion.model_copy(update={"phases": tuple(phase + 0.7 for phase in motion.phases)})
        for motion in robot.reference.joints
    )
    other = robot.model_copy(update={"reference": robot.reference.model_copy(update={"joints": moved})})
    return exudyn_model.simulate(robot, seed=seed), exudyn_model.simulate(other, seed=seed + 1)


@pytest.mark.proof
@pytest.mark.parametrize("hidden", CASES)
def test_hidden_gear_effects_simulated_by_exudyn_are_found_and_written(hidden: str) -> None:
    gravity, truth, effects = CASES[hidden]
    robot = arm(gravity=gravity)
    one, two = recorded(arm(*effects, gravity=gravity), seed=5)
    result: Result = diagnose(robot, [one], [two], options=Options(experiments=False))
    found = {f.effect: f for f in result.diagnosis.findings}
    assert set(found) == set(truth)
    assert not any(f.ambiguous_with for f in found.values())
    assert result.diagnosis.verdict == ("explained" if truth else "consistent")
    hidden_play = any("play between its flanks would not show" in s for s in result.diagnosis.could_not_tell)
    assert hidden_play == bool(gravity and truth)
    for effect, values in truth.items():
        assert found[effect].location == "joint1"
        for name, value in values.items():
            estimate = found[effect].parameters[name]
            half = (estimate.ci95[1] - estimate.ci95[0]) / 2
            assert abs(estimate.value - value) <= max(half, WORN * value), (effect, name)
    written = robot_from_toml(result.augmented_robot_toml)
    assert {use.effect for use in written.effects if use.at == "joint1"} == {"viscous_friction", *truth}
    again = simulate(written, sensors=False)
    gap_before, gap_after = (r["joint1.position"] - r["joint1.motor_position"] for r in (one, again))
    if truth:  # the written robot, simulated, shows the gap that was recorded, but for impacts of the flanks
        size = np.std(gap_before)
        assert np.std(gap_before - gap_after) < (0.35 if "backlash" in truth else 0.05) * size


@pytest.mark.proof
def test_gear_effect_in_the_robot_file_is_not_a_finding() -> None:
    """One effect is missing beside the gear."""
    robot = arm({"effect": "joint_elasticity", "at": "joint1", "stiffness": 8e3, "damping": 8.0})
    rub = {"effect": "coulomb_friction", "at": "joint1", "torque": 4.0}
    hidden = Robot.model_validate({**robot.model_dump(), "effects": [*robot.model_dump()["effects"], rub]})
    one, two = recorded(hidden, seed=7)
    result = diagnose(robot, [two], [one], options=Options(experiments=False))
    (only,) = result.diagnosis.findings
    assert (only.effect, only.location) == ("coulomb_friction", "joint1")
    low, high = only.parameters["torque"].ci95
    assert low <= 4.0 <= high
    assert any("was not diagnosed" in sentence for sentence in result.diagnosis.could_not_tell)
    written = robot_from_toml(result.augmented_robot_toml)
    assert {use.effect for use in written.effects if use.at == "joint1"} == {
        "viscous_friction",
        "joint_elasticity",
        "coulomb_friction",
    }

"""Robots and effects beyond rigid arms and joint torques: each is drawn, generated and scored."""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from challenge_cases import answer, made, numbered, short

from missing_physics.challenge.cases.ranges import Draw, Scale
from missing_physics.challenge.cases.truth import Design, Warming
from missing_physics.challenge.concealing.conceal import EXACT, Concealed, concealed
from missing_physics.challenge.draws import warming
from missing_physics.challenge.draws.robots import BENDING, ROBOTS
from missing_physics.challenge.draws.wider_ranges import GEARS, STRUCTURES
from missing_physics.challenge.scoring.information import IDENTIFIABLE, distances
from missing_physics.challenge.scoring.score import scored
from missing_physics.challenge.torques.along import ArmAlong
from robot_model import EffectUse

#: Numbers for development with these robots; the last is one whose exact beams differ from its modes.
ARM, BENT, BEAMS = 10005, 10700, 10718
#: One with encoders at its motors.
GEARED = 10765
MANY = range(10730, 10780)


@pytest.fixture(scope="module")
def drawn() -> list[Design]:
    return [numbered(number) for number in MANY]


def test_all_robots_and_kinds_are_drawn(drawn: list[Design]) -> None:
    robots = Counter(case.shipped for case in drawn)
    assert set(robots) == set(ROBOTS)
    bent = [case for case in drawn if ROBOTS[case.shipped] is BENDING]
    assert 0.08 < len(bent) / len(drawn) < 0.2
    assert {case.beams for case in bent} == {True, False}
    assert not any(case.beams for case in drawn if case not in bent)
    effects = {use.effect for case in drawn for use in case.hidden}
    assert effects & set(GEARS)
    assert effects & set(STRUCTURES)
    assert warming.EFFECT in effects


def test_sensors_do_not_reveal_the_hidden_effect(drawn: list[Design]) -> None:
    """Encoders at the motors and thermometers are in cases where nothing, or something else, is hidden."""
    with_motor = [c for c in drawn if any("motor_position" in s.channel for s in c.nominal.sensors)]
    geared = [c for c in with_motor if {use.effect for use in c.hidden} & set(GEARS)]
    assert 0 < len(geared) < 0.6 * len(with_motor)
    warm = [c for c in drawn if c.warming]
    fading = [c for c in warm if any(use.effect == warming.EFFECT for use in c.hidden)]
    assert 0 < len(fading) < 0.6 * len(warm)
    for group in (with_motor, warm):
        assert {"none", "foreign"} & {case.family for case in group}


def test_effects_are_hidden_only_in_robots_that_show_them(drawn: list[Design]) -> None:
    for case in drawn:
        for use in case.hidden:
            assert use.effect not in STRUCTURES or use.effect in ROBOTS[case.shipped].structures
            if use.effect in GEARS:
                assert case.nominal.sensor(f"{use.at}.motor_position")
            if use.effect == warming.EFFECT:
                assert case.warming
                assert case.warming.joint == use.at
        in_gears = [use.at for use in case.hidden if use.effect in GEARS]
        assert len(set(in_gears)) == len(in_gears)


def hidden_in(number: int, use: EffectUse | None, *, seconds: float = 1.0, **changes: object) -> Design:
    """A drawn robot without friction and with this hidden, its motions cut short."""
    case = short(numbered(number), seconds=seconds)
    nominal = case.nominal.model_copy(update={"effects": ()})
    values = {"hidden": (use,) if use else (), "foreign": None, "family": "plain", "noise_ratio": None}
    return case.model_copy(update={**values, "nominal": nominal, "beams": False, "warming": None, **changes})


def structure(effect: str) -> Callable[[Design], EffectUse]:
    return lambda case: STRUCTURES[effect](Draw(np.random.default_rng(3)), case.nominal)


@pytest.mark.parametrize(
    ("effect", "number"),
    [
        pytest.param("link_flexibility", ARM, marks=pytest.mark.proof),
        pytest.param("base_motion", ARM, marks=pytest.mark.proof),
        pytest.param("contact", ARM, marks=pytest.mark.proof),
        pytest.param("modal_damping", BENT, marks=pytest.mark.proof),
        pytest.param("slosh", BENT, marks=pytest.mark.proof),
        pytest.param("reaction_wheel", BENT, marks=pytest.mark.proof),
    ],
)
def test_cases_of_structures_are_generated_with_known_effect_torques(effect: str, number: int) -> None:
    """What the reference model says they do to the torques is what Exudyn's torques show."""
    use = structure(effect)(hidden_in(number, None))
    case = made(hidden_in(number, use))
    assert set(case.files()) == {"robot.toml", "recording.csv", "validation.csv"}
    along = ArmAlong(case.sensed_by, case.exact[0])
    missing, part = along.torque - along.nominal(), along.part(use)
    noise = np.array([along.robot.sensor(f"{joint}.torque").noise for joint in along.joints])
    assert np.all(np.isfinite(part))
    # Vibration by the trapezoidal rule at 1 ms lags by a hundredth of its amplitude.
    assert np.all(np.abs(missing - part).max(0) < 0.03 * np.abs(part).max(0) + noise)
    assert list(distances(along, case.design.hidden)) == list(case.design.labels)


@pytest.mark.parametrize(
    "effect", [pytest.param(gear, marks=pytest.mark.proof if gear != "backlash" else ()) for gear in GEARS]
)
def test_gear_effects_appear_between_the_encoders(effect: str) -> None:
    scale = Scale(1.5, 1.0, -0.5, 0.5, 40.0, 0.0, 0.0, 1.0)
    use = GEARS[effect](Draw(np.random.default_rng(5)), "joint1", scale)

    def weightless(use: EffectUse | None) -> Concealed:  # where gravity does not hold the flanks together
        design = hidden_in(GEARED, use, seconds=2.0)
        nominal = design.nominal.model_copy(update={"gravity": (0.0, 0.0, 0.0)})
        return Concealed(design.model_copy(update={"nominal": nominal}))

    case, rigid = weightless(use), weightless(None)
    label = case.design.labels[0]
    assert distances(ArmAlong(case.sensed_by, case.exact[0]), case.design.hidden)[label] > IDENTIFIABLE
    none = ArmAlong(case.sensed_by, with_torque(rigid.exact[0]))
    assert distances(none, case.design.hidden)[label] < IDENTIFIABLE


def with_torque(recording: object) -> object:
    channels = {**recording.channels, "joint1.gear_torque": recording["joint1.torque"]}  # type: ignore[attr-defined]
    return dataclasses.replace(recording, channels=channels)  # type: ignore[type-var]


def test_a_joint_that_warms_loses_friction() -> None:
    use = EffectUse.model_validate({"effect": warming.EFFECT, "at": "joint1", "rate": 0.05})
    heat = Warming(joint="joint1", start=10.0, rise=10.0, time=1.0, noise=0.05, resolution=0.1)
    friction = EffectUse.model_validate({"effect": "coulomb_friction", "at": "joint1", "torque": 10.0})
    plain = hidden_in(ARM, use, warming=heat)
    design = plain.model_copy(update={"nominal": plain.nominal.with_effects(friction)})
    case = Concealed(design)
    along = ArmAlong(case.sensed_by, case.exact[0])
    part = along.part(use)
    missing = along.torque - along.nominal()
    assert np.abs(part[:, 0]).max() > 3.0
    # The engines' friction passes through zero over the same 1e-4 rad/s, in other steps.
    assert np.sqrt(np.mean((missing - part) ** 2)) < 0.03 * np.sqrt(np.mean(part**2))
    message = case.recordings[0]["joint1.temperature"]
    assert np.abs(message - case.exact[0]["joint1.temperature"]).max() < 0.4
    assert distances(along, design.hidden)[f"{warming.EFFECT}@joint1"] > 0


def test_effect_torques_of_a_flexible_robot_equal_exudyn() -> None:
    """A load of a rigid link moves base and modes too, which the regressors' reduction has to know."""
    values = {"mass": 2.0, "x": 3.0, "y": 0.2, "z": 0.0}
    use = EffectUse.model_validate({"effect": "payload", "at": "link1", **values})
    case = Concealed(hidden_in(BENT, use))
    along = ArmAlong(case.sensed_by, case.exact[0])
    missing, part = along.torque - along.nominal(), along.part(use)
    assert np.abs(part).max() > 0.1
    # Linear in the load, whose change of the modes' phases is left out: 5 % in all. The trapezoidal rule at
    # the samples' rate, which shifts the upper modes, is off by 16 %.
    assert np.sqrt(np.mean((missing - part) ** 2)) < 0.08 * np.sqrt(np.mean(part**2))


@pytest.mark.proof
def test_exact_beams_differ_from_the_modal_links_of_the_file() -> None:
    one, other = (Concealed(hidden_in(BEAMS, None, beams=beams)) for beams in (False, True))
    modes, beams = one._run(one.design.real), other._run(other.design.real)
    assert np.abs(modes["joint1.torque"] - beams["joint1.torque"]).max() > 1e-5
    assert one.files()["robot.toml"] == other.files()["robot.toml"]


@pytest.mark.proof
def test_a_bending_case_is_scored() -> None:
    use = EffectUse.model_validate({"effect": "coulomb_friction", "at": "joint1", "torque": 8.0})
    design = hidden_in(BENT, use)
    files = dict(concealed(design))
    facts = {"status": "done", "message": "", "attempts": 1, "seconds": 1.0}
    files |= {"diagnosis.json": json.dumps(answer()).encode(), "answer.json": json.dumps(facts).encode()}
    score = json.loads(scored(design, files)["score.json"])
    assert EXACT in files
    assert score["errors"]["truth"] < score["errors"]["nominal"]
    assert score["distance"]["coulomb_friction@joint1"] > IDENTIFIABLE

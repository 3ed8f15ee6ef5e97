"""Answers with open questions, and recordings without missing physics or without sufficient information."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest
from documented_keys import SHAPE, check
from end_to_end_cases import ARM, AXIS, QUICK

from missing_physics.diagnosis import diagnose
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Recording, Robot


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.proof) for k in range(1, 6))])
@pytest.mark.parametrize("robot", [ARM, AXIS], ids=["arm", "axis"])
def test_no_effect_is_named_for_a_correct_robot_file(robot: Robot, seed: int) -> None:
    found = diagnose(robot, [simulate(robot, seed=seed)]).diagnosis
    assert found.findings == ()
    assert found.verdict == "consistent"
    assert found.experiments == ()
    assert "agrees with" in found.summary


@pytest.mark.proof
def test_equivalent_explanations_are_reported_as_ambiguous() -> None:
    """Gravity tilted in the plane of the arm turns everything as an offset of the first sensor does."""
    tilt = EffectUse(effect="gravity", at="base", x=0.3, y=0.0, z=0.0)
    found = diagnose(ARM, [simulate(ARM.with_effects(tilt), seed=1)], options=QUICK).diagnosis
    assert found.verdict == "ambiguous"
    [finding] = found.findings
    both = {f"{finding.effect}@{finding.location}", *finding.ambiguous_with}
    assert both == {"gravity@base", "sensor_offset@joint1.position"}
    assert "cannot be told apart" in found.summary


def chirp(time: np.ndarray, seed: int) -> np.ndarray:
    return np.sin(2 * np.pi * (0.3 * time + 0.08 * time**2) + seed)


def telegraph(time: np.ndarray, seed: int) -> np.ndarray:
    flips = np.sort(np.random.default_rng(seed).uniform(0, time[-1], 22))
    return (-1.0) ** np.searchsorted(flips, time)


@pytest.mark.proof
@pytest.mark.parametrize("foreign", [chirp, telegraph])
@pytest.mark.parametrize("seed", [1, 2])
def test_physics_outside_the_catalogue_is_located_without_a_name(foreign: Any, seed: int) -> None:
    made = simulate(ARM, seed=seed)
    channel = "joint2.torque"
    disturbed = made.with_channels({channel: made[channel] + foreign(made.time, seed)})
    found = diagnose(ARM, [disturbed], options=QUICK).diagnosis
    assert found.verdict == "unexplained"
    assert found.findings == ()
    assert found.mismatch[0].location == "joint2"
    assert found.mismatch[0].share > 0.9
    assert found.mismatch[0].p_value < 1e-6
    assert "no effect of the catalogue explains it" in found.summary


def only(made: Recording, *quantities: str) -> Recording:
    kept = {k: v for k, v in made.channels.items() if k.split(".")[1] in quantities}
    return Recording(made.time, kept, made.source)


def held(made: Recording) -> Recording:
    """Joints that stand still, but for the sensors' noise."""
    return made.with_channels(
        {k: 5e-6 * np.random.default_rng(0).standard_normal(len(made)) for k in made if "position" in k}
    )


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda made: only(made, "position"), "joint1 and joint2: no torque, current or voltage is recorded"),
        (held, "joint1 and joint2: no motion beyond the noise"),
        (lambda made: made.window(0.0, 0.6), "only .* independent samples are left"),
    ],
    ids=["no torque", "no motion", "too short"],
)
def test_uninformative_recording_is_reported_as_such(spoil: Any, sentence: str) -> None:
    result = diagnose(ARM, [spoil(simulate(ARM, seed=1))])
    found = result.diagnosis
    assert found.verdict == "not_enough_data"
    assert found.findings == ()
    assert any(re.match(sentence, message) for message in found.could_not_tell)
    assert found.summary.startswith("The recording cannot support any statement")
    check(json.loads(found.to_json()), SHAPE)


def test_recording_of_another_robot_is_rejected() -> None:
    with pytest.raises(InputError, match=r"neither joint1.position nor a channel that determines it"):
        diagnose(ARM, [only(simulate(ARM, seed=1), "torque")])

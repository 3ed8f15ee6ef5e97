"""Motions that distinguish explanations which a recording cannot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from missing_physics.diagnosis import Options, Result, diagnose
from missing_physics.recordings import load_recording
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot


def diagnosed(arm: Robot, *, experiments: bool = True, **use: object) -> Result:
    made = simulate(arm.with_effects(EffectUse.model_validate(use)), seed=1)
    return diagnose(arm, [made], options=Options(experiments=experiments))


def test_separating_motion_is_designed_within_the_limits(arm: Robot, tmp_path: Path) -> None:
    """One joint's torque is late, or the drive of the other lags, as fast motions show."""
    result = diagnosed(arm, effect="sensor_delay", at="joint1.torque", delay=0.012)
    [experiment] = result.diagnosis.experiments
    assert set(experiment.separates) == {"sensor_delay", "actuator_lag"}
    assert experiment.motion is not None
    path = tmp_path / experiment.motion
    path.write_text(result.experiment_motions[experiment.motion])
    motion = load_recording(path)
    assert set(motion) == {"joint1.reference_position", "joint2.reference_position"}
    for joint in arm.joints:
        position = motion[f"{joint.name}.reference_position"]
        assert joint.velocity_limit is not None
        assert np.abs(np.gradient(position, motion.time)).max() <= joint.velocity_limit
        assert position[0] == pytest.approx(joint.initial_position, abs=1e-9)


def test_no_motion_is_proposed_if_none_separates(arm: Robot) -> None:
    """Gravity tilted in the plane of the arm acts as an offset of the first encoder does."""
    result = diagnosed(arm, effect="gravity", at="base", x=0.3, y=0.0, z=0.0)
    [experiment] = result.diagnosis.experiments
    assert set(experiment.separates) == {"gravity", "sensor_offset"}
    assert experiment.motion is None
    assert result.experiment_motions == {}
    assert "No motion within the limits was found" in experiment.do


def test_experiments_are_designed_only_on_request(arm: Robot) -> None:
    result = diagnosed(arm, experiments=False, effect="sensor_delay", at="joint1.torque", delay=0.005)
    assert result.diagnosis.verdict == "ambiguous"
    assert result.diagnosis.experiments == ()

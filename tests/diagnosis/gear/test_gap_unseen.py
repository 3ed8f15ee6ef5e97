"""Scored recordings with a motion that the fitted ones lack: names that they contradict are taken back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from test_gap_play import Leaning, with_play
from test_transmission import ROBOT, Gap, Motion, elasticity, recording
from two_encoders import along_each

from missing_physics.diagnosis.gear.causes import Cause, causes_of
from missing_physics.diagnosis.gear.fit import GapData, GapFit, fit_gap
from missing_physics.diagnosis.gear.gap import gaps_of, with_net_torque
from missing_physics.diagnosis.gear.transmission import diagnose_transmission
from missing_physics.diagnosis.gear.unseen import contradicted, of_all_recordings

Array = NDArray[np.float64]
#: The first recording leans on one flank; the second swings about hanging down.
MOTIONS = Leaning(0, turns=0.05), Motion(1, turns=0.05)


def test_play_that_only_the_scored_recording_crosses_is_reported_beside_the_spring() -> None:
    runs = [recording(m, with_play(m), k) for k, m in enumerate(MOTIONS)]
    result = diagnose_transmission(ROBOT, runs[:1], runs[1:], along=along_each(ROBOT, runs))
    assert result is not None
    [finding] = result.findings
    assert finding.effect == "joint_elasticity"
    # Not friction inside the gear, which the scored recording excludes although the fitted one does not.
    assert finding.ambiguous_with == ("backlash@joint1",)
    assert finding.probability == pytest.approx(0.5, abs=0.01)
    chances = {a.effect: a.probability for a in finding.alternatives}
    assert chances.get("gear_hysteresis", 0.0) < 1e-6
    assert any("fit them too" in words for words in result.could_not_tell)


def _fitted(gap: Gap, *effects: str) -> tuple[GapData, GapFit, tuple[Cause, ...]]:
    runs = [recording(m, gap(m), k) for k, m in enumerate(MOTIONS)]
    gaps = with_net_torque(gaps_of(along_each(ROBOT, runs), runs)["joint1"], 1)
    data, causes = GapData(gaps, 1), causes_of(gaps, prismatic=False)
    own = [next(c for c in causes if c.effect == effect and c.torque == "link") for effect in effects]
    return data, fit_gap(data, own), causes


def with_wide_play(motion: Motion) -> Array:
    """Play that says far more than the spring beside it."""
    return elasticity(motion) + 20 * (with_play(motion) - elasticity(motion))


@pytest.mark.parametrize("gap", [with_play, with_wide_play])
def test_friction_that_play_replaces_is_taken_back_and_the_spring_stays(gap: Gap) -> None:
    data, fit, causes = _fitted(gap, "joint_elasticity", "gear_hysteresis")
    whole = of_all_recordings(data, fit)
    assert whole is not None
    kept, dropped = contradicted(data, whole, fit, causes)
    assert [cause.effect for cause in kept.causes] == ["joint_elasticity"]
    [(cause, why)] = dropped
    assert cause.effect == "gear_hysteresis"
    assert "backlash at joint1 explains more" in why


def test_a_fit_that_holds_on_the_scored_recording_is_not_questioned() -> None:
    data, fit, _ = _fitted(elasticity, "joint_elasticity")
    assert of_all_recordings(data, fit) is None

"""Backlash with elasticity: named if it is crossed, and reported as possible otherwise."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from test_transmission import ROBOT, STIFFNESS, Motion, elasticity, recording
from two_encoders import along_each

from missing_physics.diagnosis.gear.transmission import TransmissionResult, diagnose_transmission

Array = NDArray[np.float64]


class Leaning(Motion):
    """About 50 degrees from hanging down, where gravity presses on one flank all the time."""

    def at(self, time: Array) -> Array:
        """Position at any time."""
        return super().at(time) + 0.9


def diagnose(kinds: Sequence[Callable[..., Motion]], gap: Callable[[Motion], Array]) -> TransmissionResult:
    """Fit the first motion, predict the second."""
    motions = [motion(k, turns=0.05) for k, motion in enumerate(kinds)]
    runs = [recording(m, gap(m), k) for k, m in enumerate(motions)]
    result = diagnose_transmission(ROBOT, runs[:1], runs[1:], along=along_each(ROBOT, runs))
    assert result is not None
    return result


def with_play(motion: Motion) -> Array:
    """2e-4 rad either way beside the spring, crossed with the sign of the torque."""
    return -motion.link_torque / STIFFNESS - 2e-4 * np.sign(motion.link_torque)


@pytest.mark.parametrize("gap", [elasticity, with_play])
def test_backlash_closed_by_gravity_is_reported_as_possible_only(
    gap: Callable[[Motion], Array],
) -> None:
    assert np.abs(np.sign(Leaning(0, turns=0.05).link_torque).sum()) == Leaning(0).time.size
    result = diagnose([Leaning, Leaning], gap)
    assert {finding.effect for finding in result.findings} == {"joint_elasticity"}
    assert any("play between its flanks would not show" in words for words in result.could_not_tell)


def test_backlash_is_excluded_if_the_load_changes_sign() -> None:
    result = diagnose([Motion, Motion], elasticity)
    [finding] = result.findings
    assert finding.effect == "joint_elasticity"
    assert finding.ambiguous_with == ()
    assert not any("play between its flanks" in words for words in result.could_not_tell)


def test_backlash_with_elasticity_is_found_if_it_is_crossed() -> None:
    found = {finding.effect: finding for finding in diagnose([Motion, Motion], with_play).findings}
    assert set(found) == {"joint_elasticity", "backlash"}
    low, high = found["backlash"].parameters["half_width"].ci95
    assert low <= 2e-4 <= high


def test_residual_in_the_held_out_recording_only_is_reported() -> None:
    """The fitted recording leans on one flank; the other one swings about hanging down."""
    result = diagnose([Leaning, Motion], with_play)
    assert "gear_hysteresis" not in {finding.effect for finding in result.findings}
    assert any("remain on held-out data" in words for words in result.could_not_tell)

"""A spring's kin: play that is never crossed, told beside it, and play that would have shown, not."""

from __future__ import annotations

from collections.abc import Callable

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


def diagnose(motion: Callable[..., Motion], gap: Callable[[Motion], Array]) -> TransmissionResult:
    motions = [motion(k, turns=0.05) for k in range(2)]
    runs = [recording(m, gap(m), k) for k, m in enumerate(motions)]
    result = diagnose_transmission(ROBOT, runs[:1], runs[1:], along=along_each(ROBOT, runs))
    assert result is not None
    return result


def with_play(motion: Motion) -> Array:
    """2e-4 rad either way beside the spring, crossed with the sign of the torque."""
    return -motion.link_torque / STIFFNESS - 2e-4 * np.sign(motion.link_torque)


@pytest.mark.parametrize("gap", [elasticity, with_play])
def test_play_that_gravity_keeps_closed_is_as_probable_as_none(gap: Callable[[Motion], Array]) -> None:
    assert np.abs(np.sign(Leaning(0, turns=0.05).link_torque).sum()) == Leaning(0).time.size
    [finding] = diagnose(Leaning, gap).findings
    assert finding.effect == "joint_elasticity"
    assert "backlash@joint1" in finding.ambiguous_with
    chances = {a.effect: a.probability for a in finding.alternatives}
    assert chances["backlash"] == pytest.approx(finding.probability)


def test_play_that_would_have_been_crossed_is_excluded() -> None:
    [finding] = diagnose(Motion, elasticity).findings
    assert finding.effect == "joint_elasticity"
    assert finding.ambiguous_with == ()
    chances = {a.effect: a.probability for a in finding.alternatives}
    assert 0.0 < chances["backlash"] < 0.02

"""Mean errors due to encoder resolution are not named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from test_transmission import ROBOT, Motion, recording
from two_encoders import along_each

from missing_physics.diagnosis.gear.transmission import diagnose_transmission


def test_effects_below_the_encoder_resolution_are_not_named() -> None:
    """Play that clearly shows, were encoders not rounded so coarsely."""
    motions = Motion(0), Motion(1)
    runs = [recording(m, -4e-6 * np.sign(m.link_torque), k) for k, m in enumerate(motions)]
    fine = diagnose_transmission(ROBOT, runs[:1], runs[1:], along=along_each(ROBOT, runs))
    assert fine is not None
    assert {finding.effect for finding in fine.findings} == {"backlash"}
    steps = dict.fromkeys(("joint1.position", "joint1.motor_position"), 2e-5)
    quiet = dict.fromkeys(steps, 0.0)
    runs = [replace(run, resolution=steps, noise={**run.noise, **quiet}) for run in runs]
    coarse = diagnose_transmission(ROBOT, runs[:1], runs[1:], along=along_each(ROBOT, runs))
    assert coarse is not None
    assert coarse.findings == ()

"""What encoders' steps leave in their mean, and that it is named nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from test_transmission import ROBOT, Motion, recording
from two_encoders import along_each

from missing_physics.diagnosis.gear.causes import causes_of
from missing_physics.diagnosis.gear.fit import GapData, fit_gap
from missing_physics.diagnosis.gear.gap import gaps_of
from missing_physics.diagnosis.gear.search import search_gap


def test_what_is_no_larger_than_the_steps_make_is_not_named() -> None:
    """Friction in a gear that clearly shows, were encoders not rounded so coarsely."""
    runs = [recording(m, 4e-6 * np.sign(m.velocity) * -1.0, k) for k, m in enumerate((Motion(0), Motion(1)))]
    gaps = gaps_of(along_each(ROBOT, runs), runs)["joint1"]
    causes = causes_of(gaps, prismatic=False)
    fine = search_gap(GapData(gaps, 1), causes)
    assert fine.best.causes
    size = fit_gap(fine.best.data, fine.best.causes).size_of(fine.best.causes[0])
    coarse = search_gap(GapData([replace(gap, steps=size) for gap in gaps], 1), causes)
    assert not coarse.best.causes
    assert any("no larger than what the steps" in why for *_, why in coarse.steps)

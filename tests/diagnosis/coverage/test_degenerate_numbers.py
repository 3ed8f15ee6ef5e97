"""Degenerate numbers in divisions: zero, almost zero, and extremely large."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, recorded

from missing_physics.coverage.needs import Needs
from missing_physics.motion.recorded import make_dynamics
from missing_physics.recordings.inspection.units import position_per_velocity

ROBOT = bare("two_link_arm", noise=True)


@pytest.fixture(autouse=True)
def warnings_are_errors() -> Iterator[None]:
    """Those that NumPy attributes to its own modules as well."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def test_constant_torque_leaves_no_residual() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    flat = made.with_channels({"joint1.torque": np.full(len(made), 3.7)})
    needs = Needs.of(make_dynamics(ROBOT, [flat])[0])
    assert needs.left(0, (0.1, 10.0)) == 0.0
    assert needs.left(1, (0.1, 10.0)) < 0.1


@pytest.mark.parametrize("size", [1e-100, 1.0, 1e100])
def test_ratios_of_extreme_numbers_are_finite(size: float) -> None:
    time = np.arange(2000) / 100.0
    ratio, alike = position_per_velocity(time, size * np.sin(time), size * np.cos(time))
    assert ratio == pytest.approx(1.0, rel=1e-3)
    assert alike == pytest.approx(1.0, rel=1e-3)

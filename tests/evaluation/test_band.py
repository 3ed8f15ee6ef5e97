"""The band-limiting filter."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from missing_physics.evaluation.band import low_passed


@pytest.mark.parametrize("shape", [(400,), (400, 3), (400, 2, 2), (12, 1), (1, 1)])
@pytest.mark.parametrize("cutoff", [5.0, 30.0])
def test_band_filter_equals_a_forward_backward_butterworth_filter(
    shape: tuple[int, ...], cutoff: float
) -> None:
    values = np.random.default_rng(5).normal(size=shape).cumsum(axis=0)
    settled = min(len(values) - 1, int(6.0 * 200.0 / cutoff) + 10)
    sections = signal.butter(4, cutoff, fs=200.0, output="sos")
    expected = signal.sosfiltfilt(sections, values, axis=0, padlen=settled)
    assert np.array_equal(low_passed(values, rate=200.0, cutoff=cutoff), expected)

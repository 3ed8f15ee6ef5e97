"""The kept part of a filtered recording equals the output of the filter."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missing_physics.motion.low_pass import LowPass

#: Where a recording has only few periods of the cut-off, its ends reach further than the filter forgets.
ACCURACY, ACCURACY_OF_FEW, FEW_PERIODS = 1e-8, 1e-5, 8.0


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    rate=st.floats(50.0, 2000.0),
    share=st.floats(0.002, 0.1),
    periods=st.floats(2.5, 60.0),
    shape=st.sampled_from([(), (1,), (3,), (2, 2)]),
)
def test_kept_samples_equal_the_filter_output(
    seed: int, rate: float, share: float, periods: float, shape: tuple[int, ...]
) -> None:
    low_pass = LowPass(rate, share * rate)
    chance = np.random.default_rng(seed)
    steps = chance.standard_normal((int(periods / share), *shape))
    values = np.cumsum(steps, axis=0) + 30.0 * chance.standard_normal(shape)
    whole, kept = low_pass.smooth(values), low_pass.kept(len(values))
    accuracy = ACCURACY if periods > FEW_PERIODS else ACCURACY_OF_FEW
    error = np.abs(low_pass.reduce(values) - whole[kept])
    assert error.shape == whole[kept].shape
    assert np.all(error <= accuracy * np.abs(values).max())


@pytest.mark.parametrize("samples", [1, 2, 50, 399])
def test_recording_shorter_than_the_filter_transients_keeps_no_samples(samples: int) -> None:
    low_pass = LowPass(100.0, 1.0)
    assert low_pass.edge == 200
    assert len(low_pass.reduce(np.ones((samples, 2)))) == 0


def test_missing_value_stays_missing_after_filtering() -> None:
    values = np.ones(2000)
    values[1000] = np.nan
    assert np.isnan(LowPass(200.0, 5.0).reduce(values)).any()

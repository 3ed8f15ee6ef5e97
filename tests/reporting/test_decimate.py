"""Thinning keeps spikes, ends and order; intervals cover exactly what is flagged."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from missing_physics.reporting.elements.decimate import envelope_indices, intervals

VALUES = arrays(
    np.float64,
    st.integers(1, 400),
    elements=st.one_of(st.floats(-1e6, 1e6, allow_nan=False), st.just(float("nan"))),
)


@given(values=VALUES, limit=st.integers(4, 120))
def test_extremes_and_ends_survive(values: np.ndarray, limit: int) -> None:
    keep = envelope_indices(values, limit)
    assert keep.size <= max(limit, values.size if values.size <= limit else 0)
    assert np.all(np.diff(keep) > 0)
    assert keep[0] == 0
    assert keep[-1] == values.size - 1
    if np.isfinite(values).any():
        assert np.nanmax(values[keep]) == np.nanmax(values)
        assert np.nanmin(values[keep]) == np.nanmin(values)


def test_one_spike_in_a_million_survives() -> None:
    values = np.zeros(1_000_000)
    values[654_321] = 1.0
    keep = envelope_indices(values, 1000)
    assert 654_321 in keep
    assert keep.size <= 1000


@given(flag=arrays(np.bool_, st.integers(1, 200)))
def test_intervals_give_back_the_flags(flag: np.ndarray) -> None:
    time = np.arange(flag.size) * 0.1
    covered = np.zeros(flag.size, dtype=bool)
    for start, stop in intervals(time, flag):
        covered |= (time >= start) & (time <= stop)
    assert np.array_equal(covered, flag)


@given(flag=arrays(np.bool_, st.integers(1, 200)), limit=st.integers(1, 5))
def test_limited_intervals_still_cover_every_flag(flag: np.ndarray, limit: int) -> None:
    time = np.arange(flag.size) * 0.1
    found = intervals(time, flag, limit)
    assert len(found) <= limit
    for instant in time[flag]:
        assert any(start <= instant <= stop for start, stop in found)

"""Tables of recorded references: every sample again, of few instants."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

from missing_physics.diagnosis.asked_tables import REPRODUCED, table_of
from robot_model import Table

TIME = np.arange(4000) / 500.0


def again(table: Table) -> np.ndarray:
    return make_interp_spline(np.array(table.times), np.array(table.positions), k=table.degree)(TIME)


@pytest.mark.parametrize(
    "values",
    [
        np.sin(2 * np.pi * 0.7 * TIME),
        np.abs(np.sin(2 * np.pi * 0.7 * TIME)),  # corners
        np.zeros_like(TIME) + (TIME > 4),
        np.random.default_rng(1).normal(size=TIME.size),
    ],
    ids=["smooth", "corners", "step", "noise"],
)
def test_every_sample_is_given(values: np.ndarray) -> None:
    found = again(table_of("joint1", TIME, values))
    assert np.abs(found - values).max() <= REPRODUCED * np.ptp(values)


def test_smooth_motions_take_few_instants() -> None:
    """Each knot of a cubic spline costs a multistep method several steps."""
    table = table_of("joint1", TIME, np.sin(2 * np.pi * 0.7 * TIME))
    assert table.degree == 5
    # A quintic spline of spacing h is off by (2 pi f h)^6 / 30240: 4e-12 at every eighth sample, 3e-10 at
    # every sixteenth. There are some more near the ends.
    assert len(table.times) < TIME.size / 8 + 20


def test_instants_are_close_together_only_where_that_is_needed() -> None:
    """A motion with one kink in its acceleration."""
    values = np.where(TIME > 4.0, (TIME - 4.0) ** 3, 0.0) + np.sin(2 * np.pi * 0.7 * TIME)
    table = table_of("joint1", TIME, values)
    near = np.abs(np.array(table.times) - 4.0) < 0.5
    elsewhere = np.abs(np.array(table.times) - 2.5) < 0.5
    assert near.sum() > 1.5 * elsewhere.sum()
    assert near.size < TIME.size / 10


def test_accelerations_of_a_slew_do_not_ring_where_they_have_kinks() -> None:
    """Controllers of computed torque ask for these: a cubic spline is off by 4e-5, a quintic one by 8e-4."""
    instants = np.linspace(0.0, 4.0, 801)
    begun = np.clip((instants - 0.3) / 3.0, 0.0, 1.0)
    table = table_of("joint1", instants, begun - np.sin(2 * np.pi * begun) / (2 * np.pi))
    spline = make_interp_spline(np.array(table.times), np.array(table.positions), k=table.degree)
    between = np.linspace(0.0, 4.0, 20001)
    right = 2 * np.pi * np.sin(2 * np.pi * np.clip((between - 0.3) / 3.0, 0.0, 1.0)) / 9.0
    assert np.abs(spline.derivative(2)(between) - right).max() < 1e-4 * right.max()


def test_a_cubic_spline_stays_one() -> None:
    """Of instants that the search comes upon: then it is found as it is."""
    knots = np.arange(0, 4000, 31)
    knots[-1] = 3999
    values = CubicSpline(TIME[knots], np.random.default_rng(2).normal(size=knots.size))(TIME)
    assert table_of("joint1", TIME, values).degree == 3


@pytest.mark.parametrize("size", [4, 5, 6, 7, 30])
def test_short_recordings(size: int) -> None:
    values = np.random.default_rng(size).normal(size=size)
    table = table_of("joint1", TIME[:size], values)
    found = make_interp_spline(np.array(table.times), np.array(table.positions), k=table.degree)(TIME[:size])
    assert np.abs(found - values).max() <= REPRODUCED * np.ptp(values)

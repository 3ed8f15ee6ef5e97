"""Tables of recorded references: every sample again, of few instants."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

from missing_physics.diagnosis.replay.references import REPRODUCED, table_of
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


def slew(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and acceleration of a cycloid."""
    begun = np.clip((time - 0.3) / 3.0, 0.0, 1.0)
    return begun - np.sin(2 * np.pi * begun) / (2 * np.pi), 2 * np.pi * np.sin(2 * np.pi * begun) / 9.0


def faded_in(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Those of a sine that is faded in over two seconds."""
    s, w = np.clip(time / 2.0, 0.0, 1.0), 2 * np.pi * 0.3
    shares = [10 * s**3 - 15 * s**4 + 6 * s**5, 15 * s**2 * (1 - s) ** 2, 15 * s * (1 - s) * (1 - 2 * s)]
    sine = [np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time)]
    return shares[0] * sine[0], shares[2] * sine[0] + 2 * shares[1] * sine[1] + shares[0] * sine[2]


@pytest.mark.parametrize(("motion", "degree"), [(slew, 3), (faded_in, 5)])
def test_accelerations_do_not_ring_at_kinks(motion: Callable[..., Any], degree: int) -> None:
    """Controllers of computed torque ask for these. Quintic splines through samples are off by 3e-4 there."""
    instants = np.linspace(0.0, 8.0, 1601)
    table = table_of("joint1", instants, motion(instants)[0])
    assert table.degree == degree
    spline = make_interp_spline(np.array(table.times), np.array(table.positions), k=table.degree)
    inner = np.linspace(0.02, 7.98, 20001)  # what comes before and after nothing tells
    right = motion(inner)[1]
    assert np.abs(spline.derivative(2)(inner) - right).max() < 1e-4 * np.ptp(right)


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

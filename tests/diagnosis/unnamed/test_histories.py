"""Coordinates with a memory: what a joint has done, where no curve over an instant foretells the force."""

from __future__ import annotations

import numpy as np
import pytest
from extra_torque import diagnosed
from numpy.typing import NDArray

from missing_physics.diagnosis.unnamed.histories import plays, time_of_last_way

Array = NDArray[np.float64]


def wandering(samples: int) -> Array:
    """A position that turns often, at every scale, and rests for a while, shape (samples,)."""
    rng = np.random.default_rng(10690)
    position = np.convolve(np.cumsum(rng.standard_normal(samples)), np.ones(15) / 15, mode="same") * 0.02
    position[samples // 4 : samples // 3] = position[samples // 4]
    return np.asarray(position)


def play(position: Array, width: float) -> Array:
    """One play operator, sample by sample."""
    made, now = np.empty(position.size), position[0]
    for k, here in enumerate(position):
        made[k] = now = min(max(now, here - width), here + width)
    return made


def test_play_operators_go_with_the_side_of_their_gap() -> None:
    position = wandering(3000)
    widths = np.ptp(position) / 2 * np.geomspace(0.01, 1.0, 7)
    expected = np.column_stack([play(position, width) for width in widths])
    assert np.array_equal(plays(position, widths), expected)
    assert np.array_equal(plays(-position, widths), -expected)


@pytest.mark.parametrize("position", [np.zeros(5), np.array([1.0]), np.arange(4.0), -np.arange(4.0)])
def test_play_operators_of_motions_that_never_turn(position: Array) -> None:
    assert np.array_equal(plays(position, np.array([0.5]))[:, 0], play(position, 0.5))


def test_time_of_the_last_way_is_way_over_speed_and_holds_rests() -> None:
    time = np.arange(0.0, 10.0, 0.01)
    moved = 0.2 * np.minimum(time, 4.0) + 0.2 * np.maximum(time - 7.0, 0.0)  # three seconds of rest
    took = time_of_last_way(time, moved, 0.1)
    assert took[200] == pytest.approx(0.5, abs=0.011)
    assert took[690] == pytest.approx(0.5 + 2.9, abs=0.011)
    assert took[725] == pytest.approx(0.5 + 3.0, abs=0.011)
    assert took[770] == pytest.approx(0.5, abs=0.011)
    assert took[10] == pytest.approx(time[10])


def swinging(time: Array, acceleration: Array, *, frequency: float, damping: float) -> Array:
    """The way of a mass on a spring that hangs on the joint, semi-implicit Euler, shape (N,)."""
    w, h = 2 * np.pi * frequency, float(time[1] - time[0])
    way, x, xd = np.empty(time.size), 0.0, 0.0
    for k, driving in enumerate(acceleration):
        xd += h * (-driving - w * w * x - 2 * damping * w * xd)
        x += h * xd
        way[k] = x
    return way


@pytest.mark.proof
def test_play_operators_are_not_called_a_spring() -> None:
    def hysteresis(t: Array, q: Array, v: Array) -> Array:
        half = float(np.ptp(q)) / 2
        return 60.0 / half * sum(plays(q, half * np.array([0.15, 0.4, 0.8])).T)

    found = diagnosed(hysteresis)
    assert found.findings == ()
    [more] = found.unnamed
    assert more.depends_on == ("joint1.turns",)
    assert more.share > 0.9
    assert more.curves == ()


@pytest.mark.proof
def test_an_absorber_is_not_called_inertia() -> None:
    def absorber(t: Array, q: Array, v: Array) -> Array:
        x = swinging(t, np.gradient(v, t), frequency=1.5, damping=0.03)
        return -200.0 * (2 * np.pi * 1.5) ** 2 * x

    found = diagnosed(absorber)
    assert found.findings == ()
    [more] = found.unnamed
    assert more.depends_on == ("joint1.past_acceleration",)

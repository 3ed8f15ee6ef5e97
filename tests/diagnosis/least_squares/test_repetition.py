"""Motions that come again, and such that do not."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import ARM, Sines, bare, problem_of, recorded

from missing_physics.diagnosis.least_squares.repetition import repeats

ROBOT = bare("two_link_arm", noise=True)
PERIODIC = (Sines((0.5, 0.2), (0.25, 0.75), (0.0, 0.9)), Sines((0.6, 0.3), (0.5, 0.25), (1.0, 0.2)))


@pytest.mark.parametrize("begin", [12.0, 13.7])
def test_a_periodic_motion_comes_again_whenever_it_begins(begin: float) -> None:
    whole = recorded(ROBOT, PERIODIC, duration=30.0, seed=1)
    fitted, held_out = (problem_of(ROBOT, whole.window(*span)) for span in ((0, 12), (begin, begin + 12)))
    assert repeats(fitted, held_out)
    assert repeats(fitted, fitted)  # one period after the other


def test_sines_without_a_common_period_do_not_come_again() -> None:
    one = problem_of(ROBOT, recorded(ROBOT, ARM, duration=16.0, seed=1))
    whole = recorded(ROBOT, ARM, duration=40.0, seed=2)
    other = problem_of(ROBOT, whole.window(20.0, 36.0))
    assert not repeats(one, other)
    assert not repeats(one, one)


def test_the_same_motion_recorded_twice_comes_again_and_a_shorter_piece_does_not_hide_it() -> None:
    one, other = (problem_of(ROBOT, recorded(ROBOT, ARM, duration=16.0, seed=seed)) for seed in (1, 2))
    assert repeats(one, other)
    # One joint that moves otherwise is another motion.
    apart = (ARM[0], Sines(ARM[1].amplitudes, ARM[1].frequencies, tuple(np.array(ARM[1].phases) + 0.5)))
    assert not repeats(one, problem_of(ROBOT, recorded(ROBOT, apart, duration=16.0, seed=3)))

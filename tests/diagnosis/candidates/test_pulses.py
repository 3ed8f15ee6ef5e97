"""When something acts for a time: what a constant between two instants would explain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, problem_of, recorded

from missing_physics.diagnosis.candidates.effects import candidates
from missing_physics.diagnosis.candidates.pulses import likeliest_pulses
from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.scanning import Scan

ROBOT = bare("two_link_arm", noise=True)
START, STOP = 7.48, 9.57


@pytest.fixture(scope="module")
def pushed() -> Explanation:
    """A long push on joint1 that the robot's own numbers have taken over a part of."""

    def push(time: np.ndarray, *_: object) -> np.ndarray:
        return -9.0 * ((time > START) & (time < STOP)) * np.array([1.0, 0.0])

    problem = problem_of(ROBOT, recorded(ROBOT, ARM, push, duration=16.0, seed=1))
    view = View(np.array([1.0, 0.2]), np.ones(problem.time.size, dtype=bool))
    return explain(problem, view, ())


def test_a_pulse_promises_what_least_squares_makes_of_it(pushed: Explanation) -> None:
    edges = np.array([2.0, 7.4, 9.6, 20.0])
    fall = Scan(pushed).pulses(0, edges)
    for first, last in ((0, 1), (1, 2), (0, 2), (2, 3)):
        torque = np.zeros((*pushed.residual.shape, 1))
        inside = (pushed.problem.time >= edges[first]) & (pushed.problem.time < edges[last])
        torque[inside, 0, 0] = 1.0
        columns = np.column_stack([pushed.columns, pushed.view.flatten(pushed.problem, torque)])
        left = pushed.errors[:, 0] - columns @ np.linalg.lstsq(columns, pushed.errors[:, 0])[0]
        by_hand = float(pushed.energies.sum() - left @ left)
        assert fall[first, last] == pytest.approx(by_hand, rel=1e-6, abs=1e-9 * pushed.energies.sum())
    assert not np.tril(fall).any()


def test_a_long_push_is_found_although_the_nominal_numbers_hide_a_part_of_it(pushed: Explanation) -> None:
    start, stop = likeliest_pulses(Scan(pushed), pushed.problem.time, 0)[0]
    # joint1 reverses as the push begins, where no row counts; it ends between two of them, 12 ms apart
    assert start == pytest.approx(START, abs=0.05)
    assert stop == pytest.approx(STOP, abs=0.02)
    options = [c.term for c in candidates(pushed.problem, pushed) if c.term.effect.id == "external_torque"]
    best = explain(pushed.problem, pushed.view, [next(t for t in options if t.at == "joint1")])
    found = best.terms[0].parameters
    # the instants to a sample of the compared torque; the torque to a few times its noise's mean over 2 s
    assert found["start"] == pytest.approx(START, abs=0.02)
    assert found["start"] + found["duration"] == pytest.approx(STOP, abs=0.02)
    assert found["torque"] == pytest.approx(9.0, rel=0.02)


def test_guesses_differ_and_where_nothing_is_left_there_are_none(pushed: Explanation) -> None:
    found = likeliest_pulses(Scan(pushed), pushed.problem.time, 0)
    assert 1 < len(found) <= 3
    for k, (start, stop) in enumerate(found):
        for a, b in found[:k]:
            assert min(stop, b) - max(start, a) < 0.6 * min(stop - start, b - a)  # a half on the grid
    silent = replace(pushed, residual=np.zeros_like(pushed.residual))
    assert likeliest_pulses(Scan(silent), pushed.problem.time, 0) == ()

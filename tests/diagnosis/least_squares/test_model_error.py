"""What is smaller than the error of a model of bending links is neither a mismatch nor an effect."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, plain_view, problem_of, recorded, term

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.model_error import MODEL_ERROR, accuracy, within_accuracy
from missing_physics.diagnosis.location.residual import locate
from missing_physics.diagnosis.preparation.proof import HeldOut, proven

ROBOT = bare("two_link_arm", noise=True)


def fitted(part: float, monkeypatch: pytest.MonkeyPatch, *, bends: bool) -> Explanation:
    """Coulomb friction at joint1 that is this part of its torque's rms, found; links are said to bend."""
    level = float(np.sqrt(np.mean(recorded(ROBOT, ARM)["joint1.torque"] ** 2)))

    def rub(time: np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        return part * level * np.sign(qd) * np.array([1.0, 0.0])

    quiet = tuple(s.model_copy(update={"noise": 0.01 * s.noise, "resolution": 0.0}) for s in ROBOT.sensors)
    problem = problem_of(ROBOT.model_copy(update={"sensors": quiet}), recorded(ROBOT, ARM, rub))
    links = ("link1",) if bends else ()
    robot = SimpleNamespace(flexible_links=links, effects=(), joint=ROBOT.joint)
    monkeypatch.setattr(problem, "robot", robot)
    view = plain_view(problem)
    return explain(problem, view, [term("coulomb_friction", "joint1", torque=0.0)], nuisance=False)


@pytest.mark.parametrize(
    ("part", "bends", "stays"), [(0.5, True, False), (2.0, True, True), (0.5, False, True)]
)
def test_an_effect_must_do_more(
    part: float, bends: bool, stays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = fitted(part * MODEL_ERROR, monkeypatch, bends=bends)
    problem = found.problem
    held_out = HeldOut(problem, np.ones(problem.time.size, dtype=bool), found.view.scale)
    left, _, dropped = proven(found, found.view, held_out, nuisance=False)
    assert bool(left.found) is stays
    assert len(dropped) == (0 if stays else 1)
    assert all("links that bend" in reason for _, reason in dropped)


def test_a_mismatch_must_be_more(monkeypatch: pytest.MonkeyPatch) -> None:
    for bends, part, seen in ((False, 0.7, True), (True, 0.7, False), (True, 3.0, True)):
        found = fitted(part * MODEL_ERROR, monkeypatch, bends=bends)
        without = explain(found.problem, found.view, (), nuisance=False)
        assert within_accuracy(found, without) is (bends and part < 1.0)
        item = next(m for m in locate(found.problem, ROBOT, without.residual) if m.location == "joint1")
        assert (item.p_value < 1e-3) is seen


def test_accuracy_is_a_part_of_what_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = fitted(0.0, monkeypatch, bends=True).problem
    level = np.sqrt(np.mean(problem.measured**2, axis=0))
    assert accuracy(problem) == pytest.approx(MODEL_ERROR * level)
    assert not accuracy(fitted(0.0, monkeypatch, bends=False).problem).any()

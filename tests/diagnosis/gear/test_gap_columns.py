"""Columns of each gear effect are derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_transmission import ROBOT, Motion, elasticity, recording
from two_encoders import along_each

from missing_physics.diagnosis.gear.columns import VELOCITY
from missing_physics.diagnosis.gear.data import GapData
from missing_physics.diagnosis.gear.laws import BACKLASH, BENDING, ELASTICITY, HYSTERESIS
from missing_physics.hypotheses import Hypothesis, Term
from missing_physics.inference import fitted
from missing_physics.inference.fit import residuals
from missing_physics.motion.gap import gaps_of
from reference_model.effects.catalogue import get_effect
from robot_model import Recording

SPRING = {"stiffness": 2e5, "damping": 300.0}
TERMS = [
    Term.of(ELASTICITY, "joint1", {**SPRING, "cubic_stiffness": 1e10}, along="motor"),
    Term.of(HYSTERESIS, "joint1", {"torque": 30.0, "travel": 3e-4, **SPRING}, along="link"),
    Term.of(BACKLASH, "joint1", {"half_width": 2e-4, "flight": 20.0}, along="net"),
    Term.of(BACKLASH, "joint1", {"half_width": 2e-4, "flight": 0.1}, along=VELOCITY),
    Term.of(BENDING, "arm", {"static_deflection": 1e-5}),
    Term.of(get_effect("sensor_gain"), "joint1.position", {"gain_error": 5e-5}),
    Term.of(get_effect("sensor_delay"), "joint1.motor_position", {"delay": 1e-3}),
    Term.of(get_effect("clock_drift"), "joint1.position", {"rate": 1e-4}),
    Term.of(
        get_effect("encoder_eccentricity"),
        "joint1.position",
        {"cosine": 1e-4, "sine": -2e-4, "order": 7.0},
    ),
]


@pytest.fixture(scope="module")
def runs() -> list[Recording]:
    return [recording(motion, elasticity(motion), k) for k, motion in enumerate((Motion(0), Motion(1)))]


def rows(runs: list[Recording]) -> GapData:
    return GapData.of(ROBOT, gaps_of(along_each(ROBOT, runs), runs, 1), 1)


@pytest.mark.parametrize("term", TERMS, ids=lambda term: f"{term.effect.id}-{term.along}")
@pytest.mark.parametrize("run", [0, 1])
def test_gap_columns_equal_finite_differences(runs: list[Recording], term: Term, run: int) -> None:
    """To a few percent where the law is to first order in the number."""
    data = rows(runs)
    columns = data.columns(term, run)[:, 0]
    for i, p in enumerate(term.free):
        step = 1e-3 * max(abs(term.parameters[p.name]), 1e-3 * p.typical)
        up, down = (
            data.columns(term.moved({p.name: term.parameters[p.name] + s}), run)[:, 0, 0]
            for s in (step, -step)
        )
        slope = (up - down) / (2.0 * step)
        assert np.linalg.norm(columns[:, 1 + i] - slope) < 0.05 * np.linalg.norm(slope), p.name


def test_encoder_zeros_of_a_held_out_recording_are_not_counted_as_errors(runs: list[Recording]) -> None:
    moved = replace(
        runs[1], channels={**runs[1].channels, "joint1.position": runs[1]["joint1.position"] + 0.01}
    )
    term = Term.of(ELASTICITY, "joint1", {"stiffness": 1e5}, along="link")
    left = []
    for second in (runs[1], moved):
        data = rows([runs[0], second])
        fit = fitted(data, Hypothesis(terms=(term,)))
        assert fit.hypothesis.terms[0].parameters["stiffness"] == pytest.approx(2e5, rel=0.01)
        left.append(residuals(data, fit, 1))
    assert np.abs(left[0] - left[1]).max() < 1e-12

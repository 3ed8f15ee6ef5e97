"""Numbers that make nothing of what is divided by them: zero, next to zero, and beyond all bounds."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, plain_view, problem_of, recorded, term

from missing_physics.diagnosis.candidates.mounts import LIMITS, mount_of
from missing_physics.diagnosis.coverage.needs import Needs
from missing_physics.diagnosis.experiments import design as experiments
from missing_physics.diagnosis.experiments.design import design_experiments
from missing_physics.diagnosis.least_squares.explanation import explain
from missing_physics.diagnosis.least_squares.scanning import Scan
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_dynamics, make_segments
from missing_physics.diagnosis.statistics.correlated_errors import BlockedRegression, effective_samples
from missing_physics.recordings.inspection.units import position_per_velocity
from robot_model import Recording

ROBOT = bare("two_link_arm", noise=True)


@pytest.fixture(autouse=True)
def warnings_are_errors() -> Iterator[None]:
    """Those that NumPy attributes to its own modules as well."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def undriven(made: Recording) -> Recording:
    return made.with_channels({name: np.zeros(len(made)) for name in made if "torque" in name})


def test_without_any_torque_inertia_is_judged_by_what_the_motion_needs() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    driven, free = (inertial_basis(ROBOT, make_segments(ROBOT, [r])) for r in (made, undriven(made)))
    np.testing.assert_allclose(free.directions, driven.directions, rtol=1e-6, atol=1e-9)
    still = undriven(made).with_channels({n: np.zeros(len(made)) for n in made if "position" in n})
    floating = ROBOT.model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    assert inertial_basis(floating, make_segments(floating, [still])).directions.shape[1] == 0


def test_columns_of_nothing_promise_nothing() -> None:
    problem = problem_of(ROBOT, recorded(ROBOT, ARM, seed=1))
    scan = Scan(explain(problem, plain_view(problem), [], nuisance=False))
    rows, joints = problem.residual.shape
    one, other = np.zeros((rows, joints, 3, 1)), np.zeros((rows, joints, 2, 1))
    one[:, :, 0, 0] = problem.velocity
    one[:, :, 1, 0] = 1e-200 * problem.velocity
    other[:, :, 0, 0] = problem.position
    fall, first, second = scan.pairs(one, other)
    assert np.isfinite(fall).all()
    assert (first[1:] == 0).all()
    assert (second[:, 1] == 0).all()
    assert fall[2, 1] == 0
    assert first[0, 0] != 0


@pytest.mark.parametrize("far", [-1e4, 1e4])
def test_a_step_to_a_mount_beyond_all_bounds_ends_at_them(far: float) -> None:
    for number in range(5):
        sizes = np.zeros(5)
        sizes[number] = far
        mount = mount_of(sizes, np.array([5.0, 0.5]))
        assert ((mount >= LIMITS[0]) & (mount <= LIMITS[1])).all()
        assert (mount == mount_of(np.sign(sizes) * 1e3, np.array([5.0, 0.5]))).all()


def test_the_memory_of_a_series_does_not_depend_on_its_size() -> None:
    series = np.convolve(np.random.default_rng(0).standard_normal(500), np.ones(9), mode="same")
    usual = effective_samples(series)
    for size in (1e-170, 1e-200, 1e150):
        assert effective_samples(size * series) == pytest.approx(usual)
    assert effective_samples(0.0 * series) == 500.0


def test_a_column_of_next_to_nothing_has_a_coefficient_with_a_deviation() -> None:
    chance = np.random.default_rng(1)
    columns = chance.standard_normal((400, 2)) * [1.0, 1e-156]
    blocks = np.arange(400) // 40
    regression = BlockedRegression.of(columns, columns[:, 0] + chance.standard_normal(400), blocks)
    for covariance in (regression.covariance(), regression.sandwich(), regression.inverse()):
        assert np.isfinite(covariance).all()


def test_an_exact_fit_leaves_nothing_and_rounding_does_not_make_it_less() -> None:
    blocks = np.arange(400) // 40
    left = []
    for seed in range(20):
        columns = np.random.default_rng(seed).standard_normal((400, 2))
        regression = BlockedRegression.of(columns, columns @ [3.0, -2.0], blocks)
        left.append(regression.held_out_energy().sum())
        assert 0.0 <= regression.held_out_rms(400) < 1e-6
    assert min(left) < 0.0  # or this shows nothing


def test_a_constant_torque_leaves_nothing_to_explain() -> None:
    made = recorded(ROBOT, ARM, seed=1)
    flat = made.with_channels({"joint1.torque": np.full(len(made), 3.7)})
    needs = Needs.of(make_dynamics(ROBOT, [flat])[0])
    assert needs.left(0, (0.1, 10.0)) == 0.0
    assert needs.left(1, (0.1, 10.0)) < 0.1


def test_a_joint_that_rests_does_not_keep_the_others_from_being_separated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    resting = replace(ARM[1], amplitudes=(0.0, 0.0, 0.0))
    problem = problem_of(ROBOT, recorded(ROBOT, (ARM[0], resting), seed=1))
    chosen, rival = (
        term("coulomb_friction", "joint1", torque=1.0),
        term("viscous_friction", "joint1", coefficient=1.0),
    )
    best = explain(problem, plain_view(problem), [chosen], nuisance=False)
    item: Any = SimpleNamespace(term=best.terms[0], alternatives=((rival, 0.5),))
    monkeypatch.setattr(experiments, "DRAWN", 4)
    monkeypatch.setattr(experiments, "SPREADS", ())
    [experiment], motions = design_experiments(ROBOT, problem, best, [item], seed=0)
    assert experiment.motion in motions


def test_no_row_between_the_edges_of_the_filter() -> None:
    short = recorded(ROBOT, ARM, seed=1, duration=0.4)
    [segment] = make_segments(ROBOT, [short], cutoff=3.0)
    assert segment.time.size == 0
    assert segment.measured.shape == (0, 2)


@pytest.mark.parametrize("size", [1e-100, 1.0, 1e100])
def test_ratios_of_small_and_large_numbers(size: float) -> None:
    time = np.arange(2000) / 100.0
    ratio, alike = position_per_velocity(time, size * np.sin(time), size * np.cos(time))
    assert ratio == pytest.approx(1.0, rel=1e-3)
    assert alike == pytest.approx(1.0, rel=1e-3)

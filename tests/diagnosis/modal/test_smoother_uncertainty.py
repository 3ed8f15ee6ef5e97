"""The smoother's covariances are as large as its errors are, by two-sided chi-square bands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.preparation.setup import make_dynamics
from reference_model.plant.sensing import measure
from reference_model.simulation import simulate
from robot_model import EffectUse, MultiSine, Recording, Reference, Robot, load_robot

Array = NDArray[np.float64]

#: Chance that a right covariance fails one band.
ERRS = 1e-3
#: Instants lie so far apart that errors at one say little of those at the next [s].
APART = 1.25
#: Recordings of each: as many as tell a variance that is wrong by half.
RUNS = {"two_link_arm": 3, "six_joint_space_arm": 1, "flexible_space_robot": 2}


def robot(name: str) -> Robot:
    """A shipped robot without effects, in a motion of sines; a fixed base, a free one, a link that bends."""
    described = load_robot(name)
    joints = tuple(
        MultiSine(
            joint=joint.name,
            amplitudes=(0.2, 0.08),
            frequencies=(0.06 + 0.02 * k, 0.17 + 0.04 * k),
            phases=(0.6 * k, 1.0 + k),
            ramp=5.0,
        )
        for k, joint in enumerate(described.moving_joints)
    )
    reference = Reference(duration=20.0, sample_rate=200.0, joints=joints)
    return described.model_copy(update={"reference": reference, "effects": ()})


@lru_cache(maxsize=4)
def truth(name: str, friction: float = 0.0) -> Recording:
    """Every channel of its run without noise; friction, where there is any, is dry and at joint 2."""
    described = robot(name)
    if friction:
        described = described.with_effects(EffectUse(effect="coulomb_friction", at="joint2", torque=friction))
    return simulate(described, sensors=False)


@dataclass(frozen=True)
class Errors:
    """Of q, v, x and the base's rate, errors at K instants and covariances; whitened innovations."""

    of: dict[str, tuple[Array, Array]]
    white: Array


def errors(name: str, seed: int, *, stated: bool = True, friction: float = 0.0) -> Errors:
    described, exact = robot(name), truth(name, friction)
    recording = measure(described, exact.time, exact.channels, seed=seed, source="")
    if not stated:
        recording = replace(recording, noise={}, resolution={})
        described = described.model_copy(update={"sensors": ()})
    dynamics = make_dynamics(described, [recording])[0]
    smoother = Segment(described, dynamics, dynamics.motion).smoother
    assert smoother is not None
    motion, names = dynamics.motion, [joint.name for joint in described.moving_joints]
    rows = np.arange(200, motion.time.size - 100, int(APART * motion.low_pass.rate))
    found = smoother.corrections(rows)
    n, s = smoother.response.joints, smoother.response.modes
    wrong = {
        "q": np.column_stack([exact[f"{joint}.position"] for joint in names]) - motion.position,
        "v": np.column_stack([exact[f"{joint}.velocity"] for joint in names]) - motion.velocity,
    }
    place = {"q": np.arange(n), "v": n + s + np.arange(n), "x": n + np.arange(s)}
    if dynamics.inner is not None:
        modal = [exact[channel] for channel in exact if ".modal_coordinate." in channel]
        wrong["x"] = np.column_stack(modal) - dynamics.inner.modal
    every = {
        key: (wrong[key][rows] - found.mean[:, columns], found.covariance[:, columns][:, :, columns])
        for key, columns in place.items()
        if key in wrong
    }
    if dynamics.base is not None:
        turn = np.column_stack([exact[f"base.angular_velocity.{axis}"] for axis in "xyz"])
        by = dynamics.base_rows(rows)
        left = (turn - dynamics.base.angular_velocity)[rows] - np.einsum("kij,kj->ki", by, found.mean)
        every["base"] = left, by @ found.covariance @ by.transpose(0, 2, 1)
    return Errors(every, found.innovations)


def squares(error: Array, covariance: Array) -> tuple[float, int]:
    """Normalised square of the errors and how many independent numbers are in it."""
    size = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    shapes = covariance / size[:, :, None] / size[:, None, :]
    values, vectors = np.linalg.eigh(shapes)
    turned = np.einsum("kji,kj->ki", vectors, error / size)
    # a base that two joints turn has two ways to turn: what has no variance is no number
    known = values > 1e-6 * values[:, -1:]
    return float(np.sum(turned[known] ** 2 / values[known])), int(known.sum())


def band(count: int) -> tuple[float, float]:
    low, high = stats.chi2.ppf([ERRS / 2, 1 - ERRS / 2], count) / count
    return float(low), float(high)


@pytest.mark.parametrize(
    ("name", "stated"),
    [
        pytest.param(
            name,
            stated,
            id=f"{name}-noise {'stated' if stated else 'estimated'}",
            marks=() if stated and name == "two_link_arm" else pytest.mark.proof,
        )
        for name in RUNS
        for stated in (True, False)
    ],
)
def test_errors_are_as_large_as_the_smoother_says(name: str, stated: bool) -> None:
    runs = [errors(name, seed, stated=stated) for seed in range(10800, 10800 + RUNS[name])]
    for key in runs[0].of:
        parts = [squares(*run.of[key]) for run in runs]
        total, count = (sum(column) for column in zip(*parts))
        low, high = band(int(count))
        assert low < total / count < high, key
    for run in runs:
        # rounding to the resolution is no white noise while a joint is slow: 5 % of variance at most here
        power = np.mean(run.white**2)
        low, high = band(run.white.size)
        assert low - 0.02 < power < high + 0.06
        # next to each other innovations say nothing of each other; the same for the bound
        assert np.abs(np.mean(run.white[1:] * run.white[:-1], axis=0)).max() < 0.1


@pytest.mark.proof
def test_friction_that_nobody_mentioned_widens_what_is_said() -> None:
    """Dry friction jumps, a random walk does not: errors may be half as large again, never several times."""
    run = errors("flexible_space_robot", 10802, friction=1.0)
    for key, (error, covariance) in run.of.items():
        total, count = squares(error, covariance)
        assert 0.3 < total / count < 1.5 * band(count)[1], key
    quiet = errors("flexible_space_robot", 10802)
    modes = [np.trace(r.of["x"][1], axis1=1, axis2=2).mean() for r in (quiet, run)]
    assert modes[1] > 2.0 * modes[0]

"""Velocities against positions: wrong derivatives are reported, noisy ones are not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.typing import NDArray
from scipy import signal

from missing_physics.recordings import Finding, consistency_findings
from robot_model import Recording, load_robot

Array = NDArray[np.float64]
RATE = 200.0
TIME = np.arange(4000) / RATE
GEAR = 160.0
P, V = "joint1.position", "joint1.velocity"


def motion(time: Array, size: float = 0.5, pace: float = 1.0) -> tuple[Array, Array]:
    """A sum of sines and its rate."""
    parts = ((size, 0.23 * pace, 0.3), (0.3 * size, 0.61 * pace, 1.0), (0.05 * size, 1.7 * pace, 2.0))
    position = sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in parts)
    rate = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * time + p) for a, f, p in parts)
    return np.asarray(position), np.asarray(rate)


def recording(velocity: Array, position: Array | None = None, seed: int = 0) -> Recording:
    """With an encoder of 1e-5 rad noise."""
    q = motion(TIME)[0] if position is None else position
    return Recording(TIME, {P: q + 1e-5 * default_rng(seed).standard_normal(q.size), V: velocity}, "made.csv")


def errors(made: Recording, *, robot: bool = False) -> list[Finding]:
    found = consistency_findings(made, robot=load_robot("flexible_space_robot") if robot else None)
    return [finding for finding in found if finding.severity == "error"]


@pytest.mark.parametrize("factor", [GEAR, 1 / GEAR])
@pytest.mark.parametrize("noise", [1e-4, 0.3])
def test_motor_side_velocity_is_recognised_by_the_gear_ratio(factor: float, noise: float) -> None:
    velocity = factor * (motion(TIME)[1] + noise * default_rng(1).standard_normal(TIME.size))
    [found] = errors(recording(velocity), robot=True)
    assert (found.kind, found.channel) == ("gear_ratio", V)
    assert found.corrections[0].scale * factor == pytest.approx(1.0)


@pytest.mark.parametrize("factor", [0.3, 0.6, 1.4, 3.0, 20.0, 160.0])
@pytest.mark.parametrize("noise", [1e-4, 0.5])
def test_other_factor_of_a_velocity_is_an_error(factor: float, noise: float) -> None:
    """The noise is as large as the motion: its rms is 0.6 rad/s."""
    velocity = factor * (motion(TIME)[1] + noise * default_rng(2).standard_normal(TIME.size)) + 0.2
    [found] = errors(recording(velocity))
    assert (found.kind, found.channel) == ("velocity_scale", V)
    assert found.corrections[0].scale * factor == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize("lag", [-0.12, 0.08, 0.3, 1.0])
@pytest.mark.parametrize("noise", [1e-4, 0.2])
def test_a_lag_beyond_that_of_filters_is_an_error(lag: float, noise: float) -> None:
    velocity = motion(TIME - lag)[1] + noise * default_rng(3).standard_normal(TIME.size)
    [found] = errors(recording(velocity))
    assert (found.kind, found.channel) == ("lag", V)
    assert found.corrections[0].delay == pytest.approx(lag, abs=0.01)


STRANGERS = {
    "another motion": motion(TIME, pace=1.37)[1],
    "noise alone": 0.1 * default_rng(4).standard_normal(TIME.size),
    "a drift": 0.01 * TIME,
    "an acceleration": np.gradient(motion(TIME)[1], TIME),
}


@pytest.mark.parametrize("which", STRANGERS)
def test_a_velocity_that_is_not_the_derivative_is_an_error(which: str) -> None:
    [found] = errors(recording(STRANGERS[which]))
    assert (found.kind, found.channel) == ("not_derivative", V)
    assert "leave it out" in found.sentence


def test_velocity_of_another_joint_is_recognised() -> None:
    q, v = motion(TIME, size=0.4, pace=1.37)
    made = recording(v).with_channels({"joint2.position": q, "joint2.velocity": v})
    [found] = errors(made)
    assert (found.channel, found.kind) == (V, "not_derivative")
    assert "goes with joint2.position" in found.sentence


def honest() -> dict[str, tuple[Array, Array]]:
    """Position and velocity that belong together, as sensors tell them."""
    q, v = motion(TIME)
    chance = default_rng(5)
    made = {f"noise {s}": (q, v + s * chance.standard_normal(v.size)) for s in (0.1, 0.6, 3.0, 20.0)}
    made |= {f"steps {d}": (q, np.round(v / d) * d) for d in (0.05, 0.2, 0.5)}
    coarse = np.round(q / 0.002) * 0.002
    made["differences of a coarse encoder"] = coarse, np.gradient(coarse, TIME)
    backwards = np.concatenate([[0.0], np.diff(coarse)]) * RATE
    made["filtered differences of one"] = coarse, signal.lfilter(*signal.butter(2, 10.0, fs=RATE), backwards)
    for cutoff in (8.0, 20.0):
        made[f"filtered at {cutoff} Hz"] = q, signal.lfilter(*signal.butter(1, cutoff, fs=RATE), v)
    made["offset"] = q, v + 0.5
    made["gain"] = q, 1.1 * v
    still = 1e-5 * chance.standard_normal(v.size)
    made["at rest"] = still, 0.01 * chance.standard_normal(v.size)
    made["even"] = 0.3 * TIME, 0.3 + 0.05 * chance.standard_normal(v.size)
    short = np.where(TIME < 2.0, 1.0 - np.cos(np.pi * TIME), 0.0)
    made["brief"] = short, np.where(TIME < 2.0, np.pi * np.sin(np.pi * TIME), 0.0) + 0.1 * still
    stray = v.copy()
    stray[chance.integers(0, v.size, 6)] = 300.0
    made["strays"] = q, stray
    fast, rate = motion(TIME, size=0.02, pace=8.0)
    made["fast and noisy"] = fast, rate + 0.5 * chance.standard_normal(v.size)
    made["noisy encoder"] = q + 0.02 * chance.standard_normal(v.size), v
    gone = v.copy()
    gone[chance.random(v.size) < 0.2] = np.nan
    made["missing samples"] = q, gone
    slow = np.full(v.size, np.nan)
    slow[1::8] = v[1::8]
    made["slower clock"] = q, slow
    return made


HONEST = honest()


@pytest.mark.parametrize("which", HONEST)
def test_noisy_velocity_is_not_reported(which: str) -> None:
    position, velocity = HONEST[which]
    assert errors(recording(velocity, position)) == []


@pytest.mark.parametrize("draws", [12, pytest.param(40, marks=pytest.mark.proof)])
def test_random_velocities_are_not_reported(draws: int) -> None:
    """Draws of noise as large as the motion, and of four times that."""
    q, v = motion(TIME)
    for seed in range(draws):
        noise = (0.6 if seed % 2 else 2.4) * default_rng(100 + seed).standard_normal(v.size)
        assert errors(recording(v + noise, q, seed)) == []

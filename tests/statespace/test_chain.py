"""The filter against a dense Gaussian, the smoother against batch least squares, the kernel and its twin."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.statespace import chain as chain_module
from missing_physics.statespace.chain import Chain, Gains
from missing_physics.statespace.twin import _transition


def problem(seed: int, samples: int = 40) -> tuple[Chain, dict[str, np.ndarray]]:
    """A joint with uneven steps, varying inertia, two rows of which some samples lack a measurement."""
    chance = np.random.default_rng(seed)
    chain = Chain(
        step=np.where(chance.random(samples) < 0.7, 0.01, chance.uniform(0.005, 0.03, samples)),
        mobility=chance.uniform(0.5, 2.0, samples),
        stiffness=chance.uniform(-5.0, 20.0, samples),
        damping=chance.uniform(0.0, 3.0, samples),
        rows=np.array([0, 1], dtype=np.int32),
        start=np.array([0.3, 0.5]),
    )
    noise = np.tile([1e-3, 2e-2], (samples, 1))
    noise[chance.random((samples, 2)) < 0.3] = -1.0
    levels = {
        "force": chance.uniform(0.1, 2.0, samples),
        "latent": np.array([0.5, 0.02]),
        "levels": np.array([0.7, 0.2]),
        "noise": noise,
    }
    return chain, levels


def dense(chain: Chain, levels: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Covariance of all states (N s, N s), of measurements, and which rows of the states are measured."""
    count, states = len(chain.step), 2 + levels["latent"].size
    covariance = np.zeros((count * states, count * states))
    block = np.diag(np.concatenate([chain.start, levels["levels"]]))
    covariance[:states, :states] = block
    for t in range(count - 1):
        arguments = chain.step[t], chain.mobility[t], chain.stiffness[t], chain.damping[t]
        whole, pushed = _transition(*arguments, levels["latent"])
        at, past = slice((t + 1) * states, (t + 2) * states), slice(0, (t + 1) * states)
        covariance[at, past] = whole @ covariance[t * states : (t + 1) * states, past]
        covariance[past, at] = covariance[at, past].T
        block = whole @ block @ whole.T + levels["force"][t] * np.outer(pushed, pushed)
        decay = np.exp(-2.0 * chain.step[t] / levels["latent"])
        block[2:, 2:] += np.diag((1.0 - decay) * levels["levels"])
        covariance[at, at] = block
    where = np.argwhere(levels["noise"] >= 0.0)
    measured = np.array([t * states + chain.rows[j] for t, j in where])
    sigma = covariance[np.ix_(measured, measured)] + np.diag([levels["noise"][t, j] for t, j in where])
    return covariance, sigma, measured


def drawn(chain: Chain, levels: dict[str, np.ndarray], seed: int) -> np.ndarray:
    chance = np.random.default_rng(seed)
    return np.where(levels["noise"] >= 0.0, chance.standard_normal(levels["noise"].shape), 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_the_likelihood_is_that_of_the_dense_gaussian(seed: int) -> None:
    chain, levels = problem(seed)
    y = drawn(chain, levels, seed)
    gains = chain.gains(**levels)
    white = chain.whitened(gains, None, y[:, :, None])
    mine = -0.5 * (np.sum(white**2) + gains.log_determinant)
    _, sigma, _ = dense(chain, levels)
    values = y[levels["noise"] >= 0.0]
    exact = -0.5 * (values @ np.linalg.solve(sigma, values) + np.linalg.slogdet(sigma)[1])
    assert mine == pytest.approx(exact, rel=1e-10)


def test_whitened_columns_have_the_inner_products_of_the_dense_gaussian() -> None:
    """C' Sigma^-1 C for columns of measurements, which is what a regression needs."""
    chain, levels = problem(4)
    columns = np.stack([drawn(chain, levels, k) for k in range(3)], axis=2)
    white = chain.whitened(chain.gains(**levels), None, columns).reshape(-1, 3)
    _, sigma, _ = dense(chain, levels)
    there = columns[levels["noise"] >= 0.0]
    np.testing.assert_allclose(white.T @ white, there.T @ np.linalg.solve(sigma, there), rtol=1e-9)


def test_a_force_column_is_its_response_as_a_measurement_column() -> None:
    """A known force shows in the innovations as minus what it makes the rows measure."""
    chain, levels = problem(5)
    force = np.cumsum(np.random.default_rng(0).standard_normal(len(chain.step)))
    state, seen = np.zeros(4), np.zeros((len(force), 2))
    for t in range(len(force)):
        seen[t] = state[:2]
        arguments = chain.step[t], chain.mobility[t], chain.stiffness[t], chain.damping[t]
        whole, pushed = _transition(*arguments, levels["latent"])
        state = whole @ state + pushed * force[t]
    gains = chain.gains(**levels)
    driven = chain.whitened(gains, force[:, None], None)
    measured = chain.whitened(gains, None, -seen[:, :, None])
    np.testing.assert_allclose(driven, measured, atol=1e-9 * np.abs(measured).max())


def test_the_smoother_is_batch_least_squares() -> None:
    chain, levels = problem(6)
    y = drawn(chain, levels, 6)
    gains = chain.gains(**levels, covariances=True)
    found = chain.smoothed(gains, np.zeros(len(chain.step)), y)
    covariance, sigma, measured = dense(chain, levels)
    lever = covariance[:, measured] @ np.linalg.inv(sigma)
    mean = (lever @ y[levels["noise"] >= 0.0]).reshape(-1, 4)
    spread = np.diag(covariance - lever @ covariance[measured]).reshape(-1, 4)
    np.testing.assert_allclose(found.position, mean[:, 0], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.velocity, mean[:, 1], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.forces, mean[:, 2:], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.position_variance, spread[:, 0], rtol=1e-6)
    np.testing.assert_allclose(found.velocity_variance, spread[:, 1], rtol=1e-6)


def test_without_a_compiler_the_numbers_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    chain, levels = problem(7)
    y, force = drawn(chain, levels, 7), np.linspace(-1.0, 1.0, len(chain.step))

    def run() -> tuple[Gains, np.ndarray]:
        gains = chain.gains(**levels, covariances=True)
        found = chain.smoothed(gains, force, y)
        return gains, np.column_stack([found.position, found.velocity, found.forces, found.velocity_variance])

    if chain_module.compiled_kernel() is None:
        pytest.skip("no C compiler: there is only the twin")
    compiled, smooth = run()
    monkeypatch.setattr(chain_module, "compiled_kernel", lambda: None)
    plain, other = run()
    np.testing.assert_allclose(plain.gain, compiled.gain, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(plain.variance, compiled.variance, rtol=1e-10)
    np.testing.assert_allclose(other, smooth, rtol=1e-7, atol=1e-10)

"""What a forecast's error is worth against the uncertainty of the numbers that made it."""

from __future__ import annotations

import numpy as np

from missing_physics.diagnosis.folds import forecast_error, solved


def test_forecast_error_is_exceeded_as_seldom_as_it_says() -> None:
    """A line fitted near nothing foretells far off: its error there is that of its slope."""
    rng = np.random.default_rng(10691)
    groups, length, trials = 8, 40, 400
    blocks = np.repeat(np.arange(4 * groups), length // 4)
    asked = np.array([[1.0, 5.0]])
    exceeded = 0
    for _ in range(trials):
        x = np.column_stack([np.ones(groups * length), rng.uniform(-1, 1, groups * length)])
        y = x @ np.array([0.3, 2.0]) + rng.standard_normal(len(x))
        beta = solved(x.T @ x, x.T @ y)
        wrong = float((asked[0] @ (beta - np.array([0.3, 2.0]))) ** 2)
        exceeded += wrong > forecast_error(np.column_stack([x, y]), blocks, np.zeros(2), asked)
    # 5 % of 400 is 20 +- 4.4; three of those.
    assert 7 <= exceeded <= 33


def test_one_stretch_alone_foretells_nothing_for_sure() -> None:
    rows = np.ones((10, 2))
    assert np.isinf(forecast_error(rows, np.zeros(10, dtype=int), np.zeros(1), np.ones((3, 1))))

"""Scans for structures that yield, over recordings that begin in different ways."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.inference.torques.scans import gains


def test_recordings_may_have_different_numbers_of_free_vibrations() -> None:
    """A vibration that one recording lacks is one that contributes nothing to it, and costs nothing."""
    random = np.random.default_rng(1)
    rows, joints, grid = (30, 20), 2, 3
    parts = [random.standard_normal((k, joints, grid, 1 + free)) for k, free in zip(rows, (2, 1))]
    whole = sum(rows) * joints
    known = np.linalg.qr(random.standard_normal((whole, 4)))[0]
    left = random.standard_normal(whole)
    left -= known @ (known.T @ left)
    padded = [parts[0], np.concatenate([parts[1], np.zeros((rows[1], joints, grid, 1))], axis=3)]
    for one, other in zip(gains(parts, known, left), gains(padded, known, left)):
        assert one == pytest.approx(other)
    alone = [part[..., :1] for part in parts]  # without free vibrations: least squares with a step of one
    gain, price = gains(alone, known, left)
    assert price == pytest.approx(np.zeros(grid))
    column = np.concatenate([part[:, :, 0, 0].ravel() for part in alone])
    after = left - column
    after -= known @ (known.T @ after)
    assert gain[0] == pytest.approx(0.5 * (left @ left - after @ after))

"""Normal equations joint by joint, against those over all parameters."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.standard.fit import residual_rms
from missing_physics.standard.normal import Normal, acting, total_of

RANDOM = np.random.default_rng(7)
#: Which of five parameters two joints feel.
FELT = np.array([[True, True, False, False, True], [False, False, True, True, False]])
DESIGN = RANDOM.normal(size=(40, 2, 5)) * FELT
TORQUE = RANDOM.normal(size=(40, 2))


def normal(rows: slice) -> Normal:
    active = acting([DESIGN])
    columns = [DESIGN[rows, k, own] for k, own in enumerate(active)]
    return Normal.of(active, columns, TORQUE[rows], np.full(2, 40.0), 5)


def test_parameters_act_on_a_joint_if_they_do_in_any_recording() -> None:
    first, second = DESIGN.copy(), DESIGN.copy()
    first[:, 0, 0], second[:, 0, 1] = 0.0, 0.0
    assert [own.tolist() for own in acting([first, second])] == [[0, 1, 4], [2, 3]]


@pytest.mark.parametrize(
    "whole", [normal(slice(None)), total_of([normal(slice(0, 15)), normal(slice(15, 40))])]
)
def test_energy_and_weighted_sums_equal_those_over_all_parameters(whole: Normal) -> None:
    x, weight = RANDOM.normal(size=5), np.array([2.0, 0.3])
    assert whole.energy(x) == pytest.approx(np.sum((TORQUE - DESIGN @ x) ** 2, axis=0), rel=1e-12)
    gram, right = whole.weighted(weight)
    assert gram == pytest.approx(np.einsum("j,tjx,tjy->xy", weight, DESIGN, DESIGN), abs=1e-12)
    assert right == pytest.approx(np.einsum("j,tjx,tj->x", weight, DESIGN, TORQUE), abs=1e-12)


def test_residual_of_a_joint_that_nothing_drives_is_at_least_its_noise() -> None:
    whole, x = normal(slice(None)), RANDOM.normal(size=5)
    free = residual_rms(whole, x)
    assert free == pytest.approx(np.sqrt(np.mean((TORQUE - DESIGN @ x) ** 2, axis=0)), rel=1e-12)
    least = np.array([2.0 * free[0], 0.5 * free[1]])
    assert residual_rms(whole, x, least) == pytest.approx([least[0], free[1]], rel=1e-12)

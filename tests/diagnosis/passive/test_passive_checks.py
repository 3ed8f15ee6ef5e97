"""A change of base or links has to be borne out where every joint slides: sticking joints restrain modes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.diagnosis.passive import checks as passive_checks
from missing_physics.diagnosis.passive.checks import SLIDING, borne_out, moving
from missing_physics.diagnosis.passive.fit import PassiveFit

Array = NDArray[np.float64]

COUNT, SLOW, TRIED = 2000, 1e-4, 3
#: Every innovation changes by this for a number of one.
SHAPE = np.random.default_rng(12220).standard_normal(COUNT)
RESTING = np.arange(COUNT) >= COUNT // 2


def trial(effect: Array, value: float, speed: Array) -> PassiveFit:
    """A fit of one number to white noise and what an effect adds to it, one channel."""
    noise = np.random.default_rng(12221).standard_normal(COUNT)
    motion = SimpleNamespace(time=0.01 * np.arange(COUNT), velocity=speed[:, None])
    segment = SimpleNamespace(motion=motion, places=(SimpleNamespace(transition=SLOW),))
    smoother = SimpleNamespace(channels=1, whitened=lambda torques, gaps: torques[:, :1])
    fit = SimpleNamespace(
        segments=(segment,),
        smoothers=(smoother,),
        terms=(SimpleNamespace(values=np.array([value])),),
        columns=SHAPE[:, None],
        errors=noise + effect * SHAPE - value * SHAPE,
    )
    return cast(PassiveFit, fit)


@pytest.fixture(autouse=True)
def nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    none = np.zeros((COUNT, 1, 1)), np.zeros((COUNT, 1, 1))
    monkeypatch.setattr(passive_checks, "masses", lambda segment, directions: none)
    monkeypatch.setattr(passive_checks, "at_joints", lambda segment: none)


def judged(effect: Array, value: float, speed: Array) -> str:
    return borne_out(trial(effect, value, speed), slice(0, 1), np.zeros((0, 0)), TRIED)


def test_what_acts_at_any_time_is_borne_out() -> None:
    assert not judged(np.full(COUNT, 0.5), 0.5, np.where(RESTING, 0.0, 0.1))


def test_what_shows_only_while_a_joint_rests_is_not() -> None:
    # The fit of all samples takes half of what is there in half of them.
    assert "not borne out" in judged(np.where(RESTING, 1.0, 0.0), 0.5, np.where(RESTING, 0.0, 0.1))


def test_another_number_where_joints_move_is_another_effect() -> None:
    # At 1.8 of the number that holds where joints move 1 - 0.8^2 of the gain there is left.
    assert "other numbers" in judged(np.where(RESTING, 0.8, 0.3), 0.55, np.where(RESTING, 0.0, 0.1))


def test_nothing_is_borne_out_by_joints_at_rest() -> None:
    assert "at rest" in judged(np.full(COUNT, 0.5), 0.5, np.zeros(COUNT))


def test_a_joint_slides_beyond_ten_times_the_speed_whose_sign_is_not_known() -> None:
    speed = np.where(RESTING, -1.1, 0.9) * SLIDING * SLOW
    segments = trial(np.zeros(COUNT), 0.0, speed).segments
    assert np.array_equal(moving(segments), RESTING)

"""Physics outside the catalogue: closed forms and places."""

from __future__ import annotations

import numpy as np
import pytest
from challenge_cases import ARM, design

from exudyn_model import ArmInstant
from missing_physics.challenge.cases.ranges import Draw
from missing_physics.challenge.draws.foreign import COUPLED, KINDS, _oscillated, draw_foreign, foreign_force
from missing_physics.challenge.draws.manoeuvre import scales_of
from reference_model.effects.catalogue import catalogue


def test_foreign_kinds_are_not_in_the_catalogue() -> None:
    assert len(KINDS) >= 8
    assert not set(KINDS) & set(catalogue())


def test_free_oscillation_composes_and_decays() -> None:
    w, z = 12.0, 0.03
    whole = _oscillated(0.3, -1.0, w=w, z=z, h=0.4)
    steps = (0.3, -1.0)
    for _ in range(400):
        steps = _oscillated(*steps, w=w, z=z, h=1e-3)
    assert np.allclose(whole, steps, rtol=1e-10)
    damped = w * np.sqrt(1 - z * z)
    period = _oscillated(0.3, 0.0, w=w, z=z, h=2 * np.pi / damped)
    assert period[0] == pytest.approx(0.3 * np.exp(-z * w * 2 * np.pi / damped))


def instants(joints: int, at: int) -> list[ArmInstant]:
    """A joint that swings once a second while the others swing slower."""
    time = np.arange(0, 3, 1e-3)
    rows = []
    for k, t in enumerate(time):
        rate = 2 * np.pi * np.where(np.arange(joints) == at, 1.0, 0.3)
        position, velocity = np.sin(rate * t), rate * np.cos(rate * t)
        before = rows[-1].velocity if rows else velocity.tolist()
        rows.append(
            ArmInstant(
                float(t), 1e-3 if k else 0.0, position.tolist(), velocity.tolist(), [5.0] * joints, before,
                [5.0] * joints,
            )
        )  # fmt: skip
    return rows


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_acts_on_its_own_joint_only(kind: str) -> None:
    case = design(ARM)
    scales = scales_of(case.nominal, np.ones((600, 2)))
    draw = Draw(np.random.default_rng(1))
    while (foreign := draw_foreign(scales, draw)).kind != kind:
        pass
    assert (foreign.other != "") == (kind in COUPLED)
    force, at = foreign_force(case.nominal, foreign), int(foreign.joint[-1]) - 1
    rows = instants(2, at)
    memory, forces = force.initial(rows[0]), []
    for now in rows:
        trial, _ = force.advance(now, memory)
        again, memory = force.advance(now, memory)
        assert trial == again  # a trial that is thrown away leaves no trace
        forces.append(again)
    values = np.array(forces)
    assert np.isfinite(values).all()
    assert not values[:, 1 - at].any()
    assert np.ptp(values[:, at]) > 0


def test_every_foreign_kind_is_drawn() -> None:
    case = design(ARM)
    scales = scales_of(case.nominal, np.ones((600, 2)))
    draw = Draw(np.random.default_rng(0))
    assert {draw_foreign(scales, draw).kind for _ in range(200)} == set(KINDS)

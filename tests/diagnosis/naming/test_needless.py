"""What the others make superfluous leaves; what is needed, or named elsewhere, stays."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, plain_view, problem_of, recorded, term

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.needless import without_needless

PULSE = ("external_torque", "joint2")


def _explained(pulse: float) -> Explanation:
    """Coulomb friction and a pulse beside it, both fitted to friction and a pulse of this size."""
    robot = bare("two_link_arm", noise=True)
    exact = recorded(
        robot,
        ARM,
        lambda t, q, v, a: np.column_stack(
            [np.zeros(len(t)), 0.7 * np.tanh(v[:, 1] / 1e-3) - pulse * ((t[:, 0] > 4.0) & (t[:, 0] < 5.0))]
        ),
        seed=3,
    )
    problem = problem_of(robot, exact)
    terms = [
        term("coulomb_friction", "joint2", torque=0.5),
        term(*PULSE, torque=0.1, start=4.0, duration=1.0),
    ]
    return explain(problem, plain_view(problem, scale=problem.noise_floor), terms)


def test_what_nothing_asks_for_any_more_leaves() -> None:
    best, dropped = without_needless(_explained(0.0), (), nuisance=True)
    assert [t.label for t in best.found] == ["coulomb_friction@joint2"]
    assert [t.key for t, _ in dropped] == [PULSE]
    assert "not needed" in dropped[0][1]


@pytest.mark.parametrize(("pulse", "kept"), [(0.5, ()), (0.0, (PULSE,))])
def test_what_is_needed_stays_and_so_does_what_was_found_another_way(
    pulse: float, kept: tuple[tuple[str, str], ...]
) -> None:
    given = _explained(pulse)
    best, dropped = without_needless(given, kept, nuisance=True)
    assert best is given
    assert not dropped
